"""The robot around doors that shut in its face, and around the same doors when they do not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from daemon.oracles import Sampler
from daemon.report._types import Passing, Watch
from grammars.behaviour import Trigger
from grammars.oracle import Signal, object_signals
from grammars.scene import Joint, SceneObject
from grammars.values import Floats

if TYPE_CHECKING:
    from daemon.trace import Trace

BEFORE: Final = 5.0
AFTER: Final = 15.0
"""Seconds around a trigger that are shown."""
_RATE: Final = 5.0


def passings(trace: Trace, sampler: Sampler, watches: Sequence[Watch]) -> tuple[Passing, ...]:
    """Return how the robot drove around each trigger, in the order of time.

    A trigger of the run itself counts from when the trace says that it fired, the first time. One
    of another scenario counts from when the robot came as near, if that can be told (measured from
    what stands still to the base).
    """
    own = {b.joint for b in trace.spec.behaviours if isinstance(b, Trigger)}
    found = [_passing(sampler, joint, time, fired=True) for joint, time in _fired(trace).items()]
    for watch in watches:
        if watch.name not in own:
            time = _came_near(trace, sampler, watch.trigger)
            if time is not None:
                found.append(_passing(sampler, watch.name, time, fired=False))
    return tuple(sorted(found, key=lambda p: (p.time, p.joint)))


def _fired(trace: Trace) -> dict[str, float]:
    """Return when each trigger fired first, as the simulator says in the log of the run."""
    triggers = {b.joint for b in trace.spec.behaviours if isinstance(b, Trigger)}
    found: dict[str, float] = {}
    for event in trace.events:
        if event.source in triggers and event.text.startswith("triggered"):
            found.setdefault(event.source, event.time)
    return found


def _came_near(trace: Trace, sampler: Sampler, trigger: Trigger) -> float | None:
    if trigger.to != "base" or trigger.of == "leaf":
        return None
    for item in trace.scene.objects:
        for joint in item.joints:
            if f"{item.name}.{joint.name}" == trigger.joint:
                away = _distance(trace, sampler, item, joint, trigger)
                near = np.flatnonzero(away < trigger.distance)
                return float(sampler.timeline.time[near[0]]) if len(near) else None
    return None


def _distance(
    trace: Trace, sampler: Sampler, item: SceneObject, joint: Joint, trigger: Trigger
) -> Floats:
    if trigger.of == "hinge" and joint.kind == "revolute":
        for name, reference in object_signals(trace.scene).items():
            here = reference.object is item and reference.joint is joint
            if here and name.endswith(".distance"):
                return sampler.sample(Signal(name)).values
    x_still, y_still = item.pose.x, item.pose.y
    if trigger.of == "doorway":
        for doorway in trace.scene.doorways:
            if doorway.name == item.doorway:
                xs, ys = zip(*doorway.footprint, strict=True)
                x_still, y_still = sum(xs) / len(xs), sum(ys) / len(ys)
    return np.hypot(sampler.x - x_still, sampler.y - y_still)


def _passing(sampler: Sampler, joint: str, time: float, *, fired: bool) -> Passing:
    """Return speed and turning speed around ``time``, thinned to five samples a second."""
    stamps, truth = sampler.timeline.time, sampler.trace.ground_truth
    first, last = np.searchsorted(stamps, (time - BEFORE, time + AFTER))
    rate = len(stamps) / max(float(stamps[-1] - stamps[0]), 1e-9) if len(stamps) > 1 else _RATE
    kept = slice(int(first), int(last), max(1, round(rate / _RATE)))
    speed = np.hypot(truth.vx[kept], truth.vy[kept])
    then = min(int(np.searchsorted(stamps, time)), len(stamps) - 1)
    return Passing(
        joint=joint,
        time=time,
        fired=fired,
        speed_then=float(np.hypot(truth.vx[then], truth.vy[then])),
        since=(stamps[kept] - time).astype(np.float32),
        speed=speed.astype(np.float32),
        turning=np.asarray(truth.wz[kept], dtype=np.float32),
    )
