"""The moment of a run that is shown, played or followed, and the moments that decided it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

SPEEDS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""Speeds that "faster" and "slower" go through: simulated seconds a second."""
FLASH: Final = 0.5
"""Seconds a contact stays to be seen."""


@dataclass(frozen=True, slots=True)
class FailureMoment:
    """The moment [s] at which an oracle was decided against."""

    time: float
    oracle: str


def next_speed(speed: float, step: int) -> float:
    """Return the next higher speed, or with a negative ``step`` the next lower one."""
    further = [one for one in SPEEDS if (one - speed) * step > 0.0]
    return further[0 if step > 0 else -1] if further else speed


@dataclass(slots=True)
class ReplayTransport:
    """The moment shown, ``time`` [s], between ``start`` and ``end``.

    A run that goes on is ``live``: it is shown at its end while the transport ``follows``. It stays
    at a moment that somebody goes back to, and follows again at the end.
    """

    start: float
    end: float
    time: float
    speed: float = 1.0
    playing: bool = True
    live: bool = False
    follows: bool = False

    def advance(self, seconds: float) -> float:
        """Go on by ``seconds`` of the clock on the wall, stop at the end; return how far [s]."""
        if not self.playing:
            return 0.0
        before = self.time
        self.go(self.time + seconds * self.speed)
        if self.time >= self.end:
            self.playing = False
        return self.time - before

    def go(self, time: float) -> None:
        """Go to a moment, or the nearest there is."""
        self.time = min(max(time, self.start), self.end)
        self.follows = self.live and self.time >= self.end

    def grow(self, start: float, end: float) -> None:
        """Take in that a live run is known from ``start`` to ``end`` [s]."""
        # A run that begins anew, with another attempt, is another one.
        self.follows = self.follows or end < self.end
        self.start, self.end = start, end
        if self.follows:
            self.time = end

    def toggle(self) -> None:
        """Pause or go on, from the start at the end; stay at this moment of a run followed."""
        if self.follows:
            self.follows = False
            return
        if not (self.playing or self.live) and self.time >= self.end:
            self.time = self.start
        self.playing = not self.playing
