"""Wave of :mod:`.propagation` without the cells that lead too far away from the goal.

Its guide is the cost to go, a potential spread backward from the goal: the approximate remaining
cost of a cell. A cell whose potential and remainder exceed a bound is excluded, and doubtful from
then on. Every cell visited after a doubtful neighbour is doubtful too, because only neighbours pass
on potentials and visits. If the descent of a path reads a doubtful cell
(:func:`descent_is_doubtful`), the caller discards the path and spreads the whole wave.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import Window
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
    cell_costs,
    interpolate_potential,
    new_wave,
    propagate_wave,
    seed_cell,
)

COST_CAP: Final = 80
"""Upper limit of costs: the wave crosses one cell per block, even if it costs more."""
_NO_GOAL: Final = -1


@kernel
def relax_lowered_costs(wave: Wave, states: States, window: Window, limit: np.float32) -> bool:
    """Lower states and potentials of ``wave`` where ``states`` of a window cost less than before.

    This is a plain relaxation with a ring of waiting cells, until no cell gains enough for the
    wave. Tells whether it skipped a value above ``limit``.
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
    """A potential spread backward from one goal over capped costs, up to a limit.

    It stays a lower bound while ``states`` change, within the accuracy of the interpolation,
    because costs only lower it. ``renew`` starts again.
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
        """Values beyond this are missing or too high."""
        self.whole = False
        """All ways to the goal are covered, so unreached cells have none."""

    def renew(self, goal: int, limit: float) -> bool:
        """Spread it over the present costs; return whether it is usable (no buffer overflowed)."""
        self.goal, self.limit = goal, limit
        np.copyto(self._wave.states, self._states)
        self.ahead[:] = UNREACHED
        # Cells that wait beyond the threshold may still lower it, so add two blocks.
        _, fill, ended = propagate_wave(
            self._wave, _NO_GOAL, np.float32(BLOCKED), self.ahead.size,
            np.float32(limit + 2.0 * THRESHOLD_STEP), seed_cell(self._wave, goal), 1,
        )  # fmt: skip
        self.whole = bool(ended)
        if fill >= BUFFER:
            self.drop()
        return self.goal == goal

    def follow(self, window: Window) -> None:
        """Follow the changed costs of a window."""
        if self.goal != _NO_GOAL and window[0] < window[2]:
            beyond = relax_lowered_costs(self._wave, self._states, window, np.float32(self.limit))
            self.whole = self.whole and not beyond

    def at(self, start: int) -> float:
        """Return the remaining cost from a cell, which may be blocked; unreached without a way.

        A bound that is too low still connects: if this is unreached and ``whole``, there is no
        path.
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
    """Append a neighbour of potential ``value`` if it gains enough; return the end of the queue.

    Without branches, because the outcome is hard to predict.
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
    """Spread the wave as :func:`propagate_wave` does, but exclude cells beyond the bound.

    A cell is excluded if threshold plus ``ahead`` exceed ``bound``. It is flagged ``DOUBTFUL``, and
    so is each cell visited beside a doubtful one. ``doubtful`` lists the flagged cells for
    :func:`clear_doubts`. Returns the numbers of reached and of doubtful cells, the fill, the number
    of cycles and the final threshold. If a buffer could overflow, it stops with a full fill.
    """
    states, potentials, reached = wave.states, wave.potentials, wave.reached
    costs, gains, buffers = wave.costs, wave.gains, wave.buffers
    capacity = buffers.shape[1]
    queue = buffers.reshape(-1)
    # Ends of the queues: of later blocks, and of this block.
    ends = np.empty(2, dtype=np.int64)
    a, b, c = 0, 1, 2
    now, later, over, doubts, fill = waiting, 0, 0, 0, 0
    # Unsigned indices need no check for negative values.
    one, line = np.uintp(1), np.uintp(wave.columns)
    flag, settled = np.uint16(DOUBTFUL), np.uint16(VALUE | DOUBTFUL)
    used = 0
    # The inner loop takes most of a plan's time. It stays one loop with everything in registers:
    # the order of its events decides the result, so it cannot be reordered or vectorised.
    while used < cycles and now > 0:
        if over + 4 * now > capacity:
            fill = capacity
            break
        used += 1
        current, farthest = buffers[a], bound - threshold
        for i in range(now):
            states[np.uintp(current[i])] &= settled
        ends[0], ends[1] = c * capacity + over, b * capacity
        # The potential of the next cell is computed in advance, without waiting for the current
        # cell. The two are often neighbours, but the guess is mostly right.
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
            on_west, on_east = states[n - one], states[n + one]
            above, below = states[n - line], states[n + line]
            if (on_west | on_east | above | below) & flag > state:
                states[n] = state | flag
                doubtful[doubts] = n
                doubts += 1
            west, east = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            u, v = min(west, east), min(up, down)
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
            end = queue_if_gaining(states, gains, n - one, on_west, west, p, queue, end)
            end = queue_if_gaining(states, gains, n + one, on_east, east, p, queue, end)
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
    """Clear the flag ``DOUBTFUL`` of the first ``count`` cells of ``doubtful``."""
    for i in range(count):
        states[np.uintp(doubtful[i])] &= np.uint16(VALUE)


@kernel
def any_is_doubtful(wave: Wave, ahead: Singles, latest: np.float32, corner: int, side: int) -> bool:
    """Tell whether any cell of a square is doubtful; its lowest left cell is ``corner``.

    An unreached cell is doubtful, too, if a wave could have reached it in time. With a remainder
    of ``latest`` or less, a wave through excluded cells comes too late.
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
    """Tell whether the descent of a path of ``length`` points read a doubtful cell."""
    for i in range(length):
        # At the edge of the wave the descent compares eight neighbours. Elsewhere it uses the
        # gradients of four cells, which reach one cell further.
        if i > 0 and cells[i] == cells[i - 1]:
            continue
        corner = cells[i] - wave.columns - 1
        side = 3 if at_edge(wave.potentials, corner, wave.columns) else 4
        if any_is_doubtful(wave, ahead, latest, corner, side):
            return True
    return False
