"""The global planner of the stack: potential and path behind the interface of GlobalPlanner.

What the planner sees of one costmap, its potential and its path are kept from plan to plan.
"""

from __future__ import annotations

from itertools import product
from typing import Final, TypeAlias

import numpy as np

from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import FREE_SPACE, LETHAL, CostGrid
from daemon.stacks.ros1.global_planner._parameters import GlobalPlannerParameters
from daemon.stacks.ros1.global_planner.astar import search_astar
from daemon.stacks.ros1.global_planner.descent import descend_cells, descend_gradient
from daemon.stacks.ros1.global_planner.expansion import (
    BUFFER,
    UNREACHED,
    copy_window,
    cost_tables,
    fill_around_goal,
    margin,
    propagate_wave,
    reset_potentials,
    seed_wave,
)
from daemon.stacks.ros1.global_planner.orientation import orient
from daemon.stacks.ros1.navfn.propagation import path_to_poses
from daemon.stacks.ros1.quirks import ORIGINAL, Quirks
from grammars.model.geometry import Floats, Pose2

_Point: TypeAlias = tuple[float, float]
_Cell: TypeAlias = tuple[int, int]

_AROUND_GOAL: Final = 25
"""Cells whose potential is set around the goal."""


class _Field:
    """One costmap as the planner sees it, with a potential and a path over it."""

    def __init__(self, grid: CostGrid, parameters: GlobalPlannerParameters, quirks: Quirks) -> None:
        rows, columns = grid.cells.shape
        self.grid = grid
        self._columns: int = columns
        self._size: int = rows * columns
        self._parameters = parameters
        self._wrap = quirks.global_planner_costs_wrap
        # Dijkstra along the gradient always comes to the exact start, and so does what rounds it.
        exact = parameters.use_dijkstra and not parameters.use_grid_path
        sure = exact or parameters.old_navfn_behavior
        self._lenient = not (sure or quirks.global_planner_misses_start)
        self._begin = margin(columns)
        entries = self._size + 2 * self._begin
        self._states = np.full(entries, LETHAL, dtype=np.uint16)
        self._potentials = np.full(entries, UNREACHED, dtype=np.float32)
        self._costs, self._gains = cost_tables(
            parameters.lethal_cost,
            parameters.neutral_cost,
            parameters.cost_factor,
            allow_unknown=parameters.allow_unknown,
        )
        self._reached = np.empty(self._size + _AROUND_GOAL, dtype=np.int32)
        self._count = 0
        heap = 0 if parameters.use_dijkstra else self._size + 1
        self._cells, self._totals = np.empty(heap, np.int32), np.empty(heap, np.float32)
        self._buffers = np.empty((3, BUFFER if parameters.use_dijkstra else 0), dtype=np.int32)
        self._path = np.empty((8 * (rows + columns), 2), dtype=np.float32)
        self._length = 0
        self._trip: tuple[_Point, ...] = ()
        self._freed: _Cell | None = None
        grid.take_changed()
        self._copy((0, 0, columns, rows))

    def sees(self, grid: CostGrid) -> bool:
        """Tell whether this is the costmap it was made for, in its size."""
        return self.grid is grid and grid.cells.shape == (
            self._size // self._columns,
            self._columns,
        )

    def path(self, start: _Point, goal: _Point, goal_cell: _Cell, freed: _Cell | None) -> Singles:
        """Return the path from ``goal`` to ``start``, (n, 2) column and row, n may be 0.

        Both are columns and rows: whole numbers, or exact ones counted from cell centres. The
        cell ``freed`` is free for this planner, whatever the costmap says.
        """
        changed = self._copy(self.grid.take_changed())
        if freed is not None:
            changed = self._free(freed) or changed
        if changed or self._trip != (start, goal):
            self._trip = (start, goal)
            self._length = self._search(start, goal, goal_cell)
        return self._path[: self._length]

    def _copy(self, window: tuple[int, int, int, int]) -> bool:
        return copy_window(self.grid.cells, self._states, self._parameters.outline_map, *window)

    def _free(self, cell: _Cell) -> bool:
        """See a cell as free, and the one before as the costmap has it; tell of changes."""
        changed = False
        if self._freed is not None and self._freed != cell:
            column, row = self._freed
            changed = self._copy((column, row, column + 1, row + 1))
        self._freed = cell
        column, row = cell
        rows = self._size // self._columns
        outermost = column in (0, self._columns - 1) or row in (0, rows - 1)
        n = self._begin + row * self._columns + column
        if self._states[n] != FREE_SPACE and not (outermost and self._parameters.outline_map):
            self._states[n] = FREE_SPACE
            changed = True
        return changed

    def _search(self, start: _Point, goal: _Point, goal_cell: _Cell) -> int:
        begin, end = self._entry(start), self._entry(goal)
        reset_potentials(self._potentials, self._reached, self._count)
        self._count = 0
        found = self._expand(begin, end, start)
        parameters = self._parameters
        if not found:
            return 0
        if not parameters.old_navfn_behavior:
            self._count = fill_around_goal(
                self._states, self._potentials, parameters.use_quadratic, parameters.neutral_cost,
                self._wrap, self._columns, self._size, self._entry(goal_cell), self._reached,
                self._count,
            )  # fmt: skip
        descend = descend_cells if parameters.use_grid_path else descend_gradient
        while True:
            length = descend(
                self._potentials, self._columns, self._size, start, goal, self._lenient, self._path
            )
            if length >= 0:
                return int(length)
            self._path = np.empty((4 * len(self._path), 2), dtype=np.float32)

    def _entry(self, point: _Point) -> int:
        """Return where a cell stands; what is left of the first column belongs to it."""
        return self._begin + int(point[0]) + int(point[1]) * self._columns

    def _expand(self, begin: int, end: int, start: _Point) -> bool:
        parameters = self._parameters
        if not parameters.use_dijkstra:
            self._count, found = search_astar(
                self._states, self._potentials, parameters.use_quadratic, parameters.allow_unknown,
                parameters.lethal_cost, parameters.neutral_cost, self._wrap, self._columns,
                self._size, begin, end, self._cells, self._totals, self._reached,
            )  # fmt: skip
            return found
        self._count, waiting = seed_wave(
            self._states, self._potentials, self._gains, self._columns, self._size, begin,
            parameters.neutral_cost, not parameters.old_navfn_behavior,
            start[0] - int(start[0]), start[1] - int(start[1]), self._buffers[0], self._reached,
        )  # fmt: skip
        self._count, found = propagate_wave(
            self._states, self._potentials, self._costs, self._gains, parameters.use_quadratic,
            parameters.lethal_cost, self._columns, end, 2 * self._size, self._buffers, waiting,
            self._reached, self._count,
        )  # fmt: skip
        return found


