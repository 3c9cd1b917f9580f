"""Searches for failures: values with which a scenario fails, and their distance."""
