"""The global planner of the stack: potential and path behind the interface of GlobalPlanner.

What the planner sees of one costmap, its potential and its path are kept from plan to plan.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np

from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import FREE_SPACE, LETHAL, CostGrid
from daemon.stacks.ros1.global_planner._parameters import FORWARD, GlobalPlannerParameters
from daemon.stacks.ros1.global_planner.descent import (
    descend_gradient,
    goal_is_doubtful,
    look_forward,
)
from daemon.stacks.ros1.global_planner.expansion import (
    MARGIN,
    copy_window,
    cost_tables,
    fill_around_goal,
    guide_table,
    seed_wave,
)
from daemon.stacks.ros1.navfn.guided import MARGINS, WORTHWHILE, GuidedField
from daemon.stacks.ros1.navfn.propagation import (
    BUFFER,
    UNREACHED,
    VALUE,
    path_to_poses,
    propagate_wave,
    reset_potentials,
)
from daemon.stacks.ros1.navfn.restricted import spread_towards
from daemon.stacks.ros1.quirks import FAST, Quirks
from grammars.model.geometry import Floats, Pose2

_Point: TypeAlias = tuple[float, float]
_Cell: TypeAlias = tuple[int, int]

_NEUTRAL_COSTS: Final = range(30, 101)
"""For these the margins of navfn, made for 50, are wide enough and do some good."""


class _Field(GuidedField):
    """One costmap as the planner sees it, with a potential and a path over it."""

    def __init__(
        self,
        grid: CostGrid,
        parameters: GlobalPlannerParameters,
        quirks: Quirks,
        *,
        worthwhile: int | None = None,
    ) -> None:
        rows, columns = grid.cells.shape
        guided = parameters.outline_map and parameters.neutral_cost in _NEUTRAL_COSTS
        super().__init__(
            (rows + 2 * MARGIN) * columns,
            columns,
            cycles=2 * rows * columns,
            margins=MARGINS if guided else (),
            worthwhile=WORTHWHILE if worthwhile is None else worthwhile,
        )
        self.grid, self._parameters = grid, parameters
        self._area = int(rows * columns)
        self._wrap = quirks.global_planner_costs_wrap
        self._states = self._flags = np.full(self.size, LETHAL, dtype=np.uint16)
        self._table, self._gains = cost_tables(
            parameters.lethal_cost,
            parameters.neutral_cost,
            parameters.cost_factor,
            allow_unknown=parameters.allow_unknown,
        )
        self._guide_table = guide_table(self._table, self._gains)
        self._costs[MARGIN * columns : -MARGIN * columns] = self._guide_table[LETHAL]
        self._buffers = np.empty((3, BUFFER), dtype=np.int32)
        self._make_room(8 * (rows + columns))
        self._length = 0
        self._boxed_in = False
        self._start: _Point = (-1.0, -1.0)
        self._goal: _Point = (-1.0, -1.0)
        self._goal_cell: _Cell = (0, 0)
        self._freed: _Cell | None = None
        self._changed = grid.watch()
        self._copy((0, 0, columns, rows))

    def sees(self, grid: CostGrid) -> bool:
        """Tell whether this is the costmap it was made for, in its size."""
        return self.grid is grid and grid.cells.shape == (self._area // self.columns, self.columns)

    def path(self, start: _Point, goal: _Point, goal_cell: _Cell, freed: _Cell | None) -> Singles:
        """Return the path from ``goal`` to ``start``, (n, 2) column and row, n may be 0.

        Both are columns and rows: whole numbers, or exact ones counted from cell centres. The
        cell ``freed`` is free for this planner, whatever the costmap says.
        """
        changed = self._copy(self._changed.take())
        if freed is not None:
            changed = self._free(freed) or changed
        if changed or (self._start, self._goal) != (start, goal):
            begin, end = self._entry(start), self._entry(goal)
            self._repeated = self._entry(self._goal) == end
            self._start, self._goal, self._goal_cell = start, goal, goal_cell
            self._length = self._search(begin, end)
        return self._path[: self._length]

    def _copy(self, window: tuple[int, int, int, int]) -> bool:
        changed = copy_window(
            self.grid.cells, self._states, self._costs, self._guide_table,
            self._parameters.outline_map, *window,
        )  # fmt: skip
        if changed:
            self._follow(window)
        return changed

    def _follow(self, window: tuple[int, int, int, int]) -> None:
        x0, y0, x1, y1 = window
        self._remainder.follow(self._costs, (x0, y0 + MARGIN, x1, y1 + MARGIN))

    def _free(self, cell: _Cell) -> bool:
        """See a cell as free, and the one before as the costmap has it; tell of changes."""
        changed = False
        if self._freed is not None and self._freed != cell:
            column, row = self._freed
            changed = self._copy((column, row, column + 1, row + 1))
        self._freed = cell
        column, row = cell
        rows = self._area // self.columns
        outermost = column in (0, self.columns - 1) or row in (0, rows - 1)
        n = self._entry(cell)
        if self._states[n] != FREE_SPACE and not (outermost and self._parameters.outline_map):
            self._states[n] = FREE_SPACE
            self._costs[n] = self._guide_table[FREE_SPACE]
            self._follow((column, row, column + 1, row + 1))
            changed = True
        return changed

    def _entry(self, point: _Point) -> int:
        """Return where a cell stands; what is left of the first column belongs to it."""
        return (MARGIN + int(point[1])) * self.columns + int(point[0])

    def _make_room(self, points: int) -> None:
        self._path = np.empty((points, 2), dtype=np.float32)
        self._cells = np.empty(points, dtype=np.int32)

    def _seeds(self, start: int) -> tuple[int, ...]:
        """Return the cells that have a potential before the wave spreads."""
        if self._parameters.old_navfn_behavior:
            return (start,)
        return start, start + 1, start + self.columns, start + self.columns + 1

    def _begins_at(self, start: int, goal: int) -> bool:
        return goal in self._seeds(start)

    def _remaining(self, start: int) -> float:
        return min(self._remainder.at(n) for n in self._seeds(start))

    def _seed(self, start: int) -> int:
        parameters, (x, y) = self._parameters, self._start
        reset_potentials(self._potentials, self._log, self._count)
        self._count, waiting = seed_wave(
            self._states, self._potentials, self._gains, self.columns, self._area, start,
            parameters.neutral_cost, not parameters.old_navfn_behavior, x - int(x), y - int(y),
            self._buffers[0], self._log,
        )  # fmt: skip
        self._boxed_in = waiting == 0
        return int(waiting)

    def _spread(self, start: int, goal: int) -> int:
        self.whole += 1
        waiting = self._seed(start)
        self._count, fill, _ = propagate_wave(
            self._states, self._potentials, self._table, self._gains, self.columns, goal,
            np.float32(self._parameters.lethal_cost), self._cycles, UNREACHED, self._buffers,
            waiting, self._log, self._count,
        )  # fmt: skip
        return int(fill)

    def _spread_towards(
        self, start: int, goal: int, bound: np.float32
    ) -> tuple[int, int, np.float32]:
        waiting = self._seed(start)
        ahead, seeds = self._remainder.ahead, self._buffers[0, :waiting]
        # The four cells at the start may lie between several areas, and the checks know of one.
        if (ahead[seeds] >= UNREACHED).any():
            self._states[seeds] &= VALUE
            self._doubts = 0
            return BUFFER, 0, bound
        self._count, self._doubts, fill, used, threshold = spread_towards(
            self._states, self._potentials, self._table, self._gains, ahead, bound,
            np.float32(self._parameters.lethal_cost), self.columns, goal, self._cycles,
            self._buffers, waiting, self._log, self._count, self._doubtful,
        )  # fmt: skip
        return int(fill), int(used), threshold

    def _goal_is_doubtful(self, goal: int, latest: float) -> bool:
        if self._parameters.old_navfn_behavior:
            return False
        return goal_is_doubtful(
            self._states, self._costs, self._potentials, self._remainder.ahead, np.float32(latest),
            self.columns, self._entry(self._goal_cell),
        )  # fmt: skip

    def _descend(self, start: int, goal: int) -> int:
        parameters = self._parameters
        # A robot boxed in goes nowhere, not even to a goal in its own cell.
        if self._boxed_in:
            return 0
        if not parameters.old_navfn_behavior:
            self._count = fill_around_goal(
                self._states, self._potentials, parameters.neutral_cost, self._wrap, self.columns,
                self._area, self._entry(self._goal_cell), self._log, self._count,
            )  # fmt: skip
        while True:
            length = descend_gradient(
                self._potentials, self.columns, self._area, self._start, self._goal, self._path,
                self._cells,
            )  # fmt: skip
            if length >= 0:
                return int(length)
            self._make_room(4 * len(self._path))


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
        descent does not lead back from.
        """
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        if here is None or there is None:
            return None
        freed = None if self._free_in_costmap(grid, *here) else here
        begin, end = self._point(grid, here, start), self._point(grid, there, goal)
        path = self._field_of(grid).path(begin, end, there, freed)
        if len(path) == 0:
            return None
        return self._poses(grid, path, goal)

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

    def _poses(self, grid: CostGrid, path: Singles, goal: Pose2) -> Floats:
        """Turn a path from the goal, in cells, round and into the grid's frame, with yaws."""
        parameters, quirks = self._parameters, self._quirks
        old = parameters.old_navfn_behavior
        count = len(path)
        poses = np.empty((count + (2 if old and quirks.global_planner_repeats_goal else 1), 3))
        path_to_poses(path, 0.0 if old else 0.5, grid.resolution, grid.x, grid.y, poses)
        poses[count:] = goal.x, goal.y, goal.yaw
        if parameters.orientation_mode == FORWARD:
            look_forward(poses, parameters.orientation_window_size)
        return poses


def warm_up() -> None:
    """Plan across a small costmap, and restricted while its costs change."""
    cells = np.zeros((80, 80), dtype=np.uint8)
    for old in (False, True):
        parameters = GlobalPlannerParameters(old_navfn_behavior=old)
        grid = CostGrid(0.05, 0.0, 0.0, cells.copy())
        GlobalPlanner(parameters, FAST).plan(grid, Pose2(0.28, 0.28), Pose2(1.28, 0.78))
    grid = CostGrid(0.05, 0.0, 0.0, cells.copy())
    field = _Field(grid, GlobalPlannerParameters(), FAST, worthwhile=1)
    for step in range(4):
        grid.cells[15, 15] = 254 - step
        grid.touch((15, 15, 16, 16))
        field.path((5.3, 20.3 + step), (35.3, 20.3), (35, 20), None)
