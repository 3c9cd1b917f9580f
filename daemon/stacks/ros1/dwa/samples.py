"""Settings of the kernels; velocities to try (the dynamic window) and the trajectory of each."""

from __future__ import annotations

import math
from typing import Final, NamedTuple, get_type_hints

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.controller import sim_period
from daemon.stacks.ros1.dwa._parameters import DwaParameters
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats

SLACK: Final = 1e-4
"""Tolerance of the original for samples that are too slow or too fast [m/s, rad/s]
(``SimpleTrajectoryGenerator::generateTrajectory``)."""


class DwaSettings(NamedTuple):
    """Limits in SI units, weights and switches, with the same types for every configuration.

    Fields with the names of :class:`DwaParameters` have the same meaning. ``period`` [s] is that
    of the dynamic window; ``path_scale`` and ``goal_scale`` are weights per cell. The last two are
    quirks.
    """

    max_vel_trans: float
    min_vel_trans: float
    max_vel_x: float
    min_vel_x: float
    max_vel_y: float
    min_vel_y: float
    max_vel_theta: float
    min_vel_theta: float
    acc_lim_x: float
    acc_lim_y: float
    acc_lim_theta: float
    sim_time: float
    sim_granularity: float
    angular_sim_granularity: float
    occdist_scale: float
    twirling_scale: float
    forward_point_distance: float
    scaling_speed: float
    max_scaling_factor: float
    vx_samples: int
    vy_samples: int
    vth_samples: int
    use_dwa: bool
    sum_scores: bool
    period: float
    path_scale: float
    goal_scale: float
    strafe_leaks: bool
    perimeter_only: bool


def settings_of(
    parameters: DwaParameters, quirks: Quirks, resolution: float, period_default: float
) -> DwaSettings:
    """Return the settings for a costmap of ``resolution`` [m].

    The distance weights are per cell, hence times the resolution. Accelerations have single
    precision (Eigen::Vector3f). Sample numbers below one count as one (dynamic reconfigure).
    """
    p = parameters
    values = {
        name: kind(getattr(p, name))
        for name, kind in get_type_hints(DwaSettings).items()
        if hasattr(p, name)
    }
    for name in ("acc_lim_x", "acc_lim_y", "acc_lim_theta"):
        values[name] = float(np.float32(values[name]))
    for name in ("vx_samples", "vy_samples", "vth_samples"):
        values[name] = max(1, values[name])
    return DwaSettings(
        **values,
        period=sim_period(p.controller_frequency, period_default),
        path_scale=resolution * p.path_distance_bias,
        goal_scale=resolution * p.goal_distance_bias,
        strafe_leaks=quirks.strafe_leaks,
        perimeter_only=quirks.perimeter_only,
    )


def longest_trajectory(settings: DwaSettings, vx: float, vy: float, wz: float) -> int:
    """Return an upper bound of the points of a trajectory that starts with these velocities."""
    s = settings
    reach = s.period if s.use_dwa else s.sim_time
    x = max(abs(s.max_vel_x), abs(s.min_vel_x), abs(vx) + s.acc_lim_x * reach)
    y = max(abs(s.max_vel_y), abs(s.min_vel_y), abs(vy) + s.acc_lim_y * reach)
    w = max(s.max_vel_theta, abs(wz) + s.acc_lim_theta * reach)
    straight = math.hypot(x, y) * s.sim_time / s.sim_granularity
    return math.ceil(max(straight, w * s.sim_time / s.angular_sim_granularity)) + 2


@kernel
def round_to_single(value: float) -> float:
    """Return ``value`` rounded to single precision, as the original stores poses and speeds."""
    return float(np.float64(np.float32(value)))


@kernel
def sample_axis(low: float, high: float, count: int, out: Floats) -> int:
    """Write evenly spaced speeds from ``low`` to ``high`` to ``out`` and return their number.

    They include both ends, and a zero where the spacing would step over it
    (base_local_planner ``VelocityIterator``). ``out`` holds max(2, count) + 1 values.
    """
    if low == high:
        out[0] = round_to_single(low)
        return 1
    count = max(2, count)
    step = (high - low) / float(count - 1)
    following = low
    n = 0
    for _ in range(count - 1):
        current = following
        following += step
        out[n] = round_to_single(current)
        n += 1
        if current < 0.0 and following > 0.0:
            out[n] = 0.0
            n += 1
    out[n] = round_to_single(high)
    return n + 1


@kernel
def dynamic_window(state: Floats, distance: float, s: DwaSettings, out: Floats) -> None:
    """Write the lowest and highest speeds per axis (x, y, theta) to ``out``, shape (3, 2 or more).

    ``state`` is x, y, yaw, vx, vy, wz in single precision, ``distance`` [m] that to the goal
    (base_local_planner ``SimpleTrajectoryGenerator::initialise``). The lowest may exceed the
    highest if the robot is faster than its limits.
    """
    reach = s.period
    max_x, max_y = s.max_vel_x, s.max_vel_y
    if not s.use_dwa and s.sim_time > 0.0:
        reach = s.sim_time
        max_x = max(min(max_x, distance / s.sim_time), s.min_vel_x)
        max_y = max(min(max_y, distance / s.sim_time), s.min_vel_y)
    out[0, 0] = round_to_single(max(s.min_vel_x, state[3] - s.acc_lim_x * reach))
    out[0, 1] = round_to_single(min(max_x, state[3] + s.acc_lim_x * reach))
    out[1, 0] = round_to_single(max(s.min_vel_y, state[4] - s.acc_lim_y * reach))
    out[1, 1] = round_to_single(min(max_y, state[4] + s.acc_lim_y * reach))
    out[2, 0] = round_to_single(max(-s.max_vel_theta, state[5] - s.acc_lim_theta * reach))
    out[2, 1] = round_to_single(min(s.max_vel_theta, state[5] + s.acc_lim_theta * reach))
    if not s.strafe_leaks:
        out[1, 0] = min(out[1, 0], round_to_single(max_y))
        out[1, 1] = max(out[1, 1], round_to_single(s.min_vel_y))


