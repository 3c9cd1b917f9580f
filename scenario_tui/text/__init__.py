"""How things are said to people: words, numbers, styles, and texts made of them.

Used by the command line, the dashboard and the report; nothing here imports textual.
"""
