"""The answer of a search: its facts and its sentences."""
