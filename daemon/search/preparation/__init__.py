"""From a campaign file to a search: composed, checked before its first run, handed over."""
