"""What makes a recording doubtful, whatever the robot did in it."""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.trace.model import JointTrack, Motion
from grammars.values import Floats

MAX_GAP: Final = 0.5
"""Longest time [s] between two ground truth samples in a trace that can be trusted."""


def problems(
    truth: Motion, odometry: Motion, joints: JointTrack, valid_until: float
) -> tuple[str, ...]:
    """Return everything that is wrong with the recording, in words; empty when it is sound."""
    found: list[str] = []
    for name, time in (
        ("ground truth", truth.time),
        ("odometry", odometry.time),
        ("joint states", joints.time),
    ):
        found += _backwards(name, time)
    for name, motion in (("ground truth", truth), ("odometry", odometry)):
        values = np.stack((motion.x, motion.y, motion.yaw, motion.vx, motion.vy, motion.wz), 1)
        found += _not_finite(name, motion.time, values)
    found += _not_finite("joint states", joints.time, joints.position)
    found += _gaps(truth.time, valid_until)
    return tuple(found)


def _backwards(name: str, time: Floats) -> list[str]:
    jumps = np.flatnonzero(np.diff(time) < 0)
    if not len(jumps):
        return []
    first = jumps[0]
    return [f"the clock of the {name} jumps back from {time[first]:g} s to {time[first + 1]:g} s"]


def _not_finite(name: str, time: Floats, values: Floats) -> list[str]:
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    return [f"the {name} at {time[bad[0]]:g} s is not a number"] if len(bad) else []


def _gaps(time: Floats, valid_until: float) -> list[str]:
    if not len(time):
        return ["there is no ground truth"]
    edges = np.concatenate(([0.0], time, [valid_until]))
    steps = np.diff(edges)
    worst = int(np.argmax(steps))
    if steps[worst] <= MAX_GAP:
        return []
    return [f"no ground truth from {edges[worst]:g} s to {edges[worst + 1]:g} s"]
