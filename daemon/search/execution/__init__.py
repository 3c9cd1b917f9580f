"""Having the runs of a search executed, here or by a daemon, and reading what they say."""
