"""Settings of the kernels; trajectory of a velocity, and its cost (``generateTrajectory``)."""

from __future__ import annotations

import math
import sys
from typing import Final, NamedTuple, get_type_hints

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.controller import sim_period
from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost, line_cost
from daemon.stacks.ros1.base_local_planner.map_grid import (
    FIT,
    Bits,
    Cells,
    cell_of,
    contains_cell,
    distance_at,
    place_of,
)
from daemon.stacks.ros1.cost_grid import INSCRIBED
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
from grammars.model.geometry import Floats

COLLIDES: Final = -1.0
"""Cost of a trajectory whose footprint leaves the grid or lies on an obstacle."""
LEADS_NOWHERE: Final = -2.0
"""Cost of a trajectory to cells without a way to path or goal."""
_NO_HEADING: Final = sys.float_info.max
_HEADING_WEIGHT: Final = 0.3
TERMS: Final = 6
PATH, GOAL, HEADING, CENTRE, FAILURE, LEGAL = range(TERMS)
"""Indices of the terms of a cost: distances, heading error, highest cost under the centre, reason
of an early end, and the number of points before it."""


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
        for name, kind in get_type_hints(RolloutSettings).items()
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


class RolloutGrid(NamedTuple):
    """The grid on which trajectories are scored.

    ``frame`` is x, y and resolution of the ``cells``; ``outline`` the footprint, (corners, 2) in
    metres. ``path`` and ``goal`` are grid distances; ``digits`` (2,) are in use. ``spans`` is
    scratch for the inside of a footprint, without rows if only the outline counts.
    """

    cells: Cells
    frame: Floats
    outline: Floats
    path: Bits
    goal: Bits
    digits: Integers
    spans: Integers


@kernel
def normalize_angle(angle: float) -> float:
    """Map an angle [rad] to (-pi, pi], with the rounding of the ROS package angles."""
    rest = float(np.fmod(angle + math.pi, 2.0 * math.pi))
    return rest + math.pi if rest <= 0.0 else rest - math.pi


@kernel
def count_points(vx: float, vy: float, wz: float, s: RolloutSettings) -> int:
    """Return the number of points of a sample's trajectory, at least one."""
    if s.heading_scoring:
        return max(1, int(s.sim_time / s.sim_granularity + 0.5))
    # As in the original, the turning speed is not multiplied by the duration.
    straight = math.hypot(vx, vy) * s.sim_time / s.sim_granularity
    return max(1, int(max(straight, abs(wz) / s.angular_sim_granularity) + 0.5))


@kernel
def _accelerate(target: float, speed: float, change: float) -> float:
    if target - speed >= 0.0:
        return min(target, speed + change)
    return max(target, speed - change)


@kernel
def simulate_trajectory(
    state: Floats, vx: float, vy: float, wz: float, s: RolloutSettings, points: Floats
) -> int:
    """Write the trajectory of a sample to ``points`` and return the number of points.

    ``state`` is x, y, yaw, vx, vy, wz. A row of ``points`` is x, y, yaw and the cosine and sine of
    yaw. The first row is the pose in ``state``; the end pose is not included. Speeds change within
    the limits of acceleration; Euler's method integrates poses.
    """
    n = count_points(vx, vy, wz, s)
    dt = s.sim_time / n
    x, y, yaw = state[0], state[1], state[2]
    ux, uy, uw = state[3], state[4], state[5]
    for i in range(n):
        c, d = math.cos(yaw), math.sin(yaw)
        points[i, 0], points[i, 1], points[i, 2] = x, y, yaw
        points[i, 3], points[i, 4] = c, d
        ux = _accelerate(vx, ux, s.acc_lim_x * dt)
        uy = _accelerate(vy, uy, s.acc_lim_y * dt)
        uw = _accelerate(wz, uw, s.acc_lim_theta * dt)
        along_x, along_y = ux * c, ux * d
        if uy != 0.0:
            # The original adds a quarter turn, which rounds differently from -sin and cos.
            along_x += uy * math.cos(math.pi / 2.0 + yaw)
            along_y += uy * math.sin(math.pi / 2.0 + yaw)
        x, y, yaw = x + along_x * dt, y + along_y * dt, yaw + uw * dt
    return n


