"""What remains to the goal from every cell: the guide of the restricted search."""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.navigation.kernels import Integers, Singles, kernel
from daemon.navigation.ros.navfn._costs import BLOCKED, PENDING, UNREACHED, States
from daemon.navigation.ros.navfn._propagation import BUFFER, GAINS, interpolated, propagate

CAP: Final = 80
"""Costs count no more than this: the wave crosses one cell per block, whatever that costs."""
_NO_GOAL: Final = -1


@kernel
def _ease(
    costs: States,
    floor: States,
    cap: int,
    ahead: Singles,
    gains: Singles,
    columns: int,
    window: tuple[int, int, int, int],
    queue: Integers,
) -> None:
    """Lower ``floor`` and ``ahead`` where the costs of a window became lower than ever.

    A plain relaxation with a ring of waiting cells, until nothing improves by more than the wave
    would care for.
    """
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
        p = interpolated(across, along, np.float32(floor[n]))
        if p >= ahead[n]:
            continue
        ahead[n] = p
        for m in (n - 1, n + 1, n - columns, n + columns):
            if floor[m] < BLOCKED and ahead[m] > p + gains[floor[m]]:
                floor[m] |= PENDING
                queue[(head + waiting) % queue.size] = m
                waiting += 1


class Remainder:
    """A potential spread backward from one goal over capped costs.

    It stays a lower bound, but for the grain of the interpolation, while costs change: they only
    ever lower it. ``renew`` starts afresh.
    """

    def __init__(self, size: int, columns: int) -> None:
        self.ahead = np.full(size, UNREACHED, dtype=np.float32)
        self.goal = _NO_GOAL
        self._columns = columns
        self._floor = np.empty(size, dtype=np.uint16)
        self._buffers = np.empty((3, BUFFER), dtype=np.int32)
        self._queue = np.empty(size + 1, dtype=np.int32)

    def renew(self, costs: States, goal: int) -> None:
        """Spread it over the costs as they are."""
        self.goal = goal
        self._floor[:] = np.where(costs < BLOCKED, np.minimum(costs, CAP), BLOCKED)
        self.ahead[:] = UNREACHED
        propagate(
            self._floor, self.ahead, GAINS, self._columns, goal, _NO_GOAL, costs.size,
            self._buffers, self._queue,
        )  # fmt: skip

    def follow(self, costs: States, window: tuple[int, int, int, int]) -> None:
        """Take in the costs that changed inside a half-open window."""
        if self.goal != _NO_GOAL and window[0] < window[2]:
            _ease(
                costs, self._floor, CAP, self.ahead, GAINS, self._columns, window, self._queue
            )  # fmt: skip

    def at(self, start: int) -> float:
        """Return what remains from a cell that may itself be blocked; unreached if no way leads.

        Too low a bound still connects: where this is unreached there is no path.
        """
        around = (start, start - 1, start + 1, start - self._columns, start + self._columns)
        return min(float(self.ahead[n]) for n in around if 0 <= n < self.ahead.size)

    def drop(self) -> None:
        """Forget the goal."""
        self.goal = _NO_GOAL
