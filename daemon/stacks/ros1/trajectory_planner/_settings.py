"""Parameters as kernels read them: plain numbers, taken from the parameters once."""

from __future__ import annotations

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
    """Limits in SI units, weights and switches; the types are the same for every configuration.

    ``right`` and ``left`` are the fastest turns either way [rad/s], ``right`` below 0; ``instant``
    is when headings are scored [s].
    """

    max_x: float
    min_x: float
    left: float
    right: float
    slowest_turn: float
    acc_x: float
    acc_y: float
    acc_theta: float
    escape: float
    period: float
    sim_time: float
    granularity: float
    angular_granularity: float
    path_scale: float
    goal_scale: float
    obstacle_scale: float
    lookahead: float
    instant: float
    x_samples: int
    theta_samples: int
    holonomic: bool
    heading_scoring: bool
    dwa: bool
    simple_attractor: bool
    perimeter_only: bool


def settings_of(
    parameters: TrajectoryPlannerParameters,
    quirks: Quirks,
    resolution: float,
    period_default: float,
) -> RolloutSettings:
    """Return the settings for a costmap of ``resolution`` [m], in the ranges of the original."""
    p = parameters
    per_cell = resolution if p.meter_scoring else 1.0
    return RolloutSettings(
        max_x=in_range(p, "max_vel_x"),
        min_x=in_range(p, "min_vel_x"),
        left=in_range(p, "max_vel_theta"),
        right=in_range(p, "min_vel_theta"),
        slowest_turn=slowest_turn(p),
        acc_x=in_range(p, "acc_lim_x"),
        acc_y=in_range(p, "acc_lim_y"),
        acc_theta=in_range(p, "acc_lim_theta"),
        escape=in_range(p, "escape_vel"),
        period=sim_period(p.controller_frequency, period_default),
        sim_time=in_range(p, "sim_time"),
        granularity=in_range(p, "sim_granularity"),
        angular_granularity=in_range(p, "angular_sim_granularity"),
        path_scale=path_bias(p) * per_cell,
        goal_scale=goal_bias(p) * per_cell,
        obstacle_scale=in_range(p, "occdist_scale"),
        lookahead=in_range(p, "heading_lookahead"),
        instant=in_range(p, "heading_scoring_timestep"),
        x_samples=int(in_range(p, "vx_samples")),
        theta_samples=int(in_range(p, "vtheta_samples")),
        holonomic=p.holonomic_robot,
        heading_scoring=p.heading_scoring,
        dwa=p.dwa,
        simple_attractor=p.simple_attractor,
        perimeter_only=quirks.perimeter_only,
    )


def longest_trajectory(
    parameters: TrajectoryPlannerParameters, settings: RolloutSettings, twist: tuple[float, ...]
) -> int:
    """Return more points than any trajectory has that starts with the velocity ``twist``."""
    s = settings
    if s.heading_scoring:
        return int(s.sim_time / s.granularity) + 2
    reach = s.period if s.dwa else s.sim_time
    vx, vy, wz = (abs(speed) for speed in twist)
    x = max(s.max_x, s.min_x, abs(s.escape), vx + s.acc_x * reach, 0.1)
    y = max(vy, 0.1, *(abs(speed) for speed in strafe_speeds(parameters)))
    # Turns at the goal are scored as well, and have limits of their own.
    at_goal = (float(parameters.max_rotational_vel), slowest_turn_at_goal(parameters))
    turns = (s.left, -s.right, s.slowest_turn, *at_goal)
    w = max(*turns, wz + max(s.acc_theta, parameters.acc_lim_theta) * max(reach, s.period))
    straight = math.hypot(x, y) * s.sim_time / s.granularity
    return math.ceil(max(straight, w / s.angular_granularity)) + 2
