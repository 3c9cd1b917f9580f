"""The global planner of the stack: navfn behind the interface of NavfnROS."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.navigation.ros.grids import FREE_SPACE, CostGrid
from daemon.navigation.ros.navfn._costs import BLOCKED, UNREACHED, translate, translation
from daemon.navigation.ros.navfn._descent import descend
from daemon.navigation.ros.navfn._parameters import NavfnParameters
from daemon.navigation.ros.navfn._propagation import BUFFER, GAINS, forget, propagate
from daemon.navigation.ros.quirks import Quirks
from grammars.values import Floats, Pose2

_NO_CELL: Final = -1


class _Field:
    """Costs and potential of one costmap, kept from plan to plan."""

    def __init__(self, grid: CostGrid, *, allow_unknown: bool) -> None:
        rows, columns = grid.cells.shape
        self.grid, self.columns = grid, columns
        self.cycles = max(rows * columns // 20, rows + columns)
        self.costs = np.full(rows * columns, BLOCKED, dtype=np.uint16)
        self.potentials = np.full(rows * columns, UNREACHED, dtype=np.float32)
        self._table = translation(allow_unknown=allow_unknown)
        self._buffers = np.empty((3, BUFFER), dtype=np.int32)
        self._reached = np.empty(rows * columns + 1, dtype=np.int32)
        self._count = 0
        self._line = np.empty((4 * columns, 2), dtype=np.float32)
        self._trip = (_NO_CELL, _NO_CELL)
        grid.take_changed()
        self._renew((0, 0, columns, rows))

    def spread(self, start: int, goal: int) -> bool:
        """Bring the potential up to date; return whether it differs from the last one."""
        changed = self._renew(self.grid.take_changed())
        if not changed and self._trip == (start, goal):
            return False
        forget(self.potentials, self._reached, self._count)
        self._count = propagate(
            self.costs, self.potentials, GAINS, self.columns, start, goal, self.cycles,
            self._buffers, self._reached,
        )  # fmt: skip
        self._trip = (start, goal)
        return True

    def line(self, start: int, goal: int) -> Floats:
        """Return column and row of the path's points from start to goal, (n, 2), n may be 0."""
        count = descend(self.potentials, self.columns, start, goal, self._line)
        return self._line[:count][::-1].astype(np.float64)

    def reached(self, cell: int) -> bool:
        """Tell whether the wave reached a cell."""
        return bool(self.potentials[cell] < UNREACHED)

    def _renew(self, window: tuple[int, int, int, int]) -> bool:
        return translate(self.grid.cells, self.costs, self._table, self.potentials, *window)


class Navfn:
    """Plans on a global costmap as NavfnROS does; ``quirks`` says what of its oddities is kept."""

    def __init__(self, parameters: NavfnParameters, quirks: Quirks) -> None:
        self._parameters, self._quirks = parameters, quirks
        self._field: _Field | None = None

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
        field.spread(begin, 0 if there is None else there[1] * columns + there[0])
        end = self._end(grid, field, goal)
        if end is None:
            return None
        cell = grid.cell(end.x, end.y)
        assert cell is not None
        line = field.line(begin, cell[1] * columns + cell[0])
        return None if line.shape[0] == 0 else self._poses(grid, line, end)

    def _free(self, grid: CostGrid, column: int, row: int) -> None:
        # What the start cell costs never matters to its own wave, only to whoever looks later.
        if self._quirks.planner_frees_start_cell and grid.cells[row, column] != FREE_SPACE:
            grid.cells[row, column] = FREE_SPACE
            grid.touch((column, row, column + 1, row + 1))

    def _field_of(self, grid: CostGrid) -> _Field:
        field = self._field
        if field is None or field.grid is not grid or field.potentials.size != grid.cells.size:
            field = _Field(grid, allow_unknown=self._parameters.allow_unknown)
            self._field = field
        return field

    def _end(self, grid: CostGrid, field: _Field, goal: Pose2) -> Pose2 | None:
        """Return the reached point nearest to the goal within the tolerance, a square raster."""
        tolerance = self._parameters.default_tolerance
        best, nearest = None, math.inf
        y = goal.y - tolerance
        while y <= goal.y + tolerance:
            x = goal.x - tolerance
            while x <= goal.x + tolerance:
                cell = grid.cell(x, y)
                away = (x - goal.x) ** 2 + (y - goal.y) ** 2
                if cell is not None and away < nearest:
                    if field.reached(cell[1] * field.columns + cell[0]):
                        best, nearest = Pose2(x, y, goal.yaw), away
                x += grid.resolution
            y += grid.resolution
        return best

    def _poses(self, grid: CostGrid, line: Floats, end: Pose2) -> Floats:
        shift = 0.0 if self._quirks.navfn_corner_coordinates else 0.5
        poses = np.zeros((line.shape[0] + 1, 3))
        poses[:-1, 0] = grid.x + (line[:, 0] + shift) * grid.resolution
        poses[:-1, 1] = grid.y + (line[:, 1] + shift) * grid.resolution
        poses[-1] = end.x, end.y, end.yaw
        return poses
