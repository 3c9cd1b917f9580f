"""The policy of restricted waves: when to try one, how far it reaches, when it may be believed.

A planner with waves like those of navfn says how its wave spreads and how its path descends
(:class:`GuidedField`); kernels and their reasons are in :mod:`.restricted`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Final

import numpy as np

from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.navfn.propagation import BLOCKED, BUFFER, UNREACHED, reset_potentials
from daemon.stacks.ros1.navfn.restricted import (
    CostToGo,
    clear_doubts,
    descent_is_doubtful,
)

MARGINS: Final = (2000.0, 4000.0, 8000.0, 16_000.0)
"""Detours [cost] that the restricted search looks at, one after the other; 50 is a free cell."""
WORTHWHILE: Final = 12_000
"""Cells of a whole wave from which on a restricted one pays."""
_OUTDATED: Final = 1000.0
"""Detour [cost] by which changed costs may make the way longer before the remainder is renewed."""
_EXTRA_REACH: Final = 2500.0
"""Cost by which the remainder reaches farther than it must."""
_RETRY: Final = 12
"""Plans after which a smaller margin is tried again."""
_SPARE_ENTRIES: Final = 25
"""Of the log: a planner may set the potentials of so many cells after the wave."""


class GuidedField(ABC):
    """Potentials over flat costs of navfn's kind, ``BLOCKED`` or less.

    With ``margins`` the wave is restricted to what can matter, and checked afterwards; without it
    is always whole. ``whole`` and ``restricted`` count the waves that gave an answer.
    """

    def __init__(
        self,
        size: int,
        columns: int,
        *,
        cycles: int,
        margins: tuple[float, ...],
        worthwhile: int,
    ) -> None:
        self.columns, self.size = columns, size
        self.whole, self.restricted = 0, 0
        self._margins, self._worthwhile = margins, worthwhile
        self._cycles = cycles
        self._costs = np.full(size, BLOCKED, dtype=np.uint16)
        self._potentials = np.full(size, UNREACHED, dtype=np.float32)
        self._flags = self._costs
        """Where a wave flags the cells that are doubtful."""
        self._log = np.empty(size + 1 + _SPARE_ENTRIES, dtype=np.int32)
        self._doubtful = np.empty(size, dtype=np.int32)
        self._count, self._doubts = 0, 0
        self._cells: Integers = np.empty(0, dtype=np.int32)
        self._level, self._steady = 0, 0
        self._remainder = CostToGo(size, columns)
        self._excess, self._usable = 0.0, False
        self._repeated = False

    @abstractmethod
    def _spread(self, start: int, goal: int) -> int:
        """Spread the whole wave; return the largest number of cells that waited in a buffer."""

    @abstractmethod
    def _spread_towards(
        self, start: int, goal: int, bound: np.float32
    ) -> tuple[int, int, np.float32]:
        """Spread the wave without what the bound excludes; return fill, cycles and threshold.

        ``_doubts`` is how many of ``_doubtful`` were flagged.
        """

    @abstractmethod
    def _descend(self, start: int, goal: int) -> int:
        """Write the path, and into ``_cells`` where it was reckoned; return its length or 0."""

    def _begins_at(self, start: int, goal: int) -> bool:
        """Tell whether a goal has a potential before the wave spreads."""
        return start == goal

    def _remaining(self, start: int) -> float:
        """Return what remains from the start; unreached only if no way leads on."""
        return self._remainder.at(start)

    def _goal_is_doubtful(self, goal: int, latest: float) -> bool:
        """Tell whether what the descent reads before its first point is doubtful."""
        return False

    def reached(self, cell: int) -> bool:
        """Tell whether the wave reached a cell."""
        return bool(self._potentials[cell] < UNREACHED)

    def _search(self, start: int, goal: int) -> int:
        if not self._begins_at(start, goal) and self._costs[goal] >= BLOCKED:
            return 0
        # The restricted search needs a cost to go, which pays from the second plan to a goal on.
        if self._margins and self._prepare_cost_to_go(start, goal):
            if self._is_unreachable(start, goal):
                return 0
            length = self._search_restricted(start, goal)
            if length > 0:
                return length
        fill = self._spread(start, goal)
        length = self._descend(start, goal) if self.reached(goal) else 0
        self._update_cost_to_go(start, goal, fill)
        return length

    def _prepare_cost_to_go(self, start: int, goal: int) -> bool:
        """Tell whether the remainder is there for this goal, after making it if that pays."""
        if self._begins_at(start, goal) or not self._repeated:
            return False
        if self._remainder.goal != goal and self._usable and self._count >= self._worthwhile:
            reach = float(self._potentials[goal]) + self._margins[0] + _EXTRA_REACH
            self._usable = self._remainder.renew(self._costs, goal, reach)
            self._excess = self._surplus(start, goal)
        return self._remainder.goal == goal

    def _is_unreachable(self, start: int, goal: int) -> bool:
        """Tell whether the goal is certain to be out of reach."""
        remainder = self._remainder
        if self._remaining(start) < UNREACHED:
            return False
        if remainder.whole:
            return True
        renewed = remainder.renew(self._costs, goal, float(UNREACHED))
        return renewed and self._remaining(start) >= float(UNREACHED)

    def _bound(self, start: int, goal: int, margin: float) -> float:
        """Return what the way through a cell may cost; the remainder is made to reach as far."""
        bound = self._remaining(start) + self._excess + margin
        if bound > self._remainder.limit:
            self._usable = self._remainder.renew(self._costs, goal, bound + _EXTRA_REACH)
        return bound

    def _surplus(self, start: int, goal: int) -> float:
        """Return by how much the last wave took longer than the remainder says."""
        spent, remaining = float(self._potentials[goal]), self._remaining(start)
        return max(0.0, spent - remaining) if max(spent, remaining) < UNREACHED else 0.0

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
        """Return the length of the path, 0 when it is not certain to be that of the whole wave."""
        bound = np.float32(self._bound(start, goal, margin))
        if self._remainder.goal != goal:
            return 0
        reset_potentials(self._potentials, self._log, self._count)
        fill, used, threshold = self._spread_towards(start, goal, bound)
        # A wave that passed through what was left out is later than the bound at the goal.
        spare = bound - threshold - margin / 4.0
        length = 0
        # What is left out takes room in the buffers and cycles too: keep well off both limits.
        within = fill <= BUFFER // 2 and used <= self._cycles // 4
        if self.reached(goal) and spare >= margin / 4.0 and within:
            length = self._certain_descent(start, goal, float(spare))
        clear_doubts(self._flags, self._doubtful, self._doubts)
        if length > 0:
            self._excess = self._surplus(start, goal)
            self._remainder.limit = min(self._remainder.limit, float(bound) + _EXTRA_REACH)
        return length

    def _certain_descent(self, start: int, goal: int, spare: float) -> int:
        """Descend from the goal; return 0 if anything on the way is doubtful."""
        if self._goal_is_doubtful(goal, spare):
            return 0
        length = self._descend(start, goal)
        if length == 0 or descent_is_doubtful(
            self._flags, self._costs, self._potentials, self._remainder.ahead, np.float32(spare),
            self.columns, self._cells, length,
        ):  # fmt: skip
            return 0
        return length

    def _update_cost_to_go(self, start: int, goal: int, fill: int) -> None:
        """Find out from a whole wave whether the next one can be guided, and how well."""
        # Buffers that run over lose cells anywhere: then nothing may be left out.
        self._usable = fill <= BUFFER // 2
        if self._remainder.goal != goal:
            return
        excess = self._surplus(start, goal)
        if not self.reached(goal) or excess > self._excess + _OUTDATED:
            self._remainder.drop()
        self._excess = excess
