"""Texts for people: words, numbers, styles, and whole reports.

The command line, the dashboard and the report use them; no module here imports textual.
"""