@kernel
def heading_error(at: int, pose: Floats, plan: Floats, f: RolloutGrid) -> float:
    """Return the angle [rad] between a pose and the last point of the plan in its sight.

    Inscribed, lethal and unknown cells block the sight (``headingDiff``). Without a point in sight
    the result is the largest number.
    """
    rows, columns = f.cells.shape
    for i in range(plan.shape[0] - 1, -1, -1):
        row, column = place_of(plan[i, 0], plan[i, 1], f.frame, rows, columns)
        if row < 0:
            continue
        here = (at // columns, at % columns)
        worst = line_cost(f.cells, here, (row, column), f.spans)
        if 0 <= worst < INSCRIBED:
            x = f.frame[0] + (column + 0.5) * f.frame[2]
            y = f.frame[1] + (row + 0.5) * f.frame[2]
            return abs(normalize_angle(math.atan2(y - pose[1], x - pose[0]) - pose[2]))
    return _NO_HEADING


@kernel
def follow_cells(
    points: Floats, n: int, plan: Floats, s: RolloutSettings, f: RolloutGrid, terms: Floats
) -> int:
    """Write the ``terms`` of a trajectory except that of the footprint.

    Returns the number of points before the first one off the grid or without a way to path and
    goal, ``n`` if all are fine.
    """
    rows, columns = f.cells.shape
    size = f.cells.size
    flat = f.cells.reshape(-1)
    terms[:] = 0.0
    dt, time = s.sim_time / n, 0.0
    for i in range(n):
        at = cell_of(points[i, 0], points[i, 1], f.frame, rows, columns)
        if at < 0:
            terms[FAILURE] = COLLIDES
            return i
        terms[CENTRE] = max(terms[CENTRE], float(flat[at]))
        scored = i == n - 1
        if s.heading_scoring:
            scored = s.heading_scoring_timestep <= time < s.heading_scoring_timestep + dt
            time += dt
            if scored:
                terms[HEADING] = heading_error(at, points[i], plan, f)
        row, column = at // columns, at % columns
        if scored:
            terms[PATH] = distance_at(f.path, row, column, size, f.digits[0])
            terms[GOAL] = distance_at(f.goal, row, column, size, f.digits[1])
            fit = terms[PATH] < size and terms[GOAL] < size
        else:
            # With headings only one instant counts.
            fit = s.heading_scoring or (
                contains_cell(f.path[FIT], row, column) and contains_cell(f.goal[FIT], row, column)
            )
        if not fit:
            terms[FAILURE] = LEADS_NOWHERE
            return i
    return n


@kernel
def total_cost(obstacle: float, terms: Floats, s: RolloutSettings) -> float:
    """Sum the terms in the original's order."""
    if s.heading_scoring:
        cost = s.occdist_scale * obstacle + s.path_scale * terms[PATH]
        return float(cost + _HEADING_WEIGHT * terms[HEADING] + terms[GOAL] * s.goal_scale)
    cost = s.path_scale * terms[PATH] + terms[GOAL] * s.goal_scale
    return float(cost + s.occdist_scale * obstacle)


@kernel
def score_trajectory(
    points: Floats,
    n: int,
    plan: Floats,
    limit: float,
    s: RolloutSettings,
    f: RolloutGrid,
    terms: Floats,
) -> float:
    """Return the cost of a trajectory, ``COLLIDES`` or ``LEADS_NOWHERE`` if it is illegal.

    ``plan`` has the poses near the robot. Returns ``COLLIDES`` as soon as the cost exceeds
    ``limit``.
    """
    stop = follow_cells(points, n, plan, s, f, terms)
    # The original checks the footprint of a point first, then its way to path and goal.
    count = stop + 1 if terms[FAILURE] == LEADS_NOWHERE else stop
    terms[LEGAL] = stop
    obstacle = 0.0
    if stop == n:
        obstacle = terms[CENTRE]
        if total_cost(obstacle, terms, s) > limit:
            return COLLIDES
    for i in range(count):
        cost = footprint_cost(f.cells, f.frame, f.outline, 1.0, points[i], f.spans)
        if cost < 0:
            terms[FAILURE], terms[LEGAL] = COLLIDES, i
            return COLLIDES
        if cost > obstacle:
            obstacle = float(cost)
            # Weights are not negative, so later terms cannot lower the cost.
            if stop == n and total_cost(obstacle, terms, s) > limit:
                return COLLIDES
    if stop < n:
        return float(terms[FAILURE])
    return total_cost(obstacle, terms, s)
