"""Global planners of the stack: navfn (NavfnROS) and GlobalPlanner, each by a potential field."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import NO_INFORMATION, CostGrid
from daemon.stacks.ros1.navfn._parameters import (
    FORWARD,
    GlobalPlannerParameters,
    NavfnParameters,
)
from daemon.stacks.ros1.navfn.field import Cell, FieldRules, Point, PotentialField, free_cell
from daemon.stacks.ros1.navfn.propagation import BLOCKED, PENDING, cell_costs, navfn_costs
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2

_NEUTRAL_COSTS: Final = range(30, 101)
"""Neutral costs for which the margins of navfn, made for 50, are wide enough and useful."""


class _FieldPlanner:
    """Planner with a field of the costmap that it planned on last."""

    def __init__(self, rules: FieldRules) -> None:
        self._rules = rules
        self._field: PotentialField | None = None

    def _field_of(self, grid: CostGrid) -> PotentialField:
        if self._field is None or not self._field.sees(grid):
            self._field = PotentialField(grid, self._rules)
        return self._field


def _poses(
    grid: CostGrid, path: Singles, shift: float, goal: Pose2, goals: int = 1
) -> Floats | None:
    """Reverse a path from the goal, in cells, into x, y, yaw 0 of the grid's frame, (n, 3).

    ``shift`` [cells] is added; the pose ``goal`` follows ``goals`` times. An empty path is none.
    """
    count = len(path)
    if count == 0:
        return None
    poses = np.zeros((count + goals, 3))
    poses[:count, :2] = (path[::-1].astype(np.float64) + shift) * grid.resolution
    poses[:count, :2] += (grid.x, grid.y)
    poses[count:] = goal.x, goal.y, goal.yaw
    return poses


def navfn_rules(*, allow_unknown: bool) -> FieldRules:
    """Return the rules of navfn."""
    costs = navfn_costs(allow_unknown=allow_unknown)
    return FieldRules(costs, np.float32(BLOCKED), outline=True, as_navfn=True)


class Navfn(_FieldPlanner):
    """NavfnROS on a global costmap; ``quirks`` selects its oddities."""

    def __init__(self, parameters: NavfnParameters, quirks: Quirks) -> None:
        super().__init__(navfn_rules(allow_unknown=parameters.allow_unknown))
        self._tolerance = parameters.default_tolerance
        self._frees_start = quirks.planner_frees_start_cell
        self._shift = 0.0 if quirks.navfn_corner_coordinates else 0.5

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        The points are half a cell apart with yaw 0; the last one is the goal with its own yaw.
        There is no plan from or to a point off the grid, nor to a goal that is blocked or out of
        reach, nor if all four cells beside the robot are blocked.
        """
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        if here is None or (there is None and self._tolerance <= 0.0):
            return None
        if self._frees_start:
            # The cost of the start does not matter to this wave, only to later readers.
            free_cell(grid, here)
        field, start_cell = self._field_of(grid), (float(here[0]), float(here[1]))
        if self._tolerance <= 0.0 and there is not None:
            goal_cell = (float(there[0]), float(there[1]))
            return _poses(grid, field.path(start_cell, goal_cell, there), self._shift, goal)
        field.spread(start_cell, there or (0, 0))
        end = self._end(grid, field, goal)
        cell = None if end is None else grid.cell(end.x, end.y)
        if end is None or cell is None:
            return None
        return _poses(grid, field.descend(cell), self._shift, end)

    def _end(self, grid: CostGrid, field: PotentialField, goal: Pose2) -> Pose2 | None:
        """Return the reached point nearest to the goal on a square raster of the tolerance."""
        tolerance = self._tolerance
        best, nearest = None, math.inf
        y = goal.y - tolerance
        while y <= goal.y + tolerance:
            x = goal.x - tolerance
            while x <= goal.x + tolerance:
                cell = grid.cell(x, y)
                away = (x - goal.x) ** 2 + (y - goal.y) ** 2
                reached = cell is not None and field.reached(cell)
                if reached and away < nearest:
                    best, nearest = Pose2(x, y, goal.yaw), away
                x += grid.resolution
            y += grid.resolution
        return best


def global_planner_rules(parameters: GlobalPlannerParameters, quirks: Quirks) -> FieldRules:
    """Return the rules of GlobalPlanner; the state of a cell is its costmap value (``getCost``)."""
    p, values, goal_costs = parameters, np.arange(PENDING), None
    blocked = values >= p.lethal_cost - 1
    if p.allow_unknown:
        blocked[NO_INFORMATION] = False
    costs = values.astype(np.float32) * np.float32(p.cost_factor) + np.float32(p.neutral_cost)
    costs[costs >= p.lethal_cost] = p.lethal_cost - 1
    if not p.old_navfn_behavior:
        around = values + p.neutral_cost
        # A cost is one byte: in the original 256 is 0.
        wraps = quirks.global_planner_costs_wrap
        goal_costs = (around & 255 if wraps else np.minimum(around, 255)).astype(np.float32)
    return FieldRules(
        cell_costs(values.astype(np.uint16), costs, blocked),
        np.float32(p.lethal_cost),
        outline=p.outline_map,
        as_navfn=False,
        is_guided=p.outline_map and p.neutral_cost in _NEUTRAL_COSTS,
        neutral=p.neutral_cost,
        goal_costs=goal_costs,
    )


class GlobalPlanner(_FieldPlanner):
    """GlobalPlanner on a global costmap; ``quirks`` selects its oddities.

    The original also draws its outline into the costmap. Here only the planner has it: the costmap
    would merely inflate it when an update comes near the border.
    """

    def __init__(self, parameters: GlobalPlannerParameters, quirks: Quirks) -> None:
        super().__init__(global_planner_rules(parameters, quirks))
        self._parameters, self._quirks = parameters, quirks

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        The last point is the goal; yaws are those of ``orientation_mode``. There is no plan from
        or to a point off the grid, nor if the expansion or the descent fails.
        """
        parameters, quirks = self._parameters, self._quirks
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        if here is None or there is None:
            return None
        freed = None if quirks.planner_frees_start_cell else here
        if freed is None:
            free_cell(grid, here)
        begin, end = self._point(grid, here, start), self._point(grid, there, goal)
        path = self._field_of(grid).path(begin, end, there, freed)
        old = parameters.old_navfn_behavior
        goals = 2 if old and quirks.global_planner_repeats_goal else 1
        poses = _poses(grid, path, 0.0 if old else 0.5, goal, goals)
        if poses is not None and parameters.orientation_mode == FORWARD:
            look_forward(poses, parameters.orientation_window_size)
        return poses

    def _point(self, grid: CostGrid, cell: Cell, pose: Pose2) -> Point:
        if self._parameters.old_navfn_behavior:
            return float(cell[0]), float(cell[1])
        return (pose.x - grid.x) / grid.resolution - 0.5, (pose.y - grid.y) / grid.resolution - 0.5


@kernel
def look_forward(poses: Floats, window: int) -> None:
    """Set the yaws of ``poses`` (n, 3) along the path, except for the last one, the goal.

    A yaw is the direction from ``window`` points before to as many behind (``OrientationFilter``).
    It goes through a quaternion as in the original (tf2 ``setRPY``, ``getYaw``), because the last
    bit decides about the sign of a half turn.
    """
    last = poses.shape[0] - 1
    for i in range(last):
        a, b = max(0, i - window), min(last, i + window)
        yaw = math.atan2(poses[b, 1] - poses[a, 1], poses[b, 0] - poses[a, 0])
        z, w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        poses[i, 2] = math.atan2(2.0 * (w * z), w * w - z * z)