class GlobalPlanner:
    """Plans on a global costmap as GlobalPlanner does; ``quirks`` says what oddities are kept.

    The original also draws its outline into the costmap. Here it is the planner's own: the
    costmap would only inflate it, where an update's bounds come near the border.
    """

    def __init__(self, parameters: GlobalPlannerParameters, quirks: Quirks) -> None:
        self._parameters, self._quirks = parameters, quirks
        self._field: _Field | None = None

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        The last point is the goal; yaws are those of ``orientation_mode``. There is no plan from
        or to a point off the grid, nor to a goal that the expansion does not reach or that the
        descent does not lead back from. The only reader of the grid's changes is this planner
        (:meth:`CostGrid.take_changed`).
        """
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        if here is None or there is None:
            return None
        freed = None if self._free_in_costmap(grid, *here) else here
        begin, end = self._point(grid, here, start), self._point(grid, there, goal)
        path = self._field_of(grid).path(begin, end, there, freed)
        if len(path) == 0:
            return None
        return self._poses(grid, path, start.yaw, goal)

    def _free_in_costmap(self, grid: CostGrid, column: int, row: int) -> bool:
        """Set the robot's cell free for good, where that oddity is kept."""
        if not self._quirks.planner_frees_start_cell:
            return False
        if grid.cells[row, column] != FREE_SPACE:
            grid.cells[row, column] = FREE_SPACE
            grid.touch((column, row, column + 1, row + 1))
        return True

    def _point(self, grid: CostGrid, cell: _Cell, pose: Pose2) -> _Point:
        if self._parameters.old_navfn_behavior:
            return float(cell[0]), float(cell[1])
        return (pose.x - grid.x) / grid.resolution - 0.5, (pose.y - grid.y) / grid.resolution - 0.5

    def _field_of(self, grid: CostGrid) -> _Field:
        field = self._field
        if field is None or not field.sees(grid):
            field = self._field = _Field(grid, self._parameters, self._quirks)
        return field

    def _poses(self, grid: CostGrid, path: Singles, start_yaw: float, goal: Pose2) -> Floats:
        """Turn a path from the goal, in cells, round and into the grid's frame, with yaws."""
        parameters, quirks = self._parameters, self._quirks
        old = parameters.old_navfn_behavior
        count = len(path)
        poses = np.empty((count + (2 if old and quirks.global_planner_repeats_goal else 1), 3))
        path_to_poses(path, 0.0 if old else 0.5, grid.resolution, grid.x, grid.y, poses)
        poses[count:] = goal.x, goal.y, goal.yaw
        orient(
            poses,
            start_yaw,
            parameters.orientation_mode,
            parameters.orientation_window_size,
            quirks.orientation_blend_overshoots,
        )
        return poses


def warm_up() -> None:
    """Plan across a small costmap in every mode of expansion and tracing back."""
    cells = np.zeros((20, 30), dtype=np.uint8)
    for dijkstra, grid_path, old in product((False, True), repeat=3):
        parameters = GlobalPlannerParameters(
            use_dijkstra=dijkstra, use_grid_path=grid_path, old_navfn_behavior=old
        )
        grid = CostGrid(0.05, 0.0, 0.0, cells.copy())
        GlobalPlanner(parameters, ORIGINAL).plan(grid, Pose2(0.2, 0.2), Pose2(1.2, 0.7))
