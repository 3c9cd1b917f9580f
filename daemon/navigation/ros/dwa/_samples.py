"""Which velocities are tried: the dynamic window and its samples."""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.dwa._settings import Settings
from grammars.values import Floats


@kernel
def single(value: float) -> float:
    """Return ``value`` rounded to single precision, as the original stores poses and speeds."""
    return float(np.float64(np.float32(value)))


@kernel
def spread(low: float, high: float, count: int, out: Floats) -> int:
    """Write evenly spaced speeds from ``low`` to ``high`` to ``out`` and return how many.

    Both ends belong to them, and a zero where the spacing would step over it
    (base_local_planner ``VelocityIterator``). ``out`` holds max(2, count) + 1 values.
    """
    if low == high:
        out[0] = single(low)
        return 1
    count = max(2, count)
    step = (high - low) / float(count - 1)
    following = low
    n = 0
    for _ in range(count - 1):
        current = following
        following += step
        out[n] = single(current)
        n += 1
        if current < 0.0 and following > 0.0:
            out[n] = 0.0
            n += 1
    out[n] = single(high)
    return n + 1


@kernel
def window(state: Floats, distance: float, s: Settings, out: Floats) -> None:
    """Write the lowest and highest speeds per axis (x, y, theta) to ``out``, shape (3, 2).

    ``state`` is x, y, yaw, vx, vy, wz in single precision, ``distance`` [m] that to the goal
    (base_local_planner ``SimpleTrajectoryGenerator::initialise``). The window may be upside down
    when the robot is faster than its limits.
    """
    reach = s.period
    max_x, max_y = s.max_x, s.max_y
    if not s.use_dwa and s.sim_time > 0.0:
        reach = s.sim_time
        max_x = max(min(max_x, distance / s.sim_time), s.min_x)
        max_y = max(min(max_y, distance / s.sim_time), s.min_y)
    out[0, 0] = single(max(s.min_x, state[3] - s.acc_x * reach))
    out[0, 1] = single(min(max_x, state[3] + s.acc_x * reach))
    out[1, 0] = single(max(s.min_y, state[4] - s.acc_y * reach))
    out[1, 1] = single(min(max_y, state[4] + s.acc_y * reach))
    out[2, 0] = single(max(-s.max_theta, state[5] - s.acc_theta * reach))
    out[2, 1] = single(min(s.max_theta, state[5] + s.acc_theta * reach))
    if not s.strafe_leaks:
        out[1, 0] = min(out[1, 0], single(max_y))
        out[1, 1] = max(out[1, 1], single(s.min_y))


@kernel
def speed_of(vx: float, vy: float) -> float:
    """Return the length of a velocity."""
    return abs(vx) if vy == 0.0 else math.hypot(vx, vy)


@kernel
def steps_of(speed: float, wz: float, s: Settings) -> int:
    """Return the number of points of a sample's trajectory; 0 when the sample is illegal.

    Illegal are samples slower than both minimum speeds or faster than the largest
    (``SimpleTrajectoryGenerator::generateTrajectory``).
    """
    if speed + 1e-4 < s.min_trans and abs(wz) + 1e-4 < s.min_theta:
        return 0
    if speed - 1e-4 > s.max_trans:
        return 0
    straight = speed * s.sim_time / s.granularity
    turning = abs(wz) * s.sim_time / s.angular_granularity
    return math.ceil(max(straight, turning))
