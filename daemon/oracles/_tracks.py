"""Signals that are recorded as they are: the true motion, commands, the estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from daemon.oracles._timeline import hold
from grammars.values import Floats

if TYPE_CHECKING:
    from daemon.trace import Trace

_TRUTH = {
    "pose.x": "x",
    "pose.y": "y",
    "pose.yaw": "yaw",
    "speed.forward": "vx",
    "speed.sideways": "vy",
}
_COMMAND = {"command.forward": "vx", "command.sideways": "vy", "command.angular": "wz"}
_ESTIMATE = {"estimate.x": "x", "estimate.y": "y", "estimate.yaw": "yaw"}
RECORDED = frozenset({*_TRUTH, *_COMMAND, *_ESTIMATE, "estimate.particles"})
"""Names of the signals that :func:`recorded` knows."""


def recorded(trace: Trace, name: str, time: Floats) -> Floats:
    """Return a recorded signal at ``time`` (n,), the first samples of the ground truth.

    Commands and estimates are held until the next one; NaN before the first.
    """
    if name in _TRUTH:
        channel: Floats = getattr(trace.ground_truth, _TRUTH[name])[: len(time)]
        return channel
    if name in _COMMAND:
        return hold(trace.command.time, getattr(trace.command, _COMMAND[name]), time)
    if name in _ESTIMATE:
        return hold(trace.estimate.time, getattr(trace.estimate, _ESTIMATE[name]), time)
    return hold(trace.cloud.time, trace.cloud_count.astype(np.float64), time)
