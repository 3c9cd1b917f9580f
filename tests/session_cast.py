"""A session with the dashboard as asciinema plays it: ``python -m tests.pictures --cast``.

The real dashboard in a pseudo-terminal over a real daemon that executes the demo. What it sends is
kept as an asciicast (version 2: a line of JSON about the terminal, then one for each piece of
output), with pauses cut short.
"""

from __future__ import annotations

import codecs
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from daemon.campaign import expand, load_campaign
from tests.daemon.batch.harness import daemon_at
from tests.scenario_tui.terminal.pseudo_terminal import Terminal, scenario, terminal

ROOT: Final = Path(__file__).parents[1]
CAMPAIGN: Final = ROOT / "campaigns" / "demo" / "campaign.yaml"
CAST: Final = ROOT / "docs" / "pictures" / "first-hour.cast"
COLUMNS, ROWS = 120, 34
LONGEST_PAUSE: Final = 1.5
"""Seconds without output that are kept at most."""
LARGEST: Final = 300_000
"""Bytes of a cast in the documentation."""
_PATIENCE: Final = 300.0


class CastRecorder:
    """Drives a program in a terminal and keeps what it sends, by time."""

    def __init__(self, shown: Terminal) -> None:
        self._shown = shown
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._kept = 0
        self._now = 0.0
        self._last = time.monotonic()
        self.events: list[tuple[float, str, str]] = []

    def take(self, seconds: float) -> None:
        """Let the program go on for a while."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._shown.read(min(left, 0.05))
            self._keep()

    def until(self, seen: str | Callable[[], bool]) -> None:
        """Let the program go on until a text is on the screen, or something is true."""
        true = seen if callable(seen) else lambda: seen in self._shown.text
        end = time.monotonic() + _PATIENCE
        while not true():
            assert time.monotonic() < end, f"not in time: {seen!r}\n{self._shown.text}"
            self.take(0.05)

    def press(self, keys: str, pause: float = 1.0) -> None:
        """Press keys and leave a moment to see what they do."""
        self._shown.type(keys)
        self.take(pause)

    def mark(self, words: str) -> None:
        """Name the place reached; players show it on their timeline."""
        self.events.append((round(self._now, 3), "m", words))

    def _keep(self) -> None:
        sent, now = self._shown.raw[self._kept :], time.monotonic()
        if sent:
            self._kept += len(sent)
            self._now += min(now - self._last, LONGEST_PAUSE)
            self._last = now
            self.events.append((round(self._now, 3), "o", self._decoder.decode(bytes(sent))))

    def write(self, path: Path, title: str) -> None:
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


def record_session(path: Path = CAST) -> None:
    """Record campaigns, runs, one that is under way, one that is over, and the way out."""
    with tempfile.TemporaryDirectory(prefix="session-") as folder:
        settings = {"executor": "daemon.run:execute"}
        with daemon_at(Path(folder) / "state", 2, **settings) as daemon, daemon.client() as client:
            submission = expand(load_campaign(CAMPAIGN))
            client.submit(submission)
            command = scenario("tui", "--connect", daemon.endpoint)
            with terminal(command, columns=COLUMNS, rows=ROWS) as shown:
                cast = CastRecorder(shown)
                _walk(cast, shown, submission.campaign)
                shown.wait()
                cast.write(path, "A first look at the dashboard of scenario")
    size = path.stat().st_size
    assert size < LARGEST, f"{path} has {size} bytes, {LARGEST} are allowed"


def _walk(cast: CastRecorder, shown: Terminal, campaign: str) -> None:
    cast.until(campaign)
    cast.mark("campaigns")
    cast.take(2.0)
    cast.press("\r")
    cast.until("/0")
    cast.mark("runs")
    cast.take(2.0)
    cast.until("running")
    cast.press("\r", 0.5)
    cast.mark("a run")
    cast.take(4.0)
    # The first run is over before the last ones begin; then its signals are drawn.
    cast.until(lambda: "loc.error" in shown.text and "Reading" not in shown.text)
    cast.take(2.0)
    cast.mark("signals")
    cast.press(" ", 3.0)
    cast.press(" ")
    cast.press("?", 2.0)
    cast.mark("keys")
    cast.press("\x1b")
    cast.press("q", 0.5)
