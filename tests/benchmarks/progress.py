"""How far a benchmark is, while it has nothing to print yet: on standard error.

On a terminal in place, so that it leaves nothing behind; in a file a line for each step.
"""

import sys

ERASE = "\r\x1b[K"
"""To the first column, and nothing left in the line."""
_last_steps = []


def say(text, step=None):
    """Say how far it is. In a file that is a line, unless ``step`` is that of the last line."""
    if sys.stderr.isatty():
        print(f"{ERASE}  {text}"[:78], end="", file=sys.stderr, flush=True)
    elif step is None or _last_steps != [step]:
        print(f"  {text}", file=sys.stderr, flush=True)
    _last_steps[:] = [step]


def clear():
    """Take away what stands on a terminal, since a line of something else comes now."""
    if sys.stderr.isatty():
        print(ERASE, end="", file=sys.stderr, flush=True)
