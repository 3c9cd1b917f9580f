"""The wave of :mod:`.propagation` without the cells that lead too far away from the goal.

Its guide is the cost to go: a potential spread backward from the goal, about what remains from a
cell. A cell whose potential and remainder exceed a bound is not looked at. Afterwards
:func:`descent_reads_cut` and :func:`history_reads_cut` follow everything that the path has come
from, and find out whether a cell left out took part in it; the caller then spreads the whole
wave instead.
"""

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
    Bytes,
    States,
    at_edge,
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


@kernel
def queue_if_gaining(
    costs: States,
    gains: Singles,
    m: np.uintp,
    value: np.float32,
    p: np.float32,
    queue: Integers,
    waiting: int,
) -> int:
    """Append a neighbour of potential ``value`` if it gains enough; return how many wait.

    That is hard to foresee: no branches.
    """
    cost = costs[m]
    gaining: bool = value > p + gains[cost]
    queue[np.uintp(waiting)] = m
    costs[m] = cost | (np.uint16(gaining) << np.uint16(8))
    return waiting + gaining


@kernel
def propagate_towards(
    costs: States,
    potentials: Singles,
    gains: Singles,
    ahead: Singles,
    bound: np.float32,
    columns: int,
    start: int,
    goal: int,
    cycles: int,
    buffers: Integers,
    guesses: Singles,
    log: Integers,
    cut: Bytes,
    epoch: int,
) -> tuple[int, int, int, np.float32]:
    """Spread the wave as :func:`propagate` does, but leave out what the bound excludes.

    A cell is left out when threshold plus ``ahead`` exceed ``bound``; ``cut`` is then set to
    ``epoch``. ``log`` takes every cell looked at, in order, and -1 - n for a cell n left out.
    Returns the number of these events, the fill, the cycles used and the threshold at the end.
    It gives up, with a fill of all there is, where a buffer or the log could run over.

    ``guesses`` of shape (3, size) is scratch for what each waiting cell would get at the start of
    a cycle: mostly right, and reckoned without waiting for the cell before, on which the next one
    in line often borders.
    """
    capacity = buffers.shape[1]
    across, along, guess = guesses[0], guesses[1], guesses[2]
    potentials[start] = np.float32(0.0)
    log[0] = start
    events, fill = 1, 0
    a, b, c = 0, 1, 2
    now, later, over = 0, 0, 0
    for cell in (start + 1, start - 1, start - columns, start + columns):
        if 0 <= cell < costs.size and costs[cell] < BLOCKED:
            buffers[a, now] = cell
            now += 1
            costs[cell] |= PENDING
    threshold = np.float32(BLOCKED)
    # Unsigned, so that an index is not looked at for being negative.
    one, line = np.uintp(1), np.uintp(columns)
    used = 0
    # The inner loop is where a plan's time goes. It stays one loop with everything in registers:
    # the order of its events is the result, so it cannot be reordered or vectorised.
    while used < cycles and now > 0:
        if over + 4 * now > capacity or events + now > log.size:
            fill = capacity
            break
        used += 1
        current, following, postponed = buffers[a], buffers[b], buffers[c]
        for i in range(now):
            n = np.uintp(current[i])
            cost = costs[n] & np.uint16(PENDING - 1)
            costs[n] = cost
            x = min(potentials[n - one], potentials[n + one])
            y = min(potentials[n - line], potentials[n + line])
            across[i], along[i] = x, y
            guess[i] = interpolate_potential(x, y, np.float32(cost))
        farthest = bound - threshold
        for i in range(now):
            n = np.uintp(current[i])
            if ahead[n] > farthest:
                cut[n] = epoch
                log[np.uintp(events)] = -1 - current[i]
                events += 1
                continue
            log[np.uintp(events)] = current[i]
            events += 1
            left, right = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            p, x, y = guess[i], min(left, right), min(up, down)
            if x != across[i] or y != along[i]:
                p = interpolate_potential(x, y, np.float32(costs[n] & np.uint16(PENDING - 1)))
            if p >= potentials[n]:
                continue
            potentials[n] = p
            if p < threshold:
                later = queue_if_gaining(costs, gains, n - one, left, p, following, later)
                later = queue_if_gaining(costs, gains, n + one, right, p, following, later)
                later = queue_if_gaining(costs, gains, n - line, up, p, following, later)
                later = queue_if_gaining(costs, gains, n + line, down, p, following, later)
            else:
                over = queue_if_gaining(costs, gains, n - one, left, p, postponed, over)
                over = queue_if_gaining(costs, gains, n + one, right, p, postponed, over)
                over = queue_if_gaining(costs, gains, n - line, up, p, postponed, over)
                over = queue_if_gaining(costs, gains, n + line, down, p, postponed, over)
        a, b = b, a
        fill = max(fill, later, over)
        now, later = later, 0
        if now == 0:
            threshold += np.float32(THRESHOLD_STEP)
            a, c = c, a
            now, over = over, 0
        if potentials[goal] < UNREACHED:
            break
    for i in range(now):
        costs[buffers[a, i]] &= PENDING - 1
    for i in range(over):
        costs[buffers[c, i]] &= PENDING - 1
    return events, fill, used, threshold


@kernel
def descent_reads_cut(
    costs: States,
    potentials: Singles,
    ahead: Singles,
    latest: np.float32,
    columns: int,
    cells: Integers,
    length: int,
    cut: Bytes,
    mark: Bytes,
    epoch: int,
) -> bool:
    """Tell whether the descent of a path of ``length`` points looked at a cell left out.

    Neither may a cell it found unreached be one that could have been reached in time: ``latest``
    is the largest remainder with which a wave through the cells left out comes too late. ``mark``
    is set to ``epoch`` where the descent looked.
    """
    for i in range(length):
        # At the edge of the wave the descent compares eight neighbours; elsewhere it takes the
        # gradients of four cells, which look one further.
        at = cells[i]
        seen = i > 0 and at == cells[i - 1]
        if seen or at <= columns or at >= potentials.size - columns - 1:
            continue
        beyond = 2 if at_edge(potentials, at, columns) else 3
        for r in range(-1, beyond):
            for n in range(at + r * columns - 1, at + r * columns + beyond):
                if n >= potentials.size or mark[n] == epoch:
                    continue
                if cut[n] == epoch:
                    return True
                mark[n] = epoch
                missing = potentials[n] >= UNREACHED and costs[n] < BLOCKED
                if missing and latest < ahead[n] < UNREACHED:
                    return True
    return False


@kernel
def history_reads_cut(columns: int, log: Integers, events: int, mark: Bytes, epoch: int) -> bool:
    """Tell whether a cell left out took part in what the marked cells have gone through.

    Backward through the log: a cell that is needed when it was looked at needs its neighbours
    from then on back, because nothing else can have told it a potential or made it be looked at.
    A cell left out before it was needed for the last time is one too many. ``mark`` is
    ``epoch`` for needed cells and becomes one more when their neighbours are marked.
    """
    one, line = np.uintp(1), np.uintp(columns)
    # The first is the start, which needs nobody and may lie on the border.
    for event in range(events - 1, 0, -1):
        entry = log[event]
        if entry < 0:
            if mark[np.uintp(-1 - entry)] >= epoch:
                return True
            continue
        n = np.uintp(entry)
        if mark[n] == epoch:
            mark[n] = epoch + 1
            mark[n - one] = max(mark[n - one], epoch)
            mark[n + one] = max(mark[n + one], epoch)
            mark[n - line] = max(mark[n - line], epoch)
            mark[n + line] = max(mark[n + line], epoch)
    return False
