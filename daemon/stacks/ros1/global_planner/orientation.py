"""The yaw of the points of a plan (``OrientationFilter`` of global_planner).

Angles go through a quaternion each time they are set, as in the original, because a half turn
may fall to either side by the last bit.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from grammars.model.geometry import Floats

NONE: Final = 0
FORWARD: Final = 1
INTERPOLATE: Final = 2
FORWARD_THEN_INTERPOLATE: Final = 3
BACKWARD: Final = 4
LEFTWARD: Final = 5
RIGHTWARD: Final = 6
STRAIGHT: Final = 0.35
"""[rad] Points that differ no more from the last straight belong to it."""


@kernel
def _through_quaternion(yaw: float) -> float:
    """Return a yaw as it is read back from a quaternion (tf2 ``setRPY``, ``getYaw``)."""
    z, w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return math.atan2(2.0 * (w * z), w * w - z * z)


@kernel
def _normalize_angle(angle: float) -> float:
    """Return an angle [rad] in (-pi, pi] (``angles::normalize_angle``)."""
    rest: float = np.fmod(angle + math.pi, 2.0 * math.pi)
    return rest + math.pi if rest <= 0.0 else rest - math.pi


@kernel
def _direction(poses: Floats, i: int, window: int) -> float:
    """Return the direction of the path from ``window`` points before to as many behind."""
    a, b = max(0, i - window), min(poses.shape[0] - 1, i + window)
    return _through_quaternion(math.atan2(poses[b, 1] - poses[a, 1], poses[b, 0] - poses[a, 0]))


@kernel
def _interpolate(poses: Floats, first: int, counted_from: int) -> None:
    """Blend the yaw from point ``first`` to the last one, in steps counted from a point."""
    last = poses.shape[0] - 1
    begin = poses[first, 2]
    step = _normalize_angle(poses[last, 2] - begin) / (last - first)
    for i in range(first, last + 1):
        poses[i, 2] = _through_quaternion(begin + step * (i - counted_from))


@kernel
def orient(poses: Floats, start_yaw: float, mode: int, window: int, overshoot: bool) -> None:
    """Set the yaw of ``poses`` (n, 3), whose last one is the goal.

    ``overshoot``: in mode 3 steps are counted from the first point of the plan, not from where
    the last straight begins; the plan then ends with another yaw than the goal's. Of two points
    the original reads one before the first in that mode; here the straight begins at the first.
    """
    n = poses.shape[0]
    if mode == NONE:
        return
    if mode == INTERPOLATE:
        poses[0, 2] = _through_quaternion(start_yaw)
        poses[n - 1, 2] = _through_quaternion(poses[n - 1, 2])
        _interpolate(poses, 0, 0)
        return
    turn = 0.0
    if mode == BACKWARD:
        turn = math.pi
    elif mode == LEFTWARD:
        turn = -0.5 * math.pi
    elif mode == RIGHTWARD:
        turn = 0.5 * math.pi
    for i in range(n - 1):
        yaw = _direction(poses, i, window)
        if turn != 0.0:
            yaw = _through_quaternion(_normalize_angle(yaw + turn))
        poses[i, 2] = yaw
    if mode == FORWARD_THEN_INTERPOLATE:
        first = max(0, n - 3)
        straight = poses[first, 2]
        while first > 0 and abs(_normalize_angle(straight - poses[first - 1, 2])) <= STRAIGHT:
            first -= 1
        poses[0, 2] = _through_quaternion(start_yaw)
        poses[n - 1, 2] = _through_quaternion(poses[n - 1, 2])
        _interpolate(poses, first, 0 if overshoot else first)
