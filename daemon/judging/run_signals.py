"""Signals of a run along time: the usual ones and all its oracles read, where it spoke against one.

What is drawn of a run, while it goes on and afterwards; also its doors and its mission.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.judging.oracles import OracleTimeline, SignalSampler, oracle_timeline
from daemon.model.live_judgement import DoorMotion, LiveSignal
from daemon.model.ranges import LARGEST_VALUE
from daemon.trace import JointTrack, Trace
from grammars.model.geometry import Floats
from grammars.oracle import Signal, kind_of, render

TimeSpan = tuple[float, float]

DOOR_CLEARANCE: Final = "clearance(doors)"
"""Name of the signal that is the least clearance of any object that moves."""
_USUAL: Final = ("loc.error", "clearance", DOOR_CLEARANCE, "speed")
_AJAR: Final = 0.05
"""A door this far from how it is drawn, shut, counts as open [rad or m]."""
_MOST_LIMITS: Final = 1000
"""Limits of a thinned signal: of more no line is told from the next."""
_DIGITS: Final = 4
"""Significant digits of thinned values: more are not seen, and travel for nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class RunSignal:
    """A signal over a run: ``time``, ``values`` (n,) in SI units, NaN where it is not known.

    ``unit`` is ``bool`` for what is true or false; ``limits``, ``against`` and ``readers`` are
    those of :class:`~daemon.model.live_judgement.LiveSignal`.
    """

    name: str
    unit: str
    time: Floats
    values: Floats
    limits: tuple[float, ...] = ()
    against: tuple[TimeSpan, ...] = ()
    readers: tuple[str, ...] = ()


def sample_run_signals(sampler: SignalSampler) -> tuple[RunSignal, ...]:
    """Sample the usual signals and all that the run's oracles read, each once.

    Of the usual ones only those of which anything is known.
    """
    oracles = [oracle_timeline(one, sampler) for one in sampler.trace.spec.oracles]
    asked = {render(signal): signal for oracle in oracles for signal in oracle.signals}
    usual = {name: Signal(name) for name in _USUAL if name != DOOR_CLEARANCE}
    found = {
        name: _read_signal(name, signal, sampler, oracles)
        for name, signal in (usual | asked).items()
    }
    # No signal of the language: the least clearance of every object, each of which is one.
    found[DOOR_CLEARANCE] = _nearest_door(sampler)
    order = [*_USUAL, *(name for name in asked if name not in _USUAL)]
    known = (found[name] for name in order)
    return tuple(s for s in known if s.name in asked or np.isfinite(s.values).any())


def _read_signal(
    name: str, signal: Signal, sampler: SignalSampler, oracles: Iterable[OracleTimeline]
) -> RunSignal:
    kind = kind_of(signal)
    readers = [o for o in oracles if name in {render(read) for read in o.signals}]
    limits = {limit for o in readers for read, limit in o.limits if read == name}
    against = [span for o in readers for span in o.against]
    values = sampler.sample(signal).values
    unit = "bool" if kind is None else kind.unit
    return RunSignal(
        name, unit, sampler.time_base.time, values, tuple(sorted(limits)), merge_spans(against),
        tuple(reader.oracle for reader in readers),
    )  # fmt: skip


def _nearest_door(sampler: SignalSampler) -> RunSignal:
    return RunSignal(DOOR_CLEARANCE, "m", sampler.time_base.time, sampler.object_clearance().values)


def merge_spans(stretches: Iterable[TimeSpan], gap: float = 0.0) -> tuple[TimeSpan, ...]:
    """Return stretches of time as few, ascending and disjoint ones, more than ``gap`` [s] apart."""
    found: list[TimeSpan] = []
    for start, end in sorted(stretches):
        if found and start <= found[-1][1] + gap:
            found[-1] = (found[-1][0], max(end, found[-1][1]))
        else:
            found.append((start, end))
    return tuple(found)


def thin_signal(signal: RunSignal, start: float, end: float, columns: int) -> LiveSignal:
    """Return the least and the greatest value in each of ``columns`` equal parts of the time.

    A part without a sample has what the last one before it had, as between two samples everything
    is held; values keep four significant digits. Stretches that are less than a part apart become
    one, so that there are not more of them than parts.
    """
    span = max(end - start, 1e-9)
    column = np.floor((signal.time - start) / span * columns).astype(np.int64)
    column = np.clip(column, 0, columns - 1)
    finite = np.isfinite(signal.values)
    low, high = np.full(columns, np.inf), np.full(columns, -np.inf)
    np.minimum.at(low, column[finite], signal.values[finite])
    np.maximum.at(high, column[finite], signal.values[finite])
    last = np.searchsorted(column, np.arange(columns), side="right") - 1
    empty = np.bincount(column, minlength=columns) == 0
    held = empty & (last >= 0) & finite[np.maximum(last, 0)]
    low[held] = high[held] = signal.values[last[held]]
    return LiveSignal(
        signal.name, signal.unit, start, end, _rounded(low), _rounded(high),
        signal.limits[:_MOST_LIMITS], merge_spans(signal.against, span / columns), signal.readers,
    )  # fmt: skip


def _rounded(values: Floats) -> tuple[float | None, ...]:
    return tuple(
        float(f"{min(max(value, -LARGEST_VALUE), LARGEST_VALUE):.{_DIGITS}g}")
        if np.isfinite(value)
        else None
        for value in values.tolist()
    )


def door_motions(joints: JointTrack) -> tuple[DoorMotion, ...]:
    """Return when every joint left or came back to how it is drawn, by time."""
    found = []
    for column, name in enumerate(joints.names):
        open_ = np.abs(joints.position[:, column]) > _AJAR
        turns = (np.flatnonzero(np.diff(open_)) + 1).tolist()
        found += [DoorMotion(float(joints.time[i]), name, bool(open_[i])) for i in turns]
    return tuple(sorted(found, key=lambda motion: (motion.time, motion.joint)))


def reached_moments(trace: Trace) -> tuple[float, ...]:
    """Return the moments [s] at which waypoints were reported as done, in order."""
    moments: list[float] = []
    for record in trace.progress:
        moments += [record.time] * (record.reached - len(moments))
    return tuple(moments)