@kernel
def sample_speeds(
    state: Floats, end: Floats, s: DwaSettings, samples: Floats, counts: Integers
) -> float:
    """Write the speeds to try per axis to ``samples`` (3, most), their numbers to ``counts`` (3,).

    ``end`` is the last point (x, y) of the plan near the robot. Returns a bound of the length of
    trajectories [m].
    """
    dynamic_window(state, math.hypot(end[0] - state[0], end[1] - state[1]), s, samples)
    square = 0.0
    for axis in range(2):
        most = max(abs(state[3 + axis]), abs(samples[axis, 0]), abs(samples[axis, 1]))
        square += most * most
    counts[0] = sample_axis(samples[0, 0], samples[0, 1], s.vx_samples, samples[0])
    counts[1] = sample_axis(samples[1, 0], samples[1, 1], s.vy_samples, samples[1])
    counts[2] = sample_axis(samples[2, 0], samples[2, 1], s.vth_samples, samples[2])
    speed = math.sqrt(square)
    if s.use_dwa:
        # Samples up to 1e-4 m/s above max_vel_trans are legal; the bound has the same margin again.
        speed = min(speed, s.max_vel_trans + 2e-4)
    return speed * s.sim_time


@kernel
def translation_speed(vx: float, vy: float) -> float:
    """Return the length of a velocity."""
    return abs(vx) if vy == 0.0 else math.hypot(vx, vy)


@kernel
def footprint_scale(speed: float, s: DwaSettings) -> float:
    """Return the factor by which speed enlarges the footprint (``getScalingFactor``)."""
    if speed <= s.scaling_speed or s.max_scaling_factor == 0.0:
        return 1.0
    beyond = s.max_vel_trans - s.scaling_speed
    if beyond == 0.0:
        return math.inf
    return s.max_scaling_factor * (speed - s.scaling_speed) / beyond + 1.0


@kernel
def points_for_way(speed: float, s: DwaSettings) -> float:
    """Return the number of points that ``sim_granularity`` requires at a ``speed`` [m/s]."""
    return float(math.ceil(speed * s.sim_time / s.sim_granularity))


@kernel
def points_for_turn(wz: float, s: DwaSettings) -> float:
    """Return the number of points that ``angular_sim_granularity`` requires."""
    return float(math.ceil(abs(wz) * s.sim_time / s.angular_sim_granularity))


@kernel
def count_points(speed: float, wz: float, s: DwaSettings) -> int:
    """Return the number of points of a sample's trajectory; 0 if the sample is illegal.

    Samples slower than both minimum speeds or faster than the largest are illegal
    (``SimpleTrajectoryGenerator::generateTrajectory``).
    """
    if speed + SLACK < s.min_vel_trans and abs(wz) + SLACK < s.min_vel_theta:
        return 0
    if speed - SLACK > s.max_vel_trans:
        return 0
    return int(max(points_for_way(speed, s), points_for_turn(wz, s)))


@kernel
def _accelerate(target: float, speed: float, change: float) -> float:
    if speed < target:
        return round_to_single(min(target, speed + change))
    return round_to_single(max(target, speed - change))


@kernel
def simulate_trajectory(
    state: Floats, vx: float, vy: float, wz: float, s: DwaSettings, points: Floats, moving: Floats
) -> int:
    """Write the trajectory of a sample to ``points`` and return the number of points, maybe 0.

    A row of ``points`` is x, y, yaw and the cosine and sine of yaw. The first row is the pose in
    ``state``; the end pose is not included. ``moving`` receives the velocity of the trajectory,
    which is the sample unless trajectories accelerate. Euler's method integrates poses, rounded to
    single precision at every step (``SimpleTrajectoryGenerator``).
    """
    moving[:] = 0.0
    n = count_points(translation_speed(vx, vy), wz, s)
    if n == 0:
        return 0
    dt = s.sim_time / n
    ux, uy, uw = vx, vy, wz
    if not s.use_dwa:
        ux = _accelerate(vx, state[3], s.acc_lim_x * dt)
        uy = _accelerate(vy, state[4], s.acc_lim_y * dt)
        uw = _accelerate(wz, state[5], s.acc_lim_theta * dt)
    moving[0], moving[1], moving[2] = ux, uy, uw
    x, y, yaw = state[0], state[1], state[2]
    for i in range(n):
        c, d = math.cos(yaw), math.sin(yaw)
        points[i, 0], points[i, 1], points[i, 2] = x, y, yaw
        points[i, 3], points[i, 4] = c, d
        if not s.use_dwa:
            ux = _accelerate(vx, ux, s.acc_lim_x * dt)
            uy = _accelerate(vy, uy, s.acc_lim_y * dt)
            uw = _accelerate(wz, uw, s.acc_lim_theta * dt)
        along_x, along_y = ux * c, ux * d
        if uy != 0.0:
            # The original adds a quarter turn, which rounds differently from -sin and cos.
            along_x += uy * math.cos(math.pi / 2.0 + yaw)
            along_y += uy * math.sin(math.pi / 2.0 + yaw)
        x, y, yaw = (
            round_to_single(x + along_x * dt),
            round_to_single(y + along_y * dt),
            round_to_single(yaw + uw * dt),
        )
    return n
