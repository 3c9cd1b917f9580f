"""Recorded runs along time: signals, doors, mission; where a replay stands; two runs on one clock.

Without what reads traces, which takes a while to load.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from grammars.model.geometry import Floats

if TYPE_CHECKING:
    from daemon.model.live_judgement import DoorMotion
    from daemon.model.spec import OracleText
    from grammars.oracle import ComparedLimit

Alignment = Literal["time", "mission"]
TimeSpan = tuple[float, float]
SPEEDS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""What one goes through when faster or slower is asked for: simulated seconds a second."""
FLASH: Final = 0.5
"""Seconds a contact stays to be seen."""
_CLEARANCE: Final = re.compile(r"clearance(\(\d[^)]*\))?$")
"""The clearance of the robot as a whole, not that of a thing named."""
_RAMPS: Final = frozenset(
    {
        "elapsed", "path.length", "mission.leg", "mission.leg.elapsed", "mission.reached",
        "mission.remaining",
    }
)  # fmt: skip
"""Signals that count, or say what the lane of the mission shows."""


@dataclass(frozen=True, slots=True, eq=False)
class SignalStrip:
    """A signal over time: ``time``, ``values`` (n,), NaN where it is not known.

    ``limits`` [SI] are what oracles compare it with; ``against`` are stretches [s] in which the
    run spoke against an oracle that reads it; ``readers`` name these oracles. ``unit`` is ``bool``
    for what is true or false. ``sides`` say for each limit on which side of it the run speaks
    against an oracle: 1 above, -1 below, 0 neither. A thinned signal has the least of each part of
    the time in ``values`` and the greatest in ``most``, the last part ending at ``until`` [s].
    """

    name: str
    unit: str
    time: Floats
    values: Floats
    limits: tuple[float, ...] = ()
    against: tuple[TimeSpan, ...] = ()
    readers: tuple[str, ...] = ()
    sides: tuple[int, ...] = ()
    most: Floats | None = None
    until: float | None = None

    @property
    def end(self) -> float:
        """The moment until which it is known [s]."""
        last = float(self.time[-1]) if len(self.time) else -math.inf
        return last if self.until is None else self.until

    @property
    def ramp(self) -> bool:
        """Whether it only counts: a clock or an odometer, whose curve tells nothing."""
        return self.name in _RAMPS

    def between(self, time: float) -> tuple[float, float]:
        """Return the least and the greatest value of the part that holds ``time`` [s]."""
        index = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        if index < 0:
            return math.nan, math.nan
        values = self.values if self.most is None else self.most
        return float(self.values[index]), float(values[index])


@dataclass(frozen=True, slots=True, eq=False)
class RunTimeline:
    """Everything of a run along time.

    ``reached`` holds the moments waypoints were done [s] of ``waypoints`` in all, called ``names``;
    ``doors`` is ``None`` when nothing is known of them;
    ``decided`` those an oracle was decided against. The axis of a run that goes on ends at
    ``horizon`` [s], later than the run.
    """

    start: float
    end: float
    strips: tuple[SignalStrip, ...]
    doors: tuple[DoorMotion, ...] | None
    reached: tuple[float, ...]
    waypoints: int
    decided: tuple[float, ...]
    names: tuple[str, ...] = ()
    horizon: float | None = None


def limits_of(oracles: Iterable[OracleText]) -> tuple[ComparedLimit, ...]:
    """Return what oracles compare signals with; nothing of those that cannot be read here."""
    # Reading oracles takes longer to load than the first screen.
    from grammars.oracle import compared_limits, parse_oracle
    from grammars.text.diagnostics import InputError, Where

    found: list[ComparedLimit] = []
    for written in oracles:
        try:
            oracle = parse_oracle(written.name, written.text, Where(written.name))
        except InputError:
            continue
        found += compared_limits(oracle)
    return tuple(found)


def with_limits(timeline: RunTimeline, limits: Iterable[ComparedLimit]) -> RunTimeline:
    """Return a timeline whose signals know on which side of their limits is what must not be."""
    sides: dict[tuple[str, float], set[int]] = {}
    for limit in limits:
        against = {"above": 1, "below": -1, "": 0}[limit.against]
        sides.setdefault((limit.signal, limit.value), set()).add(against)

    def side(name: str, limit: float) -> int:
        found = sides.get((name, limit), set()) - {0}
        # Two oracles that want opposite things: neither side is free.
        return found.pop() if len(found) == 1 else 0

    strips = (
        replace(strip, sides=tuple(side(strip.name, limit) for limit in strip.limits))
        for strip in timeline.strips
    )
    return replace(timeline, strips=tuple(strips))


def clearance_along(
    strips: Iterable[SignalStrip], times: Sequence[float] | Floats
) -> tuple[tuple[float, ...], float | None]:
    """Return the clearance at moments ``times`` [s], NaN where unknown, and its limit [m].

    It is the one an oracle reads, with the buffer around the robot, or else the plain one.
    """
    found = [strip for strip in strips if _CLEARANCE.match(strip.name)]
    if not found:
        return (), None
    strip = max(found, key=lambda one: (bool(one.readers), bool(one.limits)))
    at = np.searchsorted(strip.time, np.asarray(times) + 1e-9, side="right") - 1
    # Behind the end of a thinned signal nothing is known yet.
    known = (at >= 0) & (np.asarray(times) <= (strip.end + 1e-9))
    values = np.where(known, strip.values[at], np.nan) if len(strip.time) else known * np.nan
    asked = [limit for limit, side in zip(strip.limits, strip.sides, strict=False) if side < 0]
    return tuple(values.tolist()), max(asked, default=None)


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

    return replace(
        timeline,
        start=moved(timeline.start),
        end=moved(timeline.end),
        strips=tuple(
            replace(
                strip,
                time=clock.to_first(strip.time),
                against=tuple((moved(a), moved(b)) for a, b in strip.against),
            )
            for strip in timeline.strips
        ),
        doors=timeline.doors
        and tuple(replace(event, time=moved(event.time)) for event in timeline.doors),
        reached=tuple(moved(time) for time in timeline.reached),
        decided=tuple(moved(time) for time in timeline.decided),
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
