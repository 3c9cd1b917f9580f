"""Potential and path over one costmap, kept from plan to plan, for navfn and GlobalPlanner.

This module decides when to try a restricted wave, how far it reaches, and when its result counts.
Its kernels and their reasons are in :mod:`.restricted`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import FREE_SPACE, CostGrid, Window
from daemon.stacks.ros1.navfn.descent import descend_gradient, fill_around_goal
from daemon.stacks.ros1.navfn.propagation import (
    BUFFER,
    SPARE_ROWS,
    UNREACHED,
    VALUE,
    CellCosts,
    copy_window,
    new_wave,
    propagate_wave,
    reset_potentials,
    seed_cell,
    seed_wave,
)
from daemon.stacks.ros1.navfn.restricted import (
    CostToGo,
    any_is_doubtful,
    clear_doubts,
    descent_is_doubtful,
    spread_towards,
)

Point: TypeAlias = tuple[float, float]
"""Column and row: integers, or exact coordinates counted from cell centres."""
Cell: TypeAlias = tuple[int, int]

MARGINS: Final = (2000.0, 4000.0, 8000.0, 16_000.0)
"""Detours [cost] that the restricted search allows, one after the other; a free cell costs 50."""
WORTHWHILE: Final = 12_000
"""Least number of cells of a whole wave for which a restricted one pays."""
_OUTDATED: Final = 1000.0
"""Detour [cost] by changed costs beyond which the remainder is renewed."""
_EXTRA_REACH: Final = 2500.0
"""Reach of the remainder [cost] beyond the present need."""
_RETRY: Final = 12
"""Number of plans before a smaller margin is tried again."""
_AROUND_GOAL: Final = 25
"""Cells that may get a potential after the wave."""
_NOWHERE: Final = (-1.0, -1.0)


def free_cell(grid: CostGrid, cell: Cell) -> None:
    """Set a cell of the costmap free."""
    column, row = cell
    if grid.cells[row, column] != FREE_SPACE:
        grid.cells[row, column] = FREE_SPACE
        grid.touch((column, row, column + 1, row + 1))


@dataclass(frozen=True, slots=True, eq=False)
class FieldRules:
    """Costs of a planner, and other differences between navfn and GlobalPlanner.

    ``threshold`` ends the first block of a wave. With ``outline`` the outermost cells are always
    blocked. ``as_navfn`` sets the limits of waves and descents.

    ``goal_costs`` (256,) by state are for exact ends; without them ends are cells. They give the
    cells around the goal a potential. The start seeds four cells by the ``neutral`` cost.

    With ``is_guided`` margins in units of navfn's costs restrict waves.
    """

    costs: CellCosts
    threshold: np.float32
    outline: bool
    as_navfn: bool
    is_guided: bool = True
    neutral: int = 0
    goal_costs: Singles | None = None


class PotentialField:
    """Potentials over a costmap, and the path down from the goal to the robot.

    With ``margins`` the wave is restricted to the cells that can matter, and then checked. Without
    it is always whole. ``whole`` and ``restricted`` count the waves that gave an answer.
    """

    def __init__(
        self,
        grid: CostGrid,
        rules: FieldRules,
        *,
        margins: tuple[float, ...] = MARGINS,
        worthwhile: int = WORTHWHILE,
    ) -> None:
        rows, columns = grid.cells.shape
        area, size = rows * columns, (rows + 2 * SPARE_ROWS) * columns
        self.grid, self.columns = grid, int(columns)
        self.whole, self.restricted = 0, 0
        self._shape, self._rules = grid.cells.shape, rules
        self._margins, self._worthwhile = margins if rules.is_guided else (), worthwhile
        self._wave = new_wave(rules.costs, size, columns, _AROUND_GOAL)
        self._doubtful = np.empty(size, dtype=np.int32)
        self._count, self._level, self._steady = 0, 0, 0
        self._remainder = CostToGo(self._wave, rules.costs)
        self._excess, self._usable = 0.0, False
        self._repeated = self._boxed_in = False
        self._start, self._goal, self._goal_cell = _NOWHERE, _NOWHERE, 0
        self._freed: Cell | None = None
        if rules.as_navfn:
            self._cycles, self._steps = max(area // 20, rows + columns), 4 * columns
            self._make_room(self._steps)
        else:
            self._cycles, self._steps = 2 * area, 4 * area
            self._make_room(8 * (rows + columns))
        self._length = 0
        self._changed = grid.watch()
        self._copy((0, 0, columns, rows))

    def sees(self, grid: CostGrid) -> bool:
        """Tell whether the field belongs to this costmap in its present size."""
        return self.grid is grid and self._shape == grid.cells.shape

    def path(
        self, start: Point, goal: Point, goal_cell: Cell, freed: Cell | None = None
    ) -> Singles:
        """Return the path from ``goal`` to ``start``, (n, 2) column and row, n may be 0.

        The cell ``freed`` is free for this planner, regardless of the costmap.
        """
        changed = self._copy(self._changed.take())
        if freed is not None:
            changed = self._free(freed) or changed
        if changed or (self._start, self._goal) != (start, goal):
            begin, end = self._entry(start), self._entry(goal)
            self._repeated = self._entry(self._goal) == end
            self._start, self._goal = start, goal
            self._goal_cell = self._entry(goal_cell)
            self._length = self._search(begin, end)
        return self._path[: self._length]

    def spread(self, start: Point, goal: Cell) -> None:
        """Spread the whole wave, for :meth:`reached` and :meth:`descend`."""
        self._copy(self._changed.take())
        self._start, self._goal = start, _NOWHERE
        self._spread(self._entry(start), self._entry(goal))

    def reached(self, cell: Cell) -> bool:
        """Tell whether the wave reached a cell."""
        return self._is_reached(self._entry(cell))

    def descend(self, cell: Cell) -> Singles:
        """Return the path from any reached cell down to the start, (n, 2)."""
        return self._path[: self._descend(cell)]

    def _entry(self, point: Point) -> int:
        """Return the index of a cell; points left of the first column belong to it."""
        return (SPARE_ROWS + int(point[1])) * self.columns + int(point[0])

    def _make_room(self, points: int) -> None:
        self._path = np.empty((points, 2), dtype=np.float32)
        self._cells = np.empty(points, dtype=np.int32)

    def _copy(self, window: Window) -> bool:
        rules = self._rules
        changed = copy_window(
            self.grid.cells, self._wave.states, rules.costs.states, int(rules.outline), window
        )
        if changed:
            self._remainder.follow(window)
        return bool(changed)

    def _free(self, cell: Cell) -> bool:
        """Treat a cell as free and restore the previous one; tell whether anything changed."""
        changed = False
        if self._freed is not None and self._freed != cell:
            column, row = self._freed
            changed = self._copy((column, row, column + 1, row + 1))
        self._freed = cell
        column, row = cell
        rows, columns = self._shape
        outermost = column in (0, columns - 1) or row in (0, rows - 1)
        n, free = self._entry(cell), self._rules.costs.states[FREE_SPACE]
        if self._wave.states[n] != free and not (outermost and self._rules.outline):
            self._wave.states[n] = free
            self._remainder.follow((column, row, column + 1, row + 1))
            changed = True
        return changed

    def _seeds(self, start: int) -> tuple[int, ...]:
        """Return the cells that have a potential before the wave spreads."""
        if self._rules.goal_costs is None:
            return (start,)
        return start, start + 1, start + self.columns, start + self.columns + 1

    def _seed(self, start: int) -> int:
        """Begin a wave; return the number of waiting cells."""
        wave, line = self._wave, self.columns
        reset_potentials(wave.potentials, wave.reached, self._count)
        if self._rules.goal_costs is None:
            self._count, waiting = 1, seed_cell(wave, start)
        else:
            # At the border of the map some of the four cells would lie off it.
            u, v = (_to_hundredth(c - int(c)) for c in self._start)
            potentials = [
                self._rules.neutral * 2 * across * along
                for along in (v, 1.0 - v)
                for across in (u, 1.0 - u)
            ]
            end = wave.states.size - SPARE_ROWS * line
            seeds = [(n, p) for n, p in zip(self._seeds(start), potentials, strict=True) if n < end]
            around = (2, -1, line - 1, line + 2, -line, 1 - line, 2 * line, 2 * line + 1)
            self._count, waiting = len(seeds), seed_wave(wave, seeds, [start + k for k in around])
        self._boxed_in = waiting == 0
        return waiting

    def _spread(self, start: int, goal: int) -> int:
        """Spread the whole wave; return the largest number of waiting cells in a buffer."""
        self.whole += 1
        waiting = self._seed(start)
        self._count, fill, _ = propagate_wave(
            self._wave, goal, self._rules.threshold, self._cycles, UNREACHED, waiting, self._count
        )
        return int(fill)

    def _is_reached(self, cell: int) -> bool:
        return bool(self._wave.potentials[cell] < UNREACHED)

    def _descend(self, goal: Point) -> int:
        """Write the path, and its cells into ``_cells``; return its length, 0 without a path."""
        rules, wave = self._rules, self._wave
        # With GlobalPlanner an enclosed robot has no path, not even to a goal in its own cell.
        if self._boxed_in and not rules.as_navfn:
            return 0
        if rules.goal_costs is not None:
            self._count = fill_around_goal(wave, rules.goal_costs, self._goal_cell, self._count)
        while True:
            length = descend_gradient(
                wave.potentials, self.columns, self._start, (float(goal[0]), float(goal[1])),
                rules.as_navfn, self._steps, self._path, self._cells,
            )  # fmt: skip
            if length >= 0:
                return int(length)
            self._make_room(4 * len(self._path))

    def _search(self, start: int, goal: int) -> int:
        is_seed = goal in self._seeds(start)
        if not is_seed and self._rules.costs.gains[self._wave.states[goal]] == np.inf:
            return 0
        # The restricted search needs a cost to go, which pays only if a goal repeats.
        is_guided = self._margins and self._repeated and not is_seed
        if is_guided and self._prepare_cost_to_go(start, goal):
            if self._is_unreachable(start, goal):
                return 0
            length = self._search_restricted(start, goal)
            if length > 0:
                return length
        fill = self._spread(start, goal)
        length = self._descend(self._goal) if self._is_reached(goal) else 0
        self._update_cost_to_go(start, goal, fill)
        return length

    def _prepare_cost_to_go(self, start: int, goal: int) -> bool:
        """Make the remainder for this goal if that pays; tell whether it exists."""
        if self._remainder.goal != goal and self._usable and self._count >= self._worthwhile:
            reach = float(self._wave.potentials[goal]) + self._margins[0] + _EXTRA_REACH
            self._usable = self._remainder.renew(goal, reach)
            self._excess = self._surplus(start, goal)
        return self._remainder.goal == goal

    def _remaining(self, start: int) -> float:
        """Return the remaining cost from the start; unreached only if there is no way."""
        return min(self._remainder.at(n) for n in self._seeds(start))

    def _is_unreachable(self, start: int, goal: int) -> bool:
        """Tell whether the goal is certainly out of reach."""
        remainder = self._remainder
        if self._remaining(start) < UNREACHED:
            return False
        if remainder.whole:
            return True
        renewed = remainder.renew(goal, float(UNREACHED))
        return renewed and self._remaining(start) >= float(UNREACHED)

    def _bound(self, start: int, goal: int, margin: float) -> float:
        """Return the highest cost of a way through a cell; extend the remainder to it."""
        bound = self._remaining(start) + self._excess + margin
        if bound > self._remainder.limit:
            self._usable = self._remainder.renew(goal, bound + _EXTRA_REACH)
        return bound

    def _surplus(self, start: int, goal: int) -> float:
        """Return the cost of the last wave beyond the remainder."""
        cost, remaining = float(self._wave.potentials[goal]), self._remaining(start)
        return max(0.0, cost - remaining) if max(cost, remaining) < UNREACHED else 0.0

    def _search_restricted(self, start: int, goal: int) -> int:
        first = self._level
        if first > 0 and self._steady >= _RETRY:
            first, self._steady = first - 1, 0
        for level in range(first, len(self._margins)):
            length = self._restricted(start, goal, self._margins[level])
            if length > 0:
                self._steady = self._steady + 1 if level == self._level else 0
                self._level = level
                self.restricted += 1
                return length
        return 0

    def _restricted(self, start: int, goal: int, margin: float) -> int:
        """Return the length of the path, 0 unless it is certainly that of the whole wave."""
        bound = np.float32(self._bound(start, goal, margin))
        remainder, wave = self._remainder, self._wave
        if remainder.goal != goal:
            return 0
        waiting = self._seed(start)
        waiting_cells = wave.buffers[0, :waiting]
        # The four cells at the start may touch several areas, but the checks know only one.
        if not self._rules.as_navfn and (remainder.ahead[waiting_cells] >= UNREACHED).any():
            wave.states[waiting_cells] &= VALUE
            return 0
        self._count, doubts, fill, used, threshold = spread_towards(
            wave, remainder.ahead, bound, self._rules.threshold, goal, self._cycles, waiting,
            self._count, self._doubtful,
        )  # fmt: skip
        # A wave through excluded cells reaches the goal later than the bound.
        spare = bound - threshold - margin / 4.0
        length = 0
        # Excluded cells also take room in the buffers and cycles, so stay well below both limits.
        within = fill <= BUFFER // 2 and used <= self._cycles // 4
        if self._is_reached(goal) and spare >= margin / 4.0 and within:
            length = self._certain_descent(np.float32(spare))
        clear_doubts(wave.states, self._doubtful, doubts)
        if length > 0:
            self._excess = self._surplus(start, goal)
            remainder.limit = min(remainder.limit, float(bound) + _EXTRA_REACH)
        return length

    def _certain_descent(self, spare: np.float32) -> int:
        """Descend from the goal; return 0 if anything on the way is doubtful."""
        wave, ahead = self._wave, self._remainder.ahead
        # The cells around the goal get their potentials from cells up to three away.
        corner = self._goal_cell - 3 * self.columns - 3
        exact = self._rules.goal_costs is not None
        if exact and any_is_doubtful(wave, ahead, spare, corner, 7):
            return 0
        length = self._descend(self._goal)
        if length > 0 and descent_is_doubtful(wave, ahead, spare, self._cells, length):
            return 0
        return length

    def _update_cost_to_go(self, start: int, goal: int, fill: int) -> None:
        """Decide from a whole wave whether the next one can be restricted, and how well."""
        # Overflowing buffers lose cells anywhere, so no cell may be excluded then.
        self._usable = fill <= BUFFER // 2
        if self._remainder.goal != goal:
            return
        excess = self._surplus(start, goal)
        if not self._is_reached(goal) or excess > self._excess + _OUTDATED:
            self._remainder.drop()
        self._excess = excess


def _to_hundredth(share: float) -> float:
    """Round to a hundredth, in single precision like floorf."""
    return float(np.float32(math.floor(np.float32(share * 100.0 + 0.5))) / np.float32(100.0))
