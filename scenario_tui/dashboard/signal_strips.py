"""Recorded runs along time: signals, doors, mission; where a replay stands; two runs on one clock.

Without what reads traces, which takes a while to load.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from grammars.model.geometry import Floats

Alignment = Literal["time", "mission"]
TimeSpan = tuple[float, float]
SPEEDS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""What one goes through when faster or slower is asked for: simulated seconds a second."""
FLASH: Final = 0.5
"""Seconds a contact stays to be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class SignalStrip:
    """A signal over time: ``time``, ``values`` (n,), NaN where it is not known.

    ``limits`` [SI] are what oracles compare it with; ``against`` are stretches [s] in which the
    run spoke against an oracle that reads it; ``readers`` name these oracles. ``unit`` is ``bool``
    for what is true or false.
    """

    name: str
    unit: str
    time: Floats
    values: Floats
    limits: tuple[float, ...] = ()
    against: tuple[TimeSpan, ...] = ()
    readers: tuple[str, ...] = ()

    def at(self, time: float) -> float:
        """Return the value at ``time`` [s]: of the last sample until then, NaN before the first."""
        index = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return float(self.values[index]) if index >= 0 else float("nan")


@dataclass(frozen=True, slots=True)
class DoorEvent:
    """A joint that leaves (``opens``) or comes back to (not ``opens``) how it is drawn, shut."""

    time: float
    name: str
    opens: bool


@dataclass(frozen=True, slots=True, eq=False)
class RunTimeline:
    """Everything of a run along time.

    ``reached`` holds the moments waypoints were done [s] of ``waypoints`` in all; ``decided`` those
    an oracle was decided against.
    """

    start: float
    end: float
    strips: tuple[SignalStrip, ...]
    doors: tuple[DoorEvent, ...]
    reached: tuple[float, ...]
    waypoints: int
    decided: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class CommonClock:
    """How the time of a second run goes with that of the first.

    ``first`` and ``second`` (n,) [s] are moments that belong together, ascending; beyond them both
    go equally fast.
    """

    first: tuple[float, ...]
    second: tuple[float, ...]

    def to_second(self, time: float) -> float:
        """Return the moment of the second run that goes with one of the first [s]."""
        return float(_map_times(np.array([time]), self.first, self.second)[0])

    def to_first(self, times: Floats) -> Floats:
        """Return the moments of the first run that go with those of the second, (n,) [s]."""
        return _map_times(times, self.second, self.first)


def common_clock(first: RunTimeline, second: RunTimeline, by: Alignment) -> CommonClock:
    """Return the common clock: by simulated time, or by the waypoints both have done."""
    ours, theirs = [first.start], [second.start]
    if by == "mission":
        # Only moments later than the last in both runs: two waypoints done at one instant would
        # make the clock jump.
        for a, b in zip(first.reached, second.reached, strict=False):
            if a > ours[-1] and b > theirs[-1]:
                ours.append(a)
                theirs.append(b)
    return CommonClock(tuple(ours), tuple(theirs))


def _map_times(times: Floats, here: tuple[float, ...], there: tuple[float, ...]) -> Floats:
    inside = np.interp(times, here, there)
    before = there[0] + (times - here[0])
    after = there[-1] + (times - here[-1])
    mapped: Floats = np.where(times < here[0], before, np.where(times > here[-1], after, inside))
    return mapped


def shift_to_clock(timeline: RunTimeline, clock: CommonClock) -> RunTimeline:
    """Return the second timeline as it lies on the time of the first."""

    def moved(time: float) -> float:
        return float(clock.to_first(np.array([time]))[0])

    return RunTimeline(
        moved(timeline.start),
        moved(timeline.end),
        tuple(
            replace(
                strip,
                time=clock.to_first(strip.time),
                against=tuple((moved(a), moved(b)) for a, b in strip.against),
            )
            for strip in timeline.strips
        ),
        tuple(replace(event, time=moved(event.time)) for event in timeline.doors),
        tuple(moved(time) for time in timeline.reached),
        timeline.waypoints,
        tuple(moved(time) for time in timeline.decided),
    )


@dataclass(frozen=True, slots=True)
class FailureMoment:
    """When an oracle was decided against [s], and which one."""

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
