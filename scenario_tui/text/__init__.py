"""Texts for people: words, numbers, styles, and whole reports.

Used by the command line, the dashboard and the report; nothing here imports textual.
"""
