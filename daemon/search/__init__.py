"""Searching for failures: which values make a scenario fail, and how near they are."""
