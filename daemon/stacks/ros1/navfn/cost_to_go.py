"""The cost to go from every cell to the goal: the guide of the restricted search."""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    BUFFER,
    GAINS,
    PENDING,
    THRESHOLD_STEP,
    UNREACHED,
    States,
    interpolate_potential,
    propagate_wave,
)

COST_CAP: Final = 80
"""Costs count no more than this: the wave crosses one cell per block, whatever that costs."""
_NO_GOAL: Final = -1


@kernel
def relax_lowered_costs(
    costs: States,
    floor: States,
    cap: int,
    ahead: Singles,
    gains: Singles,
    columns: int,
    window: tuple[int, int, int, int],
    limit: np.float32,
    queue: Integers,
) -> bool:
    """Lower ``floor`` and ``ahead`` where the costs of a window became lower than ever.

    A plain relaxation with a ring of waiting cells, until nothing improves by more than the wave
    would care for. Tells whether a value above ``limit`` was left out.
    """
    beyond = False
    rows = costs.size // columns
    head, waiting = 0, 0
    for row in range(max(window[1], 1), min(window[3], rows - 1)):
        for column in range(max(window[0], 1), min(window[2], columns - 1)):
            n = row * columns + column
            cost = costs[n] if costs[n] >= BLOCKED else min(costs[n], cap)
            if cost < floor[n]:
                floor[n] = cost | PENDING
                queue[waiting] = n
                waiting += 1
    while waiting > 0:
        n = queue[head]
        head = (head + 1) % queue.size
        waiting -= 1
        floor[n] &= PENDING - 1
        across, along = min(ahead[n - 1], ahead[n + 1]), min(ahead[n - columns], ahead[n + columns])
        if min(across, along) >= UNREACHED:
            continue
        p = interpolate_potential(across, along, np.float32(floor[n]))
        if p >= ahead[n]:
            continue
        if p > limit:
            beyond = True
            continue
        ahead[n] = p
        for m in (n - 1, n + 1, n - columns, n + columns):
            if floor[m] < BLOCKED and ahead[m] > p + gains[floor[m]]:
                floor[m] |= PENDING
                queue[(head + waiting) % queue.size] = m
                waiting += 1
    return beyond


class CostToGo:
    """A potential spread backward from one goal over capped costs, as far as a limit.

    It stays a lower bound, but for the grain of the interpolation, while costs change: they only
    ever lower it. ``renew`` starts afresh.
    """

    def __init__(self, size: int, columns: int) -> None:
        self.ahead = np.full(size, UNREACHED, dtype=np.float32)
        self.goal = _NO_GOAL
        self.limit = 0.0
        """From here on values are missing or too high."""
        self.whole = False
        """Whether no way to the goal was left out: then what is unreached has none."""
        self._columns = columns
        self._floor = np.empty(size, dtype=np.uint16)
        self._buffers = np.empty((3, BUFFER), dtype=np.int32)
        self._queue = np.empty(size + 1, dtype=np.int32)

    def renew(self, costs: States, goal: int, limit: float) -> bool:
        """Spread it over the costs as they are; it is of no use when a buffer ran over."""
        self.goal, self.limit = goal, limit
        self._floor[:] = np.where(costs < BLOCKED, np.minimum(costs, COST_CAP), BLOCKED)
        self.ahead[:] = UNREACHED
        # What waits beyond the threshold when a block is done may still lower it: two blocks more.
        _, fill, ended = propagate_wave(
            self._floor, self.ahead, GAINS, self._columns, goal, _NO_GOAL, costs.size,
            np.float32(limit + 2.0 * THRESHOLD_STEP), self._buffers, self._queue,
        )  # fmt: skip
        self.whole = bool(ended)
        if fill >= BUFFER:
            self.drop()
        return self.goal == goal

    def follow(self, costs: States, window: tuple[int, int, int, int]) -> None:
        """Take in the costs that changed inside a half-open window."""
        if self.goal != _NO_GOAL and window[0] < window[2]:
            beyond = relax_lowered_costs(
                costs, self._floor, COST_CAP, self.ahead, GAINS, self._columns, window,
                np.float32(self.limit), self._queue,
            )  # fmt: skip
            self.whole = self.whole and not beyond

    def at(self, start: int) -> float:
        """Return what remains from a cell that may itself be blocked; unreached if no way leads.

        Too low a bound still connects: where this is unreached and ``whole``, there is no path.
        """
        around = (start, start - 1, start + 1, start - self._columns, start + self._columns)
        return min(float(self.ahead[n]) for n in around if 0 <= n < self.ahead.size)

    def drop(self) -> None:
        """Forget the goal."""
        self.goal = _NO_GOAL
