"""``reached(mission, tolerance)``: all waypoints, in strict order, by the true position.

A run is as good as its best reading: of all ways to name a moment for every waypoint, in order, the
one whose worst distance is smallest. That distance against the tolerance is the margin, so a
waypoint passed at 0.26 m instead of 0.25 m misses by 0.01 m, whatever comes after it.
Waypoints that also give a heading are judged on position only: the paper's requirement is to
reach them (section 4.1.1).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.oracles._finding import Finding, sentence, unknown
from daemon.oracles._predicate import truth
from daemon.oracles._sampler import Sampler
from daemon.oracles._window import VACUOUS
from daemon.verdict import Evidence
from grammars.mission import Waypoint
from grammars.oracle import Oracle, Reached
from grammars.values import Floats

Mask: TypeAlias = npt.NDArray[np.bool_]


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
    closest = _closest(sampler, usable, waypoints)
    if math.isinf(closest):
        return unknown(VACUOUS)
    evidence = _decisive(sampler, usable, waypoints, closest, tolerance)
    margin = tolerance - closest
    return Finding(margin, margin if timeline.closed else math.inf, evidence)


def _distance(sampler: Sampler, usable: Mask, waypoint: Waypoint) -> Floats:
    """Return the distance [m] at every sample, infinite where a guard forbids to count it."""
    distance = np.hypot(sampler.x - waypoint.x, sampler.y - waypoint.y)
    distance[~usable] = math.inf
    return distance


def _closest(sampler: Sampler, usable: Mask, waypoints: tuple[Waypoint, ...]) -> float:
    """Return the smallest worst distance [m] over all ways to visit the waypoints in order."""
    best = np.zeros(len(sampler.timeline.time))
    for waypoint in waypoints:
        worst = np.maximum(best, _distance(sampler, usable, waypoint))
        best = np.minimum.accumulate(worst)
    return float(best[-1])


def _decisive(
    sampler: Sampler,
    usable: Mask,
    waypoints: tuple[Waypoint, ...],
    closest: float,
    tolerance: float,
) -> Evidence:
    """Return where the worst distance of the best reading comes about."""
    time, start = sampler.timeline.time, 0
    worst, decisive, when = -math.inf, 0, 0
    for index, waypoint in enumerate(waypoints):
        distance = _distance(sampler, usable, waypoint)[start:]
        visit = _visit(distance, max(closest, tolerance))
        best = visit.start + int(distance[visit].argmin())
        if distance[best] > worst:
            worst, decisive, when = float(distance[best]), index, start + best
        start += visit.start
    count = len(waypoints)
    if closest <= tolerance:
        note = f"all {count} waypoints visited, the last at {time[start]:.2f} s"
    else:
        note = f"in order, waypoint {decisive + 1} of {count} is not visited nearer"
    if not sampler.timeline.closed:
        cut = f"the trace ends at {sampler.timeline.end:.2f} s, before the run"
        note = sentence(note, "" if closest <= tolerance else cut)
    return Evidence(float(time[when]), closest, tolerance, waypoints[decisive].id, note)


def _visit(distance: Floats, within: float) -> slice:
    """Return the first unbroken stay within a distance that is known to be reached."""
    near = distance <= within
    first = int(near.argmax())
    away = ~near[first:]
    last = first + int(away.argmax()) if away.any() else len(near)
    return slice(first, last)
