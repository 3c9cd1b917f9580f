"""The numbers kernels read, taken from the parameters once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.navigation.ros.dwa._parameters import DwaParameters
from daemon.navigation.ros.quirks import Quirks


class Settings(NamedTuple):
    """Limits in SI units, weights and switches; the types are the same for every configuration."""

    max_trans: float
    min_trans: float
    max_x: float
    min_x: float
    max_y: float
    min_y: float
    max_theta: float
    min_theta: float
    acc_x: float
    acc_y: float
    acc_theta: float
    period: float
    sim_time: float
    granularity: float
    angular_granularity: float
    path_scale: float
    goal_scale: float
    obstacle_scale: float
    twirling_scale: float
    forward: float
    scaling_speed: float
    max_scaling: float
    x_samples: int
    y_samples: int
    theta_samples: int
    use_dwa: bool
    sum_scores: bool
    strafe_leaks: bool
    perimeter_only: bool


def settings_of(
    parameters: DwaParameters, quirks: Quirks, resolution: float, period_default: float
) -> Settings:
    """Return the settings for a costmap of ``resolution`` [m].

    The distance weights count cells, hence times the resolution; accelerations are single
    precision (Eigen::Vector3f); sample numbers below one count as one (dynamic reconfigure).
    """
    p = parameters
    return Settings(
        max_trans=float(p.max_vel_trans),
        min_trans=float(p.min_vel_trans),
        max_x=float(p.max_vel_x),
        min_x=float(p.min_vel_x),
        max_y=float(p.max_vel_y),
        min_y=float(p.min_vel_y),
        max_theta=float(p.max_vel_theta),
        min_theta=float(p.min_vel_theta),
        acc_x=float(np.float32(p.acc_lim_x)),
        acc_y=float(np.float32(p.acc_lim_y)),
        acc_theta=float(np.float32(p.acc_lim_theta)),
        period=sim_period(p, period_default),
        sim_time=float(p.sim_time),
        granularity=float(p.sim_granularity),
        angular_granularity=float(p.angular_sim_granularity),
        path_scale=resolution * p.path_distance_bias,
        goal_scale=resolution * p.goal_distance_bias,
        obstacle_scale=float(p.occdist_scale),
        twirling_scale=float(p.twirling_scale),
        forward=float(p.forward_point_distance),
        scaling_speed=float(p.scaling_speed),
        max_scaling=float(p.max_scaling_factor),
        x_samples=max(1, p.vx_samples),
        y_samples=max(1, p.vy_samples),
        theta_samples=max(1, p.vth_samples),
        use_dwa=bool(p.use_dwa),
        sum_scores=bool(p.sum_scores),
        strafe_leaks=quirks.strafe_leaks,
        perimeter_only=quirks.perimeter_only,
    )


def sim_period(parameters: DwaParameters, default: float) -> float:
    """Return the period [s] of the dynamic window; 0.05 when the frequency makes no sense."""
    frequency = parameters.controller_frequency
    if frequency is None:
        return float(default)
    return 1.0 / frequency if frequency > 0.0 else 0.05


def longest(settings: Settings, vx: float, vy: float, wz: float) -> int:
    """Return more points than any trajectory has that starts with these velocities."""
    reach = settings.period if settings.use_dwa else settings.sim_time
    x = max(abs(settings.max_x), abs(settings.min_x), abs(vx) + settings.acc_x * reach)
    y = max(abs(settings.max_y), abs(settings.min_y), abs(vy) + settings.acc_y * reach)
    w = max(settings.max_theta, abs(wz) + settings.acc_theta * reach)
    straight = math.hypot(x, y) * settings.sim_time / settings.granularity
    return math.ceil(max(straight, w * settings.sim_time / settings.angular_granularity)) + 2
