"""The potential: a wave from the robot in blocks of rising priority (navfn ``propNavFnDijkstra``).

What a cell ends up with depends on the order of the updates, because an improvement is passed on
only to neighbours that gain more than 0.7 of their cost; the order is therefore the original's.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.navigation.kernels import Integers, Singles, kernel
from daemon.navigation.ros.navfn._costs import BLOCKED, PENDING, UNREACHED, States

BUFFER: Final = 10_000
"""Cells a priority buffer holds; what does not fit is lost (navfn ``PRIORITYBUFSIZE``)."""
THRESHOLD_STEP: Final = 100.0
GAINS: Final = np.full(2 * PENDING, np.inf, dtype=np.float32)
"""By cost: how much a neighbour must at least gain, so that it is looked at again. No gain is
enough for a cell that is blocked or waits already."""
GAINS[:BLOCKED] = 0.707106781 * np.arange(BLOCKED)


@kernel
def interpolated(first: np.float32, second: np.float32, cost: np.float32) -> np.float32:
    """Return the potential of a cell from its lowest horizontal and vertical neighbour, float32."""
    lowest, difference = min(first, second), abs(first - second)
    # The constants of the original are doubles: the polynomial is rounded only at its end.
    q = np.float64(difference / cost)
    share = np.float32(-0.2301 * q * q + 0.5307 * q + 0.7040)
    return lowest + cost * (share if difference < cost else np.float32(1.0))


@kernel
def propagate(
    costs: States,
    potentials: Singles,
    gains: Singles,
    columns: int,
    start: int,
    goal: int,
    cycles: int,
    limit: np.float32,
    buffers: Integers,
    reached: Integers,
) -> tuple[int, int, bool]:
    """Spread the wave until ``goal`` has a potential, or the threshold passes ``limit``.

    ``costs`` and ``potentials`` are flat, the latter ``UNREACHED`` everywhere; ``buffers`` of
    shape (3, size) is scratch. The cells reached stand in ``reached``, so that :func:`forget`
    need not look at others. ``goal`` -1 is never reached. Returns how many cells were
    reached, the fill, which is the largest number of cells that ever waited in one buffer, and
    whether nothing was left to do.
    """
    capacity = buffers.shape[1]
    potentials[start] = np.float32(0.0)
    reached[0] = start
    count, fill = 1, 0
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
    for _ in range(cycles):
        if now == 0:
            break
        current, following, postponed = buffers[a], buffers[b], buffers[c]
        for i in range(now):
            costs[current[i]] &= PENDING - 1
        for i in range(now):
            n = np.uintp(current[i])
            left, right = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            across = left if left < right else right
            along = up if up < down else down
            # A cell in the queue again is pending, its cost stands below the flag.
            p = interpolated(across, along, np.float32(costs[n] & (PENDING - 1)))
            old = potentials[n]
            if p >= old:
                continue
            if old == UNREACHED:
                reached[count] = n
                count += 1
            potentials[n] = p
            soon = p < threshold
            for k in range(4):
                if k == 0:
                    m, value = n - one, left
                elif k == 1:
                    m, value = n + one, right
                elif k == 2:
                    m, value = n - line, up
                else:
                    m, value = n + line, down
                cost = costs[m]
                if value <= p + gains[cost]:
                    continue
                if soon:
                    if later < capacity:
                        following[later] = m
                        later += 1
                        costs[m] = cost | PENDING
                elif over < capacity:
                    postponed[over] = m
                    over += 1
                    costs[m] = cost | PENDING
        a, b = b, a
        fill = max(fill, later, over)
        now, later = later, 0
        if now == 0:
            threshold += np.float32(THRESHOLD_STEP)
            a, c = c, a
            now, over = over, 0
            if threshold > limit:
                break
        if goal >= 0 and potentials[goal] < UNREACHED:
            break
    for i in range(now):
        costs[buffers[a, i]] &= PENDING - 1
    for i in range(over):
        costs[buffers[c, i]] &= PENDING - 1
    return count, fill, now == 0


@kernel
def forget(potentials: Singles, log: Integers, count: int) -> None:
    """Make the cells among the first ``count`` of ``log`` unreached again; others are negative."""
    for i in range(count):
        if log[i] >= 0:
            potentials[log[i]] = UNREACHED
