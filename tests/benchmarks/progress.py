"""How far a benchmark is, while it has nothing to print yet: on standard error.

On a terminal in place, so that it leaves nothing behind; in a file a line for each step.
"""

import shutil
import sys

ERASE = "\r\x1b[K"
"""To the first column, and nothing left in the line."""


class Progress:
    """Says on a stream how far something is; ``None`` is standard error as it is then."""

    def __init__(self, stream=None):
        self._stream = stream
        self._step = None
        self._in_place = False

    def say(self, text, step=None):
        """Say how far it is. In a file that is a line, unless ``step`` is that of the last line."""
        stream = self._stream or sys.stderr
        if stream.isatty():
            room = max(shutil.get_terminal_size().columns - 1, 20)
            print(ERASE + f"  {text}"[:room], end="", file=stream, flush=True)
            self._in_place = True
        elif step is None or step != self._step:
            print(f"  {text}", file=stream, flush=True)
        self._step = step

    def clear(self):
        """Take away what stands on a terminal, since a line of something else comes now."""
        if self._in_place:
            print(ERASE, end="", file=self._stream or sys.stderr, flush=True)
            self._in_place = False
        self._step = None


_PROGRESS = Progress()
say, clear = _PROGRESS.say, _PROGRESS.clear
