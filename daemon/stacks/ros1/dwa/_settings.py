"""Parameters of dwa_local_planner for kernels: plain numbers."""

# Annotations stay types here: ``settings_of`` converts values by them.
import math
from typing import NamedTuple

import numpy as np

from daemon.stacks.ros1.base_local_planner.controller import sim_period
from daemon.stacks.ros1.dwa._parameters import DwaParameters
from daemon.stacks.ros1.quirks import Quirks


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
        for name, kind in DwaSettings.__annotations__.items()
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
