"""The global planner of the stack: navfn behind the interface of NavfnROS.

Costs, potential and path of one costmap are kept from plan to plan (:class:`PotentialField`).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import FREE_SPACE, CostGrid
from daemon.stacks.ros1.navfn._parameters import NavfnParameters
from daemon.stacks.ros1.navfn.guided import MARGINS, WORTHWHILE, GuidedField
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    BUFFER,
    GAINS,
    UNREACHED,
    descend_gradient,
    path_to_poses,
    propagate_wave,
    reset_potentials,
    seed_wave,
    translate_costs,
    translation_table,
)
from daemon.stacks.ros1.navfn.restricted import spread_towards
from daemon.stacks.ros1.quirks import FAST, Quirks
from grammars.model.geometry import Floats, Pose2

_FIRST_THRESHOLD: Final = np.float32(BLOCKED)
_NO_TRIP: Final = (-1, -1)


class PotentialField(GuidedField):
    """The planner's own view of a costmap."""

    def __init__(
        self,
        grid: CostGrid,
        *,
        allow_unknown: bool,
        margins: tuple[float, ...] = MARGINS,
        worthwhile: int = WORTHWHILE,
    ) -> None:
        rows, columns = grid.cells.shape
        size = rows * columns
        super().__init__(
            size,
            columns,
            cycles=max(size // 20, rows + columns),
            margins=margins,
            worthwhile=worthwhile,
        )
        self.grid = grid
        self._table = translation_table(allow_unknown=allow_unknown)
        self._buffers = np.empty((3, BUFFER), dtype=np.int32)
        self._trip = _NO_TRIP
        self._path = np.empty((4 * columns, 2), dtype=np.float32)
        self._cells = np.empty(4 * columns, dtype=np.int32)
        self._length = 0
        self._changed = grid.watch()
        translate_costs(grid.cells, self._costs, self._table, 0, 0, columns, rows)

    def path(self, start: int, goal: int) -> Singles:
        """Return the path from ``goal`` down to ``start``, (n, 2) column and row, n may be 0."""
        changed = self._apply_changes()
        if changed or self._trip != (start, goal):
            self._repeated = self._trip[1] == goal
            self._trip = (start, goal)
            self._length = self._search(start, goal)
        return self._path[: self._length]

    def spread(self, start: int, goal: int) -> None:
        """Spread the whole wave, for :meth:`reached` and :meth:`descend`."""
        self._apply_changes()
        self._trip = _NO_TRIP
        self._spread(start, goal)

    def descend(self, start: int, cell: int) -> Singles:
        """Return the path from any reached cell down to ``start``, (n, 2)."""
        return self._path[: self._descend(start, cell)]

    def _apply_changes(self) -> bool:
        window = self._changed.take()
        changed = bool(translate_costs(self.grid.cells, self._costs, self._table, *window))
        if changed:
            self._remainder.follow(self._costs, window)
        return changed

    def _spread(self, start: int, goal: int) -> int:
        costs, potentials = self._costs, self._potentials
        reset_potentials(potentials, self._log, self._count)
        waiting = seed_wave(costs, potentials, self.columns, start, self._buffers[0], self._log)
        self._count, fill, _ = propagate_wave(
            costs, potentials, None, GAINS, self.columns, goal, _FIRST_THRESHOLD, self._cycles,
            UNREACHED, self._buffers, waiting, self._log, 1,
        )  # fmt: skip
        self.whole += 1
        return int(fill)

    def _spread_towards(
        self, start: int, goal: int, bound: np.float32
    ) -> tuple[int, int, np.float32]:
        costs, potentials = self._costs, self._potentials
        waiting = seed_wave(costs, potentials, self.columns, start, self._buffers[0], self._log)
        self._count, self._doubts, fill, used, threshold = spread_towards(
            costs, potentials, None, GAINS, self._remainder.ahead, bound, _FIRST_THRESHOLD,
            self.columns, goal, self._cycles, self._buffers, waiting, self._log, 1,
            self._doubtful,
        )  # fmt: skip
        return int(fill), int(used), threshold

    def _descend(self, start: int, goal: int) -> int:
        return int(
            descend_gradient(self._potentials, self.columns, start, goal, self._path, self._cells)
        )


class Navfn:
    """Plans on a global costmap as NavfnROS does; ``quirks`` says what of its oddities is kept."""

    def __init__(self, parameters: NavfnParameters, quirks: Quirks) -> None:
        self._parameters, self._quirks = parameters, quirks
        self._field: PotentialField | None = None

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        The points are half a cell apart with yaw 0; the last one is the goal with its own yaw.
        There is no plan from or to a point off the grid, to a goal that is blocked or out of
        reach, or with all four cells beside the robot blocked.
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

    def _field_of(self, grid: CostGrid) -> PotentialField:
        field = self._field
        if field is None or field.grid is not grid or field.size != grid.cells.size:
            field = PotentialField(grid, allow_unknown=self._parameters.allow_unknown)
            self._field = field
        return field

    def _end(self, grid: CostGrid, field: PotentialField, goal: Pose2) -> Pose2 | None:
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
        path_to_poses(path, shift, grid.resolution, grid.x, grid.y, poses)
        poses[count] = end.x, end.y, end.yaw
        return poses


def warm_up() -> None:
    """Plan across a small costmap, whole and restricted, while its costs change."""
    # So large that the limit of cycles, which grows with it, leaves room for a restricted wave.
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((80, 80), dtype=np.uint8))
    field = PotentialField(grid, allow_unknown=True, worthwhile=1)
    for step in range(4):
        grid.cells[15, 15] = 254 - step
        grid.touch((15, 15, 16, 16))
        field.path(1600 + step, 1610)
    Navfn(NavfnParameters(), FAST).plan(grid, Pose2(0.2, 0.2), Pose2(1.2, 0.7))
