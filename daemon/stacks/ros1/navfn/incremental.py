"""The global planner that keeps its potentials from plan to plan: ``planner: incremental``.

Navfn spreads its wave from the robot, which moves, so every plan is a new wave. Here the potential
is 0 at the goal, which stays for hundreds of plans: once it is there, a plan only repairs what
follows from costs that changed, as far as the robot (:mod:`.repair`), and descends from the robot
to the goal (:mod:`.descent`). Costs, the polynomial between neighbours, the gradient and its steps
of half a cell are navfn's. What differs, and makes other paths of nearly the same cost:

- The path is reckoned from the robot on. Near the robot it follows the potential of the goal,
  where navfn's has come to the robot's own cell.
- Of two ways about equally long the other one may be taken.
- Potentials solve navfn's equations everywhere, in eighths of a cost unit. Navfn's wave does not
  look again at a cell that would gain little, and loses cells when a buffer runs over.
- Navfn gives up after a twentieth of the cells in cycles of its wave, this one at the potential
  that such a wave could at most come to.

A path is a function of the costs, the start and the goal alone, not of the plans before: the
potentials it reads are those of the one solution. With ``default_tolerance`` the potential around
the goal is needed, and from a cell on the border of the map there is nothing to interpolate
between: both are planned as by :class:`Navfn`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn._planner import Navfn, NavfnParameters
from daemon.stacks.ros1.navfn.descent import descend_to_goal
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    THRESHOLD_STEP,
    UNREACHED,
    translation_table,
)
from daemon.stacks.ros1.navfn.repair import (
    BUCKET,
    FRESH,
    LOWEST,
    NOWHERE,
    UNKNOWN,
    UNUSED,
    WAITING,
    repair,
    take_changed_costs,
)
from daemon.stacks.ros1.quirks import ORIGINAL, Quirks
from grammars.model.geometry import Floats, Pose2

BEYOND: Final = np.float32(300.0)
"""How far beyond the robot potentials are right [cost]: six free cells, and what reads them is
two cells away."""
_MOST_BUCKETS: Final = (1 << 16) - 2
"""What ``queued`` can tell apart; a float32 holds eighths of a cost as far as that."""
_FEWEST_ENTRIES: Final = 1 << 16
_MOST_CHANGES: Final = 0.1
"""Share of all cells whose costs may change, before a new potential is quicker than a repair."""


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class IncrementalNavfnParameters(NavfnParameters):
    """The parameters of NavfnROS, for a planner that keeps its potentials."""


class GoalField:
    """Potentials over one costmap, 0 at the last goal; ``updates`` counts what was looked at."""

    def __init__(self, grid: CostGrid, *, allow_unknown: bool) -> None:
        rows, columns = grid.cells.shape
        size = rows * columns
        self.grid, self.columns, self.size = grid, columns, size
        self.shape = (rows, columns)
        self.updates = 0
        self._table = translation_table(allow_unknown=allow_unknown).astype(np.uint8)
        cycles = max(size // 20, rows + columns)
        self.highest: Final = np.float32(min(THRESHOLD_STEP * cycles, _MOST_BUCKETS * BUCKET))
        costs = np.full((rows, columns), BLOCKED, dtype=np.uint8)
        costs[1:-1, 1:-1] = self._table[grid.cells[1:-1, 1:-1]]
        self._costs, self._seen = costs.ravel(), grid.cells.copy()
        self._changed = np.empty(size, dtype=np.int32)
        self._potentials = np.empty(0, dtype=np.float32)
        self._queued = np.empty(0, dtype=np.uint16)
        self._entries = np.empty((_FEWEST_ENTRIES, 2), dtype=np.int32)
        self._heads = np.empty(int(self.highest / BUCKET) + 3, dtype=np.int32)
        self._state = np.zeros(4, dtype=np.int32)
        self._root, self._opened = NOWHERE, NOWHERE
        self._path = np.empty((4 * columns, 2), dtype=np.float32)
        grid.take_changed()
        self._count = 0

    def path(self, start: int, goal: int) -> Singles:
        """Return the path from ``goal`` back to ``start``, (n, 2) column and row, n may be 0.

        ``start`` lies inside the border; that it is blocked does not matter.
        """
        self._apply_changes(start)
        if start == goal:
            self._path[-1] = start % self.columns, start // self.columns
            return self._path[-1:]
        if self._costs[goal] >= BLOCKED:
            return self._path[:0]
        if goal != self._root or self._count > _MOST_CHANGES * self.size:
            self._begin(goal)
        self._repair(start, goal)
        if self._potentials[start] >= UNKNOWN:
            return self._path[:0]
        length = descend_to_goal(
            self._potentials, self.columns, start, goal, self._limit(start), self._path
        )
        return self._path[self._path.shape[0] - length :]

    def potentials(self, start: int) -> Singles:
        """Return the potentials a path from ``start`` reads, ``UNREACHED`` elsewhere, (size,)."""
        known = (self._potentials <= self._limit(start)) & (self._potentials < UNKNOWN)
        found: Singles = np.where(known, self._potentials + self.highest, UNREACHED)
        return found

    def _repair(self, start: int, goal: int) -> None:
        while True:
            done = repair(
                self._costs, self._potentials, self._queued, self._heads, self._entries,
                self._state, self.columns, self._changed, self._count, start, BEYOND, self.highest,
            )  # fmt: skip
            if done >= 0:
                break
            # The whole potential afresh, with more room.
            self._entries = np.empty((4 * len(self._entries), 2), dtype=np.int32)
            self._begin(goal)
        self.updates += done
        self._count = 0

    def _limit(self, start: int) -> np.float32:
        return np.float32(self._potentials[start] + BEYOND)

    def _apply_changes(self, start: int) -> None:
        """Take in changed costs; the cell the robot stands on can be left."""
        self._take(self.grid.take_changed())
        if self._opened not in (start, NOWHERE):
            opened, self._opened = self._opened, NOWHERE
            self._take_again(opened)
        if self._costs[start] >= BLOCKED:
            self._opened = start
            self._take_again(start)

    def _take_again(self, cell: int) -> None:
        row, column = divmod(cell, self.columns)
        self._seen[row, column] = ~self.grid.cells[row, column]
        self._take((column, row, column + 1, row + 1))

    def _take(self, window: tuple[int, int, int, int]) -> None:
        # A cell may change again before it is repaired, so that there can be more of them.
        if self._count + (window[2] - window[0]) * (window[3] - window[1]) > self.size:
            self._root, self._count = NOWHERE, 0
        self._count += take_changed_costs(
            self.grid.cells, self._seen, self._table, self._costs, window, self._opened,
            self._changed[self._count :],
        )  # fmt: skip

    def _begin(self, goal: int) -> None:
        """Forget all potentials but that of a new goal."""
        size, columns = self.size, self.columns
        # Memory of zeros that nobody touches costs nothing, and most cells are never reached.
        self._potentials = np.zeros(size, dtype=np.float32)
        self._queued = np.zeros(size, dtype=np.uint16)
        self._heads.fill(NOWHERE)
        self._state[[LOWEST, WAITING, UNUSED, FRESH]] = 1, 0, NOWHERE, 1
        self._root = goal
        self._potentials[goal] = -self.highest
        inside = [goal - 1, goal + 1, goal - columns, goal + columns]
        self._count = len(inside)
        self._changed[: self._count] = inside


class IncrementalNavfn(Navfn):
    """Plans as :class:`Navfn` does, with another potential: see the module."""

    def __init__(self, parameters: NavfnParameters, quirks: Quirks) -> None:
        super().__init__(parameters, quirks)
        self._goal_field: GoalField | None = None

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        When there is no plan, and what its points are, is as for :meth:`Navfn.plan`.
        """
        if self._parameters.default_tolerance > 0.0:
            return super().plan(grid, start, goal)
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        if here is None or there is None:
            return None
        self._free(grid, *here)
        rows, columns = grid.cells.shape
        field = self._goal_field
        if field is None or field.grid is not grid or field.shape != (rows, columns):
            field = self._new_field(grid)
        if not (0 < here[0] < columns - 1 and 0 < here[1] < rows - 1):
            # Another reader of the grid's changes: neither planner knows what the other has taken.
            self._goal_field = None
            return Navfn(self._parameters, self._quirks).plan(grid, start, goal)
        path = field.path(here[1] * columns + here[0], there[1] * columns + there[0])
        return self._poses(grid, path, goal)

    def _new_field(self, grid: CostGrid) -> GoalField:
        self._goal_field = GoalField(grid, allow_unknown=self._parameters.allow_unknown)
        return self._goal_field


def warm_up() -> None:
    """Plan twice across a small costmap; the default warm-up leaves this planner out."""
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((20, 20), dtype=np.uint8))
    planner = IncrementalNavfn(NavfnParameters(), ORIGINAL)
    for column in (2, 3):
        grid.cells[5, 5] = 10 * column
        grid.touch((5, 5, 6, 6))
        planner.plan(grid, Pose2(0.05 * column, 0.5), Pose2(0.8, 0.7))
