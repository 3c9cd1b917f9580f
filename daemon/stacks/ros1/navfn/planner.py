"""Global planner of the stack: navfn with the interface of NavfnROS."""

from __future__ import annotations

import math

import numpy as np

from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn._parameters import NavfnParameters
from daemon.stacks.ros1.navfn.descent import path_to_poses
from daemon.stacks.ros1.navfn.field import FieldRules, PotentialField, free_cell
from daemon.stacks.ros1.navfn.propagation import BLOCKED, navfn_costs
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2


def navfn_rules(*, allow_unknown: bool) -> FieldRules:
    """Return the rules of navfn."""
    costs = navfn_costs(allow_unknown=allow_unknown)
    return FieldRules(costs, np.float32(BLOCKED), outline=True, as_navfn=True)


class Navfn:
    """NavfnROS on a global costmap; ``quirks`` selects its oddities."""

    def __init__(self, parameters: NavfnParameters, quirks: Quirks) -> None:
        self._parameters, self._quirks = parameters, quirks
        self._field: PotentialField | None = None

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        The points are half a cell apart with yaw 0; the last one is the goal with its own yaw.
        There is no plan from or to a point off the grid, nor to a goal that is blocked or out of
        reach, nor if all four cells beside the robot are blocked.
        """
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        tolerance = self._parameters.default_tolerance
        if here is None or (there is None and tolerance <= 0.0):
            return None
        if self._quirks.planner_frees_start_cell:
            # The cost of the start does not matter to this wave, only to later readers.
            free_cell(grid, here)
        field, start_cell = self._field_of(grid), (float(here[0]), float(here[1]))
        if tolerance <= 0.0 and there is not None:
            goal_cell = (float(there[0]), float(there[1]))
            return self._poses(grid, field.path(start_cell, goal_cell, there), goal)
        field.spread(start_cell, there or (0, 0))
        end = self._end(grid, field, goal)
        cell = None if end is None else grid.cell(end.x, end.y)
        if end is None or cell is None:
            return None
        return self._poses(grid, field.descend(cell), end)

    def _field_of(self, grid: CostGrid) -> PotentialField:
        field = self._field
        if field is None or not field.sees(grid):
            rules = navfn_rules(allow_unknown=self._parameters.allow_unknown)
            field = self._field = PotentialField(grid, rules)
        return field

    def _end(self, grid: CostGrid, field: PotentialField, goal: Pose2) -> Pose2 | None:
        """Return the reached point nearest to the goal on a square raster of the tolerance."""
        tolerance = self._parameters.default_tolerance
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

    def _poses(self, grid: CostGrid, path: Singles, end: Pose2) -> Floats | None:
        """Reverse a path from the goal, in cells, and transform it into the grid's frame."""
        count = path.shape[0]
        if count == 0:
            return None
        shift = 0.0 if self._quirks.navfn_corner_coordinates else 0.5
        poses = np.empty((count + 1, 3))
        path_to_poses(path, shift, grid.resolution, grid.x, grid.y, poses)
        poses[count] = end.x, end.y, end.yaw
        return poses
