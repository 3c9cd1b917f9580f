"""A terminal session for asciinema: ``python -m campaigns.studies.pictures --cast``.

The output is recorded as an asciicast (version 2: a line of JSON about the terminal, then one for
each piece of output), with pauses cut short. The format:
https://docs.asciinema.org/manual/asciicast/v2/
"""

import codecs
import json
import tempfile
import time
from pathlib import Path

from tests.long.first_hour import DOCUMENT, follow, read_steps, shell_in
from tests.people.terminal.pseudo_terminal import ALTERNATE, DEADLINE, ROOT

CAST = ROOT / "docs" / "pictures" / "first-hour.cast"
LONGEST_PAUSE = 1.5
"""Longest pause without output [s]."""
LARGEST = 300_000
"""Largest size of a cast in the documentation [bytes]."""
_TO_BE_READ = 1.2
"""Shortest time for which the result of a step stays visible [s]."""

_LONGEST_WAIT = 1.0
"""Recorded time of each wait [s]."""
_CANCEL, _REDRAW = "\x18", "\x0c"
"""The end of a cut escape sequence, and the key that draws the screen again."""


class CastRecorder:
    """Drives a program in a terminal and records its output over time."""

    def __init__(self, terminal):
        self._terminal = terminal
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._recorded = 0
        self._now = 0.0
        self._last = time.monotonic()
        self.events = []

    def take(self, seconds):
        """Record the program for a while."""
        end = time.monotonic() + seconds
        while (rest := end - time.monotonic()) > 0.0:
            self._terminal.read(min(rest, 0.05))
            self._record()

    def until(self, goal):
        """Let the program continue until a text is on the screen, or a condition holds.

        Record the beginning of the wait, and the final screen.
        """
        is_reached = goal if callable(goal) else lambda: goal in self._terminal.text
        start = time.monotonic()
        while not is_reached():
            waited = time.monotonic() - start
            assert waited < DEADLINE, f"not in time: {goal!r}\n{self._terminal.text}"
            self.take(0.05)
            if waited > _LONGEST_WAIT and self._terminal.mode(ALTERNATE):
                self._skip(is_reached)

    def _skip(self, is_reached):
        """Record nothing until a condition holds, then the whole screen."""
        self._terminal.until(is_reached)
        self._recorded = len(self._terminal.raw)
        self._decoder.reset()
        self.events.append((round(self._now, 3), "o", _CANCEL))
        self._terminal.type(_REDRAW)
        self.take(_TO_BE_READ)

    def mark(self, words):
        """Name the current place; players show it on their timeline."""
        self.events.append((round(self._now, 3), "m", words))

    def _record(self):
        output, now = self._terminal.raw[self._recorded :], time.monotonic()
        if output:
            self._recorded += len(output)
            self._now += min(now - self._last, LONGEST_PAUSE)
            self._last = now
            self.events.append((round(self._now, 3), "o", self._decoder.decode(bytes(output))))

    def write(self, path, title):
        """Write the cast."""
        screen = self._terminal.screen
        head = {
            "version": 2,
            "width": screen.columns,
            "height": screen.lines,
            "idle_time_limit": LONGEST_PAUSE,
            "title": title,
            "env": {"TERM": "xterm-256color"},
        }
        lines = [head, *self.events]
        text = "".join(f"{json.dumps(line, ensure_ascii=False)}\n" for line in lines)
        path.write_text(text, "utf-8")


def record_session(path=CAST):
    """Record the tutorial of the dashboard, with its sections as marks."""
    steps = read_steps(DOCUMENT.read_text("utf-8"))
    with tempfile.TemporaryDirectory(prefix="lab-") as folder, shell_in(Path(folder)) as shell:
        cast = CastRecorder(shell)

        def mark(step):
            if step.section not in (data for _, kind, data in cast.events if kind == "m"):
                cast.mark(step.section)

        follow(shell, steps, cast.until, mark, lambda _: cast.take(_TO_BE_READ))
        cast.write(path, "The first hour with the dashboard of scenario")
    size = path.stat().st_size
    assert size < LARGEST, f"{path} has {size} bytes, {LARGEST} are allowed"
