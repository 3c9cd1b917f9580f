"""What happened when in a recorded run: its signals, its doors, its mission; no drawing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from daemon.oracles import Course, Sampler, course_of, problems_of
from daemon.trace import JointTrack, Trace
from daemon.verdict import Outcome, Verdict
from grammars.oracle import Signal, kind_of, render
from scenario_tui.chronicle import Chronicle, DoorEvent, Stretch, Strip

DOORS: Final = "clearance(doors)"
"""Name of the signal that is the least clearance of any object that moves."""
_USUAL: Final = ("loc.error", "clearance", DOORS, "speed")
_AJAR: Final = 0.05
"""A door this far from how it is drawn, shut, counts as open [rad or m]."""


def chronicle_of(trace: Trace, verdicts: Sequence[Verdict]) -> Chronicle:
    """Sample the usual signals and all that the run's oracles read.

    A trace that cannot be trusted has no signals, only doors and mission.
    """
    way = trace.ground_truth.time
    start, end = (float(way[0]), float(way[-1])) if len(way) else (0.0, 0.0)
    against = {v.evidence.time for v in verdicts if v.outcome is Outcome.FAIL}
    return Chronicle(
        start,
        end,
        () if problems_of(trace) else _strips(Sampler(trace)),
        door_events(trace.joints),
        _reached(trace),
        len(trace.spec.mission.waypoints),
        tuple(sorted(time for time in against if time is not None)),
    )


def _strips(sampler: Sampler) -> tuple[Strip, ...]:
    courses = [course_of(oracle, sampler) for oracle in sampler.trace.spec.oracles]
    asked = {render(signal): signal for course in courses for signal in course.signals}
    usual = {name: Signal(name) for name in _USUAL if name != DOORS}
    found = {name: _strip(name, signal, sampler, courses) for name, signal in
             (usual | asked).items()}  # fmt: skip
    found[DOORS] = _nearest_door(sampler)
    order = [*_USUAL, *(name for name in asked if name not in _USUAL)]
    known = (found[name] for name in order)
    return tuple(s for s in known if s.name in asked or np.isfinite(s.values).any())


def _strip(name: str, signal: Signal, sampler: Sampler, courses: Iterable[Course]) -> Strip:
    kind = kind_of(signal)
    readers = [c for c in courses if name in {render(read) for read in c.signals}]
    limits = {limit for c in readers for read, limit in c.limits if read == name}
    against = [stretch for c in readers for stretch in c.against]
    values = sampler.sample(signal).values
    unit = "bool" if kind is None else kind.unit
    return Strip(
        name, unit, sampler.timeline.time, values, tuple(sorted(limits)), joined(against),
        tuple(course.oracle for course in readers),
    )  # fmt: skip


def _nearest_door(sampler: Sampler) -> Strip:
    time = sampler.timeline.time
    least = np.full(len(time), np.nan)
    for item in sampler.trace.scene.objects:
        one = sampler.sample(Signal("clearance", (Signal(item.name),))).values
        least = np.fmin(least, np.where(np.isfinite(one), one, np.nan))
    return Strip(DOORS, "m", time, least)


def joined(stretches: Iterable[Stretch]) -> tuple[Stretch, ...]:
    """Return stretches of time as few, ascending and disjoint ones."""
    found: list[Stretch] = []
    for start, end in sorted(stretches):
        if found and start <= found[-1][1]:
            found[-1] = (found[-1][0], max(end, found[-1][1]))
        else:
            found.append((start, end))
    return tuple(found)


def door_events(joints: JointTrack) -> tuple[DoorEvent, ...]:
    """Return when every joint left or came back to how it is drawn, by time."""
    found = []
    for column, name in enumerate(joints.names):
        open_ = np.abs(joints.position[:, column]) > _AJAR
        turns = (np.flatnonzero(np.diff(open_)) + 1).tolist()
        found += [DoorEvent(float(joints.time[i]), name, bool(open_[i])) for i in turns]
    return tuple(sorted(found, key=lambda event: (event.time, event.name)))


def _reached(trace: Trace) -> tuple[float, ...]:
    moments: list[float] = []
    for record in trace.progress:
        moments += [record.time] * (record.reached - len(moments))
    return tuple(moments)
