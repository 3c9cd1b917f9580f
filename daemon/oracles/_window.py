"""The part of a run an oracle judges: the whole of it, or the leg of one waypoint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daemon.oracles._predicate import truth
from daemon.oracles._sampler import Sampler
from daemon.oracles._timeline import Timeline
from grammars.oracle import Leg, Oracle, leg_number
from grammars.values import Floats

Mask = npt.NDArray[np.bool_]

VACUOUS = "vacuous: the guard never held"


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """Samples (n,) that are ``inside``, and what is still unknown of them.

    ``start`` and ``end`` [s] span what is recorded; ``closed``: nothing can be added to it,
    otherwise up to ``remaining`` seconds. ``absent`` says why it is empty, if it must be.
    """

    inside: Mask
    start: float
    end: float
    closed: bool
    remaining: float
    absent: str = ""

    @property
    def cut(self) -> str:
        """A note that more of it is to come, empty when all of it is known."""
        return "" if self.closed else f"the trace ends at {self.end:.2f} s, before the run"


@dataclass(frozen=True, slots=True, eq=False)
class Scope:
    """Samples to judge (n,); why there are none, if so; from when on there are."""

    allowed: Mask
    reason: str
    note: str


def window_of(oracle: Oracle, sampler: Sampler) -> Window:
    """Return the part of the run that ``oracle`` is about."""
    timeline = sampler.timeline
    if oracle.leg is None:
        everything = np.full(len(timeline.time), True)
        return Window(everything, timeline.start, timeline.end, timeline.closed, timeline.remaining)
    return _leg_window(oracle.leg, sampler, timeline)


def _leg_window(leg: Leg, sampler: Sampler, timeline: Timeline) -> Window:
    """Return the first unbroken time in which the leg's waypoint is approached.

    Coming back to it later does not count: otherwise a leg would never be known to be over.
    """
    number = leg_number(leg, sampler.trace.spec.mission)
    there = sampler.current == number - 1
    first = int(there.argmax()) if there.any() else len(there)
    gone = np.flatnonzero(~there[first:])
    last = first + int(gone[0]) if len(gone) else len(there)
    inside = np.zeros(len(there), dtype=np.bool_)
    inside[first:last] = True
    if last < len(there):
        return Window(inside, float(timeline.time[first]), float(timeline.time[last]), True, 0.0)
    start = float(timeline.time[first]) if first < len(there) else timeline.end
    absent = "" if there.any() else f"vacuous: {leg} was never begun"
    return Window(inside, start, timeline.end, timeline.closed, timeline.remaining, absent)


def scope_of(oracle: Oracle, sampler: Sampler, window: Window, values: Floats) -> Scope:
    """Return where in ``window`` the guard holds and ``values`` (n,) are known."""
    time = sampler.timeline.time
    known = window.inside & ~np.isnan(values)
    if not len(time):
        return Scope(known, "nothing was recorded", "")
    if window.absent:
        return Scope(known, window.absent, "")
    first = int(known.argmax())
    late = known.any() and first > int(window.inside.argmax())
    note = f"known from {time[first]:.2f} s on" if late else ""
    reason = "what it speaks of was not recorded"
    if oracle.guard is None:
        return Scope(known, reason, note)
    guard = truth(oracle.guard, sampler).margin
    held = window.inside & ~np.isnan(guard) & (guard >= 0.0)
    return Scope(known & held, reason if held.any() else VACUOUS, note)
