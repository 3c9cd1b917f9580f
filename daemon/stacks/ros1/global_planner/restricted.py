"""The wave of :mod:`.expansion` without the cells that lead too far away from the goal.

As in :mod:`daemon.stacks.ros1.navfn.restricted`, whose remainder guides it and whose flags tell
which cells the ones left out may have changed.
"""

from __future__ import annotations

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.global_planner.expansion import (
    THRESHOLD_STEP,
    VALUE,
    States,
)
from daemon.stacks.ros1.navfn.propagation import BLOCKED, DOUBTFUL, UNREACHED, interpolate_potential
from daemon.stacks.ros1.navfn.restricted import queue_if_gaining


@kernel
def propagate_towards(
    states: States,
    potentials: Singles,
    costs: Singles,
    gains: Singles,
    ahead: Singles,
    bound: np.float32,
    lethal: int,
    columns: int,
    goal: int,
    cycles: int,
    buffers: Integers,
    waiting: int,
    reached: Integers,
    count: int,
    doubtful: Integers,
) -> tuple[int, int, int, int, np.float32]:
    """Spread the quadratic wave, but leave out what the bound excludes; no cost may be 0.

    A cell is left out when threshold plus ``ahead`` exceed ``bound``; it is flagged ``DOUBTFUL``
    then, as is each cell looked at beside a doubtful one, and stands in ``doubtful``. ``count``
    cells in ``reached`` have a potential already. Returns how many have one in the end, how many
    are doubtful, the fill, the cycles used and the threshold at the end. It gives up, with a fill
    of all there is, where a buffer could run over, or where the wave would start in an area that
    has no way to the goal: the four cells at the start may lie between several, and the checks
    know of one.
    """
    capacity = buffers.shape[1]
    queue = buffers.reshape(-1)
    ends = np.empty(2, dtype=np.int64)
    a, b, c = 0, 1, 2
    now, later, over, doubts, fill = waiting, 0, 0, 0, 0
    threshold = np.float32(lethal)
    # Unsigned, so that an index is not looked at for being negative.
    one, line = np.uintp(1), np.uintp(columns)
    flag, settled = np.uint16(DOUBTFUL), np.uint16(VALUE | DOUBTFUL)
    used = 0
    for i in range(waiting):
        if ahead[buffers[a, i]] >= UNREACHED:
            fill, cycles = capacity, 0
    # One loop with everything in registers: the order of its events is the result.
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
def goal_is_doubtful(
    states: States,
    costs: States,
    potentials: Singles,
    ahead: Singles,
    latest: np.float32,
    columns: int,
    goal: int,
) -> bool:
    """Tell whether what the potentials around the goal are filled from is doubtful.

    Neither may a cell there that was not reached be one that a wave through the cells left out
    could have reached: its remainder is above ``latest``.
    """
    for row in range(-3, 4):
        for n in range(goal + row * columns - 3, goal + row * columns + 4):
            if states[n] >= DOUBTFUL:
                return True
            missing = potentials[n] >= UNREACHED and costs[n] < BLOCKED
            if missing and latest < ahead[n] < UNREACHED:
                return True
    return False
