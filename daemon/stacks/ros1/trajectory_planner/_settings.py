"""Parameters of TrajectoryPlannerROS for kernels: plain numbers."""

# Annotations stay types here: ``settings_of`` converts values by them.
import math
from typing import NamedTuple

from daemon.stacks.ros1.base_local_planner.controller import sim_period
from daemon.stacks.ros1.quirks import Quirks
from daemon.stacks.ros1.trajectory_planner._parameters import (
    TrajectoryPlannerParameters,
    goal_bias,
    in_range,
    path_bias,
    slowest_turn,
    slowest_turn_at_goal,
    strafe_speeds,
)


class RolloutSettings(NamedTuple):
    """Limits in SI units, weights and switches, with the same types for every configuration.

    Fields with the names of :class:`TrajectoryPlannerParameters` have the same meaning.
    ``slowest_turn`` [rad/s] is that on the spot, ``period`` [s] that of the dynamic window.
    ``path_scale`` and ``goal_scale`` are weights per cell, ``perimeter_only`` is a quirk.
    """

    max_vel_x: float
    min_vel_x: float
    max_vel_theta: float
    min_vel_theta: float
    acc_lim_x: float
    acc_lim_y: float
    acc_lim_theta: float
    escape_vel: float
    sim_time: float
    sim_granularity: float
    angular_sim_granularity: float
    occdist_scale: float
    heading_lookahead: float
    heading_scoring_timestep: float
    vx_samples: int
    vtheta_samples: int
    holonomic_robot: bool
    heading_scoring: bool
    dwa: bool
    slowest_turn: float
    period: float
    path_scale: float
    goal_scale: float
    perimeter_only: bool


def settings_of(
    parameters: TrajectoryPlannerParameters,
    quirks: Quirks,
    resolution: float,
    period_default: float,
) -> RolloutSettings:
    """Return the settings for a costmap of ``resolution`` [m], in the ranges of the original."""
    p = parameters
    values = {
        name: kind(getattr(p, name) if kind is bool else in_range(p, name))
        for name, kind in RolloutSettings.__annotations__.items()
        if hasattr(p, name)
    }
    per_cell = resolution if p.meter_scoring else 1.0
    return RolloutSettings(
        **values,
        slowest_turn=slowest_turn(p),
        period=sim_period(p.controller_frequency, period_default),
        path_scale=path_bias(p) * per_cell,
        goal_scale=goal_bias(p) * per_cell,
        perimeter_only=quirks.perimeter_only,
    )


def longest_trajectory(
    parameters: TrajectoryPlannerParameters, settings: RolloutSettings, twist: tuple[float, ...]
) -> int:
    """Return an upper bound of the points of a trajectory that starts with ``twist``."""
    s = settings
    if s.heading_scoring:
        return int(s.sim_time / s.sim_granularity) + 2
    reach = s.period if s.dwa else s.sim_time
    vx, vy, wz = (abs(speed) for speed in twist)
    x = max(s.max_vel_x, s.min_vel_x, abs(s.escape_vel), vx + s.acc_lim_x * reach, 0.1)
    y = max(vy, 0.1, *(abs(speed) for speed in strafe_speeds(parameters)))
    # Turns at the goal are also scored, and have their own limits.
    at_goal = (float(parameters.max_rotational_vel), slowest_turn_at_goal(parameters))
    turns = (s.max_vel_theta, -s.min_vel_theta, s.slowest_turn, *at_goal)
    w = max(*turns, wz + max(s.acc_lim_theta, parameters.acc_lim_theta) * max(reach, s.period))
    straight = math.hypot(x, y) * s.sim_time / s.sim_granularity
    return math.ceil(max(straight, w / s.angular_sim_granularity)) + 2
