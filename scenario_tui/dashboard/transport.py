"""The moment of a run that is shown, played or followed, and the moments that decided it."""

from __future__ import annotations

from collections.abc import Sequence
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


def next_moment(moments: Sequence[FailureMoment], time: float) -> FailureMoment | None:
    """Return the first of some moments, ordered by time, after ``time`` [s]."""
    return next((m for m in moments if m.time > time + 1e-6), None)


def previous_moment(moments: Sequence[FailureMoment], time: float) -> FailureMoment | None:
    """Return the last of some moments, ordered by time, before ``time`` [s]."""
    return next((m for m in reversed(moments) if m.time < time - 1e-6), None)


@dataclass(slots=True)
class ReplayTransport:
    """The moment shown, ``time`` [s], between ``start`` and ``end``."""

    start: float
    end: float
    time: float
    speed: float = 1.0
    playing: bool = True

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

    def toggle(self) -> None:
        """Pause, go on, or begin anew at the end."""
        if not self.playing and self.time >= self.end:
            self.time = self.start
        self.playing = not self.playing

    def faster(self) -> None:
        """Take the next higher speed."""
        self.speed = next((s for s in SPEEDS if s > self.speed), SPEEDS[-1])

    def slower(self) -> None:
        """Take the next lower speed."""
        self.speed = next((s for s in reversed(SPEEDS) if s < self.speed), SPEEDS[0])


@dataclass(slots=True)
class LiveTransport(ReplayTransport):
    """The moment shown of a run that goes on: its last one while it ``follows``.

    It stays at a moment that somebody goes back to, and follows again at the end.
    """

    playing: bool = False
    follows: bool = True

    def grow(self, start: float, end: float) -> None:
        """Take in that the run is known from ``start`` to ``end`` [s]."""
        # A run that begins anew, with another attempt, is another one.
        self.follows = self.follows or end < self.end
        self.start, self.end = start, end
        if self.follows:
            self.time = end

    def go(self, time: float) -> None:
        """Go to a moment, or the nearest there is."""
        # Not super(): a dataclass with slots is another class than the one written here.
        ReplayTransport.go(self, time)
        self.follows = self.time >= self.end

    def toggle(self) -> None:
        """Stay at this moment, or play on from where it stays."""
        if self.follows:
            self.follows = False
        else:
            self.playing = not self.playing


def follows(transport: ReplayTransport | None) -> bool:
    """Return whether the moment shown goes along with a run that goes on."""
    return isinstance(transport, LiveTransport) and transport.follows
