"""Having the runs of a search executed by a daemon, and reading what they say."""
