"""The global planner of the stack: navfn behind the interface of NavfnROS."""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.kernels import Singles
from daemon.navigation.ros.grids import FREE_SPACE, CostGrid
from daemon.navigation.ros.navfn._descent import turn_round
from daemon.navigation.ros.navfn._field import Field
from daemon.navigation.ros.navfn._parameters import NavfnParameters
from daemon.navigation.ros.quirks import Quirks
from grammars.values import Floats, Pose2


class Navfn:
    """Plans on a global costmap as NavfnROS does; ``quirks`` says what of its oddities is kept.

    Without ``certified`` fewer plans are checked by a whole wave, see :class:`Field`.
    """

    def __init__(
        self, parameters: NavfnParameters, quirks: Quirks, *, certified: bool = True
    ) -> None:
        self._parameters, self._quirks, self._certified = parameters, quirks, certified
        self._field: Field | None = None

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        The points are half a cell apart with yaw 0; the last one is the goal with its own yaw.
        There is no plan from or to a point off the grid, to a goal that is blocked or out of
        reach, or with all four cells beside the robot blocked. The only reader of the grid's
        changes is this planner (:meth:`CostGrid.take_changed`).
        """
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        tolerance = self._parameters.default_tolerance
        if here is None or (there is None and tolerance <= 0.0):
            return None
        self._free(grid, *here)
        columns = grid.cells.shape[1]
        field = self._field_of(grid)
        begin = here[1] * columns + here[0]
        target = 0 if there is None else there[1] * columns + there[0]
        if tolerance <= 0.0:
            return self._poses(grid, field.path(begin, target), goal)
        field.spread(begin, target)
        end = self._end(grid, field, goal)
        cell = None if end is None else grid.cell(end.x, end.y)
        if end is None or cell is None:
            return None
        return self._poses(grid, field.descend(begin, cell[1] * columns + cell[0]), end)

    def _free(self, grid: CostGrid, column: int, row: int) -> None:
        # What the start cell costs never matters to its own wave, only to whoever looks later.
        if self._quirks.planner_frees_start_cell and grid.cells[row, column] != FREE_SPACE:
            grid.cells[row, column] = FREE_SPACE
            grid.touch((column, row, column + 1, row + 1))

    def _field_of(self, grid: CostGrid) -> Field:
        field = self._field
        if field is None or field.grid is not grid or field.size != grid.cells.size:
            field = Field(
                grid, allow_unknown=self._parameters.allow_unknown, certified=self._certified
            )
            self._field = field
        return field

    def _end(self, grid: CostGrid, field: Field, goal: Pose2) -> Pose2 | None:
        """Return the reached point nearest to the goal within the tolerance, a square raster."""
        tolerance = self._parameters.default_tolerance
        best, nearest = None, math.inf
        y = goal.y - tolerance
        while y <= goal.y + tolerance:
            x = goal.x - tolerance
            while x <= goal.x + tolerance:
                cell = grid.cell(x, y)
                away = (x - goal.x) ** 2 + (y - goal.y) ** 2
                reached = cell is not None and field.reached(cell[1] * field.columns + cell[0])
                if reached and away < nearest:
                    best, nearest = Pose2(x, y, goal.yaw), away
                x += grid.resolution
            y += grid.resolution
        return best

    def _poses(self, grid: CostGrid, path: Singles, end: Pose2) -> Floats | None:
        """Turn a path from the goal, in cells, round and into the grid's frame."""
        count = path.shape[0]
        if count == 0:
            return None
        shift = 0.0 if self._quirks.navfn_corner_coordinates else 0.5
        poses = np.empty((count + 1, 3))
        turn_round(path, shift, grid.resolution, grid.x, grid.y, poses)
        poses[count] = end.x, end.y, end.yaw
        return poses
