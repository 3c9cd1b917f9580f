"""``reached(mission, tolerance)``: all waypoints, in strict order, by the true position.

A waypoint is visited at the first sample, not before the previous waypoint's visit, at which the
robot's base is within the tolerance; how well is the closest approach of that visit. Waypoints
that also give a heading are judged on position only: the paper's requirement is to reach them.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.oracles._finding import Finding, sentence, unknown
from daemon.oracles._predicate import truth
from daemon.oracles._sampler import Sampler
from daemon.oracles._window import VACUOUS
from daemon.verdict import Evidence
from grammars.mission import Waypoint
from grammars.oracle import Oracle, Reached
from grammars.values import Floats


def reached(oracle: Oracle, judgement: Reached, sampler: Sampler) -> Finding:
    """Judge the mission; with a guard, only positions where it holds count as visits."""
    timeline, tolerance = sampler.timeline, judgement.tolerance.value
    if not len(timeline.time):
        return unknown("nothing was recorded")
    usable = np.full(len(timeline.time), True)
    if oracle.guard is not None:
        usable = truth(oracle.guard, sampler).margin >= 0.0
        if not usable.any():
            return unknown(VACUOUS)
    waypoints = sampler.trace.spec.mission.waypoints
    start, worst, evidence = 0, -math.inf, Evidence()
    for number, waypoint in enumerate(waypoints, start=1):
        distance = np.hypot(sampler.x - waypoint.x, sampler.y - waypoint.y)
        distance[~usable] = math.inf
        visit = _visit(distance[start:], tolerance)
        if visit is None:
            return _missed(sampler, waypoint, number, start, distance, tolerance)
        best = start + visit.start + int(distance[start:][visit].argmin())
        start += visit.start
        if distance[best] > worst:
            worst = float(distance[best])
            at, value = float(timeline.time[best]), worst
            evidence = Evidence(at, value, tolerance, waypoint.id)
    note = f"all {len(waypoints)} waypoints visited, the last at {timeline.time[start]:.2f} s"
    evidence = Evidence(evidence.time, evidence.value, tolerance, evidence.object, note)
    margin = tolerance - worst
    return Finding(margin, margin if timeline.closed else math.inf, evidence)


def _visit(distance: Floats, tolerance: float) -> slice | None:
    """Return the first unbroken stay within ``tolerance``."""
    near = distance <= tolerance
    if not near.any():
        return None
    first = int(near.argmax())
    away = ~near[first:]
    last = first + int(away.argmax()) if away.any() else len(near)
    return slice(first, last)


def _missed(
    sampler: Sampler, waypoint: Waypoint, number: int, start: int, distance: Floats, limit: float
) -> Finding:
    timeline, total = sampler.timeline, len(sampler.trace.spec.mission.waypoints)
    best = start + int(distance[start:].argmin())
    note = sentence(
        f"waypoint {number} of {total} not visited, {number - 1} before it were",
        "" if timeline.closed else f"the trace ends at {timeline.end:.2f} s, before the run",
    )
    nearest = float(distance[best])
    evidence = Evidence(float(timeline.time[best]), nearest, limit, waypoint.id, note)
    if math.isinf(nearest):
        evidence = Evidence(None, None, limit, waypoint.id, note)
    if not timeline.closed:
        return Finding(-math.inf, math.inf, evidence)
    return Finding(limit - nearest, limit - nearest, evidence)
