"""A session in a terminal as asciinema plays it: ``python -m campaigns.studies.pictures --cast``.

What the terminal gets is kept as an asciicast (version 2: a line of JSON about the terminal, then
one for each piece of output), with pauses cut short. The format:
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
"""Seconds without output that are kept at most."""
LARGEST = 300_000
"""Bytes of a cast in the documentation."""
_TO_BE_READ = 1.2
"""Seconds for which what a step leads to stays, at least."""

_LONGEST_WAIT = 1.0
"""Second of which everything is kept while something is waited for."""
_CANCEL, _REDRAW = "\x18", "\x0c"
"""What ends an escape sequence that was cut, and the key that draws the screen again."""


class CastRecorder:
    """Drives a program in a terminal and keeps what it sends, by time."""

    def __init__(self, shown):
        self._shown = shown
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._kept = 0
        self._now = 0.0
        self._last = time.monotonic()
        self.events = []

    def take(self, seconds):
        """Let the program go on for a while."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._shown.read(min(left, 0.05))
            self._keep()

    def until(self, seen):
        """Let the program go on until a text is on the screen, or something is true.

        Of what it sends meanwhile the first seconds are kept, and how it looks in the end.
        """
        true = seen if callable(seen) else lambda: seen in self._shown.text
        begun = time.monotonic()
        while not true():
            waited = time.monotonic() - begun
            assert waited < DEADLINE, f"not in time: {seen!r}\n{self._shown.text}"
            self.take(0.05)
            if waited > _LONGEST_WAIT and self._shown.mode(ALTERNATE):
                self._skip(true)

    def _skip(self, true):
        """Keep nothing until something is true, then all of the screen."""
        self._shown.until(true)
        self._kept = len(self._shown.raw)
        self._decoder.reset()
        self.events.append((round(self._now, 3), "o", _CANCEL))
        self._shown.type(_REDRAW)
        self.take(_TO_BE_READ)

    def mark(self, words):
        """Name the place reached; players show it on their timeline."""
        self.events.append((round(self._now, 3), "m", words))

    def _keep(self):
        sent, now = self._shown.raw[self._kept :], time.monotonic()
        if sent:
            self._kept += len(sent)
            self._now += min(now - self._last, LONGEST_PAUSE)
            self._last = now
            self.events.append((round(self._now, 3), "o", self._decoder.decode(bytes(sent))))

    def write(self, path, title):
        """Write the cast."""
        screen = self._shown.screen
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
    """Record how somebody follows the tutorial of the dashboard, its sections as marks."""
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
