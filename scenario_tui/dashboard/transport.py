"""The displayed moment of a run, played or followed, and the moments of its failures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

SPEEDS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""Speeds of a replay: simulated seconds per second."""
FLASH: Final = 0.5
"""Seconds for which a contact stays visible."""


@dataclass(frozen=True, slots=True)
class FailureMoment:
    """The moment [s] at which an oracle failed."""

    time: float
    oracle: str


def next_speed(speed: float, step: int) -> float:
    """Return the next higher speed, or for a negative ``step`` the next lower one."""
    further = [one for one in SPEEDS if (one - speed) * step > 0.0]
    return further[0 if step > 0 else -1] if further else speed


@dataclass(slots=True)
class ReplayTransport:
    """The displayed moment, ``time`` [s], between ``start`` and ``end``.

    While the transport ``follows`` a ``live`` run, the moment is its end. After a step back it
    stays, until the user goes to the end again.
    """

    start: float
    end: float
    time: float
    speed: float = 1.0
    playing: bool = True
    live: bool = False
    follows: bool = False

    def advance(self, seconds: float) -> float:
        """Go on by ``seconds`` of wall clock, up to the end; return the simulated time passed."""
        if not self.playing:
            return 0.0
        before = self.time
        self.go(self.time + seconds * self.speed)
        if self.time >= self.end:
            self.playing = False
        return self.time - before

    def go(self, time: float) -> None:
        """Go to a moment, or to the nearer end."""
        self.time = min(max(time, self.start), self.end)
        self.follows = self.live and self.time >= self.end

    def grow(self, start: float, end: float) -> None:
        """Take in the new ``start`` and ``end`` [s] of a live run."""
        # An earlier end means another attempt.
        self.follows = self.follows or end < self.end
        self.start, self.end = start, end
        if self.follows:
            self.time = end

    def toggle(self) -> None:
        """Pause or play, at the end from the start; stop following a live run."""
        if self.follows:
            self.follows = False
            return
        if not (self.playing or self.live) and self.time >= self.end:
            self.time = self.start
        self.playing = not self.playing
