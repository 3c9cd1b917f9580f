"""The wave of :mod:`_propagation` without the cells that lead too far away from the goal.

``ahead`` is a potential spread backward from the goal: about what remains from a cell. A cell
whose potential and remainder exceed a bound is not looked at. Afterwards :func:`depends_on_cut`
follows everything that the path can have come from, and finds out whether a cell left out took
part in it; the caller then spreads the whole wave instead.
"""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import Integers, Singles, kernel
from daemon.navigation.ros.navfn._costs import BLOCKED, PENDING, UNREACHED, States
from daemon.navigation.ros.navfn._descent import at_edge
from daemon.navigation.ros.navfn._propagation import THRESHOLD_STEP, interpolated


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
    reached: Integers,
    history: bool,
    first: Integers,
    last: Integers,
    cut: Integers,
    epoch: int,
) -> tuple[int, int, int, np.float32]:
    """Spread the wave as :func:`propagate` does, but leave out what the bound excludes.

    A cell is left out when threshold plus ``ahead`` exceed ``bound``; ``cut`` is then set to
    ``epoch``. Returns how many cells were reached, the fill, the cycles used and the threshold at
    the end. It gives up, with a fill of all there is, where a buffer could run over.

    With ``history``, ``first`` and ``last`` tell for every reached cell the number of the update
    that reached it and of the last one that looked at it. ``guesses`` of shape (3, size) is
    scratch for what each waiting cell would get at the start of a cycle: mostly right, and
    reckoned without waiting for the cell before, on which the next one in line often borders.
    """
    capacity = buffers.shape[1]
    across, along, guess = guesses[0], guesses[1], guesses[2]
    potentials[start] = np.float32(0.0)
    reached[0] = start
    first[start], last[start] = 0, 0
    count, moment, fill = 1, 0, 0
    a, b, c = 0, 1, 2
    now, later, over = 0, 0, 0
    for cell in (start + 1, start - 1, start - columns, start + columns):
        if 0 <= cell < costs.size and costs[cell] < BLOCKED:
            buffers[a, now] = cell
            now += 1
            costs[cell] |= PENDING
    threshold = np.float32(BLOCKED)
    # Unsigned, so that an index is not looked at for being negative.
    one, line, flag = np.uintp(1), np.uintp(columns), np.uint16(8)
    used = 0
    while used < cycles and now > 0:
        if over + 4 * now > capacity:
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
            guess[i] = interpolated(x, y, np.float32(cost))
        farthest = bound - threshold
        for i in range(now):
            n = np.uintp(current[i])
            if ahead[n] > farthest:
                cut[n] = epoch
                continue
            left, right = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            p, x, y = guess[i], min(left, right), min(up, down)
            if x != across[i] or y != along[i]:
                p = interpolated(x, y, np.float32(costs[n] & np.uint16(PENDING - 1)))
            old = potentials[n]
            if history:
                moment += 1
                last[n] = moment
                if old == UNREACHED:
                    first[n] = moment
            if p >= old:
                continue
            reached[count] = n
            count += old == UNREACHED
            potentials[n] = p
            beside = (n - one, left), (n + one, right), (n - line, up), (n + line, down)
            # Whether a neighbour gains enough is hard to foresee: no branches.
            if p < threshold:
                for m, value in beside:
                    cost = costs[m]
                    gaining = value > p + gains[cost]
                    following[later] = m
                    later += gaining
                    costs[m] = cost | (np.uint16(gaining) << flag)
            else:
                for m, value in beside:
                    cost = costs[m]
                    gaining = value > p + gains[cost]
                    postponed[over] = m
                    over += gaining
                    costs[m] = cost | (np.uint16(gaining) << flag)
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
    return count, fill, used, threshold


@kernel
def depends_on_cut(
    costs: States,
    potentials: Singles,
    ahead: Singles,
    latest: np.float32,
    columns: int,
    cells: Integers,
    length: int,
    first: Integers,
    last: Integers,
    cut: Integers,
    mark: Integers,
    epoch: int,
    stack: Integers,
    history: bool,
) -> bool:
    """Tell whether a cell left out has a neighbour in the history of a path of ``length`` points.

    The history holds the cells the descent looked at and, for each of its cells, every neighbour
    that had been reached before that cell was looked at for the last time. Nothing else can have
    told a cell of the history a potential or made it be looked at. A cell the descent found
    unreached must be one that nothing can have reached in time: ``latest`` is the largest
    remainder with which a wave through the cells left out comes too late. Without ``history``
    only the cells the descent looked at are judged.
    """
    count = 0
    for i in range(length):
        # At the edge of the wave the descent compares eight neighbours; elsewhere it takes the
        # gradients of four cells, which look one further.
        at = cells[i]
        if at <= columns or at >= potentials.size - columns - 1:
            continue
        beyond = 2 if at_edge(potentials, at, columns) else 3
        for r in range(-1, beyond):
            for n in range(at + r * columns - 1, at + r * columns + beyond):
                if n >= potentials.size or mark[n] == epoch:
                    continue
                if cut[n] == epoch:
                    return True
                if potentials[n] >= UNREACHED:
                    if costs[n] < BLOCKED and latest < ahead[n] < UNREACHED:
                        return True
                else:
                    mark[n] = epoch
                    stack[count] = n
                    count += 1
    while history and count > 0:
        count -= 1
        n = stack[count]
        moment = last[n]
        for m in (n - 1, n + 1, n - columns, n + columns):
            if m < 0 or m >= potentials.size or mark[m] == epoch:
                continue
            if cut[m] == epoch:
                return True
            if potentials[m] < UNREACHED and first[m] < moment:
                mark[m] = epoch
                stack[count] = m
                count += 1
    return False
