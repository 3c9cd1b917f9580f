"""The wave of :mod:`.propagation` without the cells that lead too far away from the goal.

Its guide is the cost to go: a potential spread backward from the goal, about what remains from a
cell. A cell whose potential and remainder exceed a bound is not looked at, and is doubtful from
then on. So is every cell that is looked at later than a doubtful neighbour: nothing but neighbours
can tell a cell a potential or make it be looked at. A path whose descent looks at a doubtful cell
(:func:`descent_is_doubtful`) is not believed; the caller then spreads the whole wave instead.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.navfn.descent import at_edge
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    BUFFER,
    DOUBTFUL,
    PENDING,
    SPARE_ROWS,
    THRESHOLD_STEP,
    UNREACHED,
    VALUE,
    CellCosts,
    States,
    Wave,
    Window,
    cell_costs,
    interpolate_potential,
    new_wave,
    propagate_wave,
    seed_cell,
)

COST_CAP: Final = 80
"""Costs count no more than this: the wave crosses one cell per block, whatever that costs."""
_NO_GOAL: Final = -1


@kernel
def relax_lowered_costs(wave: Wave, states: States, window: Window, limit: np.float32) -> bool:
    """Lower states and potentials of ``wave`` where ``states`` of a window cost less than ever.

    A plain relaxation with a ring of waiting cells, until nothing improves by more than the wave
    would care for. Tells whether a value above ``limit`` was left out.
    """
    floor, ahead, queue, columns = wave.states, wave.potentials, wave.reached, wave.columns
    costs, gains = wave.costs, wave.gains
    beyond = False
    head, waiting = 0, 0
    rows = floor.size // columns - 2 * SPARE_ROWS
    for row in range(max(window[1], 0), min(window[3], rows)):
        for column in range(max(window[0], 0), min(window[2], columns)):
            n = (SPARE_ROWS + row) * columns + column
            if costs[states[n]] < costs[floor[n]]:
                floor[n] = states[n] | np.uint16(PENDING)
                queue[waiting] = n
                waiting += 1
    while waiting > 0:
        n = queue[head]
        head = (head + 1) % queue.size
        waiting -= 1
        floor[n] &= np.uint16(VALUE)
        across, along = min(ahead[n - 1], ahead[n + 1]), min(ahead[n - columns], ahead[n + columns])
        if min(across, along) >= UNREACHED:
            continue
        p = interpolate_potential(across, along, costs[floor[n]])
        if p >= ahead[n]:
            continue
        if p > limit:
            beyond = True
            continue
        ahead[n] = p
        for m in (n - 1, n + 1, n - columns, n + columns):
            if ahead[m] > p + gains[floor[m]]:
                floor[m] |= np.uint16(PENDING)
                queue[(head + waiting) % queue.size] = m
                waiting += 1
    return beyond


class CostToGo:
    """A potential spread backward from one goal over capped costs, as far as a limit.

    It stays a lower bound, but for the grain of the interpolation, while ``states`` change: costs
    only ever lower it. ``renew`` starts afresh.
    """

    def __init__(self, wave: Wave, costs: CellCosts) -> None:
        """Guide ``wave``, which spreads over these costs."""
        blocked = np.isinf(costs.gains[:PENDING])
        capped = cell_costs(costs.states, np.minimum(costs.costs, COST_CAP), blocked)
        self._states = wave.states
        self._wave = new_wave(capped, wave.states.size, wave.columns)
        self.ahead = self._wave.potentials
        self.goal = _NO_GOAL
        self.limit = 0.0
        """From here on values are missing or too high."""
        self.whole = False
        """Whether no way to the goal was left out: then what is unreached has none."""

    def renew(self, goal: int, limit: float) -> bool:
        """Spread it over the costs as they are; it is of no use when a buffer ran over."""
        self.goal, self.limit = goal, limit
        np.copyto(self._wave.states, self._states)
        self.ahead[:] = UNREACHED
        # What waits beyond the threshold when a block is done may still lower it: two blocks more.
        _, fill, ended = propagate_wave(
            self._wave, _NO_GOAL, np.float32(BLOCKED), self.ahead.size,
            np.float32(limit + 2.0 * THRESHOLD_STEP), seed_cell(self._wave, goal), 1,
        )  # fmt: skip
        self.whole = bool(ended)
        if fill >= BUFFER:
            self.drop()
        return self.goal == goal

    def follow(self, window: Window) -> None:
        """Take in the costs that changed inside a window."""
        if self.goal != _NO_GOAL and window[0] < window[2]:
            beyond = relax_lowered_costs(self._wave, self._states, window, np.float32(self.limit))
            self.whole = self.whole and not beyond

    def at(self, start: int) -> float:
        """Return what remains from a cell that may itself be blocked; unreached if no way leads.

        Too low a bound still connects: where this is unreached and ``whole``, there is no path.
        """
        line = self._wave.columns
        around = (start, start - 1, start + 1, start - line, start + line)
        return min([float(self.ahead.item(n)) for n in around])

    def drop(self) -> None:
        """Forget the goal."""
        self.goal = _NO_GOAL


@kernel
def queue_if_gaining(
    states: States,
    gains: Singles,
    m: np.uintp,
    state: np.uint16,
    value: np.float32,
    p: np.float32,
    queue: Integers,
    end: int,
) -> int:
    """Append a neighbour of potential ``value`` if it gains enough; return where the queue ends.

    That is hard to foresee: no branches.
    """
    gaining: bool = value > p + gains[state]
    queue[np.uintp(end)] = m
    states[m] = state | (np.uint16(gaining) << np.uint16(8))
    return end + gaining


@kernel
def spread_towards(
    wave: Wave,
    ahead: Singles,
    bound: np.float32,
    threshold: np.float32,
    goal: int,
    cycles: int,
    waiting: int,
    count: int,
    doubtful: Integers,
) -> tuple[int, int, int, int, np.float32]:
    """Spread the wave as :func:`propagate_wave` does, but leave out what the bound excludes.

    A cell is left out when threshold plus ``ahead`` exceed ``bound``, and is flagged ``DOUBTFUL``;
    so is each cell looked at beside a doubtful one. The cells flagged stand in ``doubtful``, for
    :func:`clear_doubts`. Returns how many cells were reached, how many are doubtful, the fill, the
    cycles used and the threshold at the end. It gives up, with a fill of all there is, where a
    buffer could run over.
    """
    states, potentials, reached = wave.states, wave.potentials, wave.reached
    costs, gains, buffers = wave.costs, wave.gains, wave.buffers
    capacity = buffers.shape[1]
    queue = buffers.reshape(-1)
    # Where the next cell goes: behind those of later blocks, and behind those of this one.
    ends = np.empty(2, dtype=np.int64)
    a, b, c = 0, 1, 2
    now, later, over, doubts, fill = waiting, 0, 0, 0, 0
    # Unsigned, so that an index is not looked at for being negative.
    one, line = np.uintp(1), np.uintp(wave.columns)
    flag, settled = np.uint16(DOUBTFUL), np.uint16(VALUE | DOUBTFUL)
    used = 0
    # The inner loop is where a plan's time goes. It stays one loop with everything in registers:
    # the order of its events is the result, so it cannot be reordered or vectorised.
    while used < cycles and now > 0:
        if over + 4 * now > capacity:
            fill = capacity
            break
        used += 1
        current, farthest = buffers[a], bound - threshold
        for i in range(now):
            states[np.uintp(current[i])] &= settled
        ends[0], ends[1] = c * capacity + over, b * capacity
        # What a cell would get is reckoned while the cell before it is still looked at: mostly
        # right, and without waiting for that one, on which it often borders.
        current[now] = current[0]
        m = np.uintp(current[0])
        across, along = (
            min(potentials[m - one], potentials[m + one]),
            min(potentials[m - line], potentials[m + line]),
        )
        cost = costs[states[m] & np.uint16(VALUE)]
        guess = interpolate_potential(across, along, cost)
        for i in range(now):
            n, x, y, dear, p = m, across, along, cost, guess
            m = np.uintp(current[i + 1])
            across = min(potentials[m - one], potentials[m + one])
            along = min(potentials[m - line], potentials[m + line])
            cost = costs[states[m] & np.uint16(VALUE)]
            guess = interpolate_potential(across, along, cost)
            state = states[n]
            if ahead[n] > farthest:
                if state < flag:
                    states[n] = state | flag
                    doubtful[doubts] = n
                    doubts += 1
                continue
            on_left, on_right = states[n - one], states[n + one]
            above, below = states[n - line], states[n + line]
            if (on_left | on_right | above | below) & flag > state:
                states[n] = state | flag
                doubtful[doubts] = n
                doubts += 1
            left, right = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            u, v = min(left, right), min(up, down)
            if u != x or v != y:
                p = interpolate_potential(u, v, dear)
            old = potentials[n]
            if p >= old:
                continue
            potentials[n] = p
            reached[np.uintp(count)] = n
            count += old >= UNREACHED
            soon = np.uintp(p < threshold)
            end = ends[soon]
            end = queue_if_gaining(states, gains, n - one, on_left, left, p, queue, end)
            end = queue_if_gaining(states, gains, n + one, on_right, right, p, queue, end)
            end = queue_if_gaining(states, gains, n - line, above, up, p, queue, end)
            end = queue_if_gaining(states, gains, n + line, below, down, p, queue, end)
            ends[soon] = end
        over, later = ends[0] - c * capacity, ends[1] - b * capacity
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
        states[buffers[a, i]] &= settled
    for i in range(over):
        states[buffers[c, i]] &= settled
    return count, doubts, fill, used, threshold


@kernel
def clear_doubts(states: States, doubtful: Integers, count: int) -> None:
    """Take the flag ``DOUBTFUL`` from the first ``count`` cells of ``doubtful``."""
    for i in range(count):
        states[np.uintp(doubtful[i])] &= np.uint16(VALUE)


@kernel
def any_is_doubtful(wave: Wave, ahead: Singles, latest: np.float32, corner: int, side: int) -> bool:
    """Tell whether any cell of a square is doubtful; its lowest left cell is ``corner``.

    Doubtful is also a cell not reached that could have been reached in time. With a remainder of
    ``latest`` or less, a wave through the cells left out comes too late.
    """
    states, potentials = wave.states, wave.potentials
    for row in range(side):
        for n in range(corner + row * wave.columns, corner + row * wave.columns + side):
            if states[n] >= DOUBTFUL:
                return True
            missing = potentials[n] >= UNREACHED and wave.gains[states[n]] < np.inf
            if missing and latest < ahead[n] < UNREACHED:
                return True
    return False


@kernel
def descent_is_doubtful(
    wave: Wave, ahead: Singles, latest: np.float32, cells: Integers, length: int
) -> bool:
    """Tell whether the descent of a path of ``length`` points looked at a doubtful cell."""
    for i in range(length):
        # At the edge of the wave the descent compares eight neighbours; elsewhere it takes the
        # gradients of four cells, which look one further.
        if i > 0 and cells[i] == cells[i - 1]:
            continue
        corner = cells[i] - wave.columns - 1
        side = 3 if at_edge(wave.potentials, corner, wave.columns) else 4
        if any_is_doubtful(wave, ahead, latest, corner, side):
            return True
    return False
