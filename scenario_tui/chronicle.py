"""A recorded run along time: signals, doors, mission; what is drawn, without what reads traces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from grammars.values import Floats

Alignment = Literal["time", "mission"]
Stretch = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
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
    against: tuple[Stretch, ...] = ()
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
class Chronicle:
    """Everything of a run along time.

    ``reached`` holds the moments waypoints were done [s] of ``waypoints`` in all; ``decided`` those
    an oracle was decided against.
    """

    start: float
    end: float
    strips: tuple[Strip, ...]
    doors: tuple[DoorEvent, ...]
    reached: tuple[float, ...]
    waypoints: int
    decided: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Clock:
    """How the time of a second run goes with that of the first.

    ``first`` and ``second`` (n,) [s] are moments that belong together, ascending; beyond them both
    go equally fast.
    """

    first: tuple[float, ...]
    second: tuple[float, ...]

    def to_second(self, time: float) -> float:
        """Return the moment of the second run that goes with one of the first [s]."""
        return float(_mapped(np.array([time]), self.first, self.second)[0])

    def to_first(self, times: Floats) -> Floats:
        """Return the moments of the first run that go with those of the second, (n,) [s]."""
        return _mapped(times, self.second, self.first)


def clock_of(first: Chronicle, second: Chronicle, by: Alignment) -> Clock:
    """Return the common clock: by simulated time, or by the waypoints both have done."""
    ours, theirs = [first.start], [second.start]
    if by == "mission":
        for a, b in zip(first.reached, second.reached, strict=False):
            if a > ours[-1] and b > theirs[-1]:
                ours.append(a)
                theirs.append(b)
    return Clock(tuple(ours), tuple(theirs))


def _mapped(times: Floats, here: tuple[float, ...], there: tuple[float, ...]) -> Floats:
    inside = np.interp(times, here, there)
    before = there[0] + (times - here[0])
    after = there[-1] + (times - here[-1])
    mapped: Floats = np.where(times < here[0], before, np.where(times > here[-1], after, inside))
    return mapped


def on_clock(chronicle: Chronicle, clock: Clock) -> Chronicle:
    """Return the second chronicle as it lies on the time of the first."""

    def moved(time: float) -> float:
        return float(clock.to_first(np.array([time]))[0])

    return Chronicle(
        moved(chronicle.start),
        moved(chronicle.end),
        tuple(
            replace(
                strip,
                time=clock.to_first(strip.time),
                against=tuple((moved(a), moved(b)) for a, b in strip.against),
            )
            for strip in chronicle.strips
        ),
        tuple(replace(event, time=moved(event.time)) for event in chronicle.doors),
        tuple(moved(time) for time in chronicle.reached),
        chronicle.waypoints,
        tuple(moved(time) for time in chronicle.decided),
    )
