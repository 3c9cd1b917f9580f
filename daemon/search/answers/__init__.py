"""The answer of a search: its facts, its sentences, and the files it leaves."""
