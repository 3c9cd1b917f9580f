"""Potentials over a costmap that belong to one goal, repaired where costs changed.

The potential of a cell is what navfn's wave makes of its lowest horizontal and its lowest vertical
neighbour (:func:`potential_between`), here for every cell at once: the equations of all cells,
with 0 at the goal, have exactly one solution, because no cell depends on one that is not lower. It
does not matter, then, in which order it was found, nor from which earlier solution. Navfn's own
wave ends a little elsewhere: it does not look at a cell again that would gain little, and its
result depends on its order.

The repair is that of Lifelong Planning A* (Koenig, Likhachev and Furcy 2004) without a heuristic.
A cell whose potential is not what its neighbours make of it waits, under the smaller of the two,
and the lowest is looked at first: one that is too high takes what its neighbours make of it, one
that is too low becomes unreached, and the neighbours that may have relied on it are looked at
again. What waits beyond the limit of a repair goes on waiting for one that reaches as far.

The queue is an array of buckets, narrower than the smallest step from cell to cell; each is a
doubly linked list through the cells themselves, so that nothing can run over.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.navfn.propagation import BLOCKED, NEUTRAL, UNREACHED, Bytes

BUCKET: Final = np.float32(32.0)
"""Width of a bucket [cost]; from cell to cell it is at least 0.704 times NEUTRAL, or 35.2."""
LINKS: Final = 4
"""Columns of ``links``: the bucket a cell waits in, the next and the previous cell there; one is
for nothing but that a cell's are side by side in one line of the cache."""
NOWHERE: Final = 0
"""No bucket, no cell: buckets count from 1, and cell 0 lies on the border."""
_ONE: Final = np.float32(1.0)
GRAIN: Final = np.float32(4.0)
"""Potentials are whole numbers of 1 / GRAIN: a change too small to matter ends where it is rounded
away, instead of running through everything behind it."""
_HALF: Final = np.float32(0.5)
_CONSTANT, _LINEAR, _SQUARE = np.float32(0.7040), np.float32(0.5307), np.float32(0.2301)


@kernel
def potential_between(
    across: np.float32, along: np.float32, cost: np.float32, highest: np.float32
) -> np.float32:
    """Return what a cell gets from its lowest horizontal and vertical neighbour, float32.

    The polynomial is navfn's, cut off at 1: otherwise a cell could depend on one that is higher.
    ``highest`` and more is unreached, as is a cell that is blocked.
    """
    lowest, difference = min(across, along), abs(across - along)
    value = lowest + cost
    if difference < cost:
        share = difference / cost
        share = _CONSTANT + share * (_LINEAR - _SQUARE * share)
        grains = int(cost * min(share, _ONE) * GRAIN + _HALF)
        value = lowest + np.float32(grains) / GRAIN
    return value if value < highest and cost < BLOCKED else UNREACHED


@kernel
def take_changed_costs(
    cells: Bytes,
    seen: Bytes,
    table: Bytes,
    costs: Bytes,
    window: tuple[int, int, int, int],
    opened: int,
    changed: Integers,
) -> int:
    """Translate what changed inside a half-open window; return how many ``changed`` costs.

    ``seen`` is what was translated last, and differs from ``cells`` where that is to be done
    again. ``opened`` is a cell that costs ``NEUTRAL`` if it is blocked: where the robot stands.
    """
    rows, columns = cells.shape
    count = 0
    first, last = max(window[0], 1), min(window[2], columns - 1)
    for row in range(max(window[1], 1), min(window[3], rows - 1)):
        # Most rows did not change: the whole of one is compared at once, by vector instructions.
        now, then = cells[row, first:last], seen[row, first:last]
        differs = np.uint8(0)
        for i in range(now.size):
            differs |= now[i] ^ then[i]
        if differs == 0:
            continue
        for column in range(first, last):
            if cells[row, column] == seen[row, column]:
                continue
            seen[row, column] = cells[row, column]
            n = row * columns + column
            cost = table[cells[row, column]]
            if n == opened and cost >= BLOCKED:
                cost = np.uint8(NEUTRAL)
            if cost != costs[n]:
                costs[n] = cost
                changed[count] = n
                count += 1
    return count


@kernel
def repair(
    costs: Bytes,
    potentials: Singles,
    heads: Integers,
    links: Integers,
    state: Integers,
    columns: int,
    changed: Integers,
    count: int,
    start: int,
    beyond: np.float32,
    highest: np.float32,
) -> int:
    """Repair all potentials up to that of ``start`` and ``beyond``; return the number of updates.

    ``state`` holds the lowest bucket that may not be empty, and how many cells wait.
    """
    one, line = np.uintp(1), np.uintp(columns)
    bucket, waiting, updates = int(state[0]), int(state[1]), 0
    while count > 0 or waiting > 0:
        if count > 0:
            count -= 1
            n = np.uintp(changed[count])
            # All but the goal, whose 0 is given.
            floor = _ONE
            begin, end = 0, 1
        else:
            first = heads[bucket]
            if first == NOWHERE:
                bucket += 1
                if (
                    potentials[start] < highest
                    and bucket > (potentials[start] + beyond) / BUCKET + _ONE
                ):
                    break
                continue
            n = np.uintp(first)
            updates += 1
            after = links[n, 1]
            heads[bucket] = after
            if after != NOWHERE:
                links[np.uintp(after), 2] = NOWHERE
            links[n, 0] = NOWHERE
            waiting -= 1
            value = potential_between(
                min(potentials[n - one], potentials[n + one]),
                min(potentials[n - line], potentials[n + line]),
                np.float32(costs[n]),
                highest,
            )
            # No cell depends on one that is not lower.
            begin, end = 1, 5
            floor = potentials[n]
            if value < floor:
                floor = value
                potentials[n] = value
            elif value > floor:
                potentials[n] = UNREACHED
                begin = 0
            else:
                continue
        for k in range(begin, end):
            if k == 0:
                m = n
            elif k == 1:
                m = n - one
            elif k == 2:
                m = n + one
            elif k == 3:
                m = n - line
            else:
                m = n + line
            here = potentials[m]
            if here < floor:
                continue
            cost = costs[m]
            if cost >= BLOCKED and here >= UNREACHED and links[m, 0] == NOWHERE:
                continue
            value = potential_between(
                min(potentials[m - one], potentials[m + one]),
                min(potentials[m - line], potentials[m + line]),
                np.float32(cost),
                highest,
            )
            old = links[m, 0]
            new = NOWHERE
            if value != here:
                new = int(min(value, here) / BUCKET) + 1
            if new == old:
                continue
            if old != NOWHERE:
                after, before = links[m, 1], links[m, 2]
                if before == NOWHERE:
                    heads[old] = after
                else:
                    links[np.uintp(before), 1] = after
                if after != NOWHERE:
                    links[np.uintp(after), 2] = before
                waiting -= 1
            links[m, 0] = new
            if new != NOWHERE:
                first = heads[new]
                links[m, 1], links[m, 2] = first, NOWHERE
                if first != NOWHERE:
                    links[np.uintp(first), 2] = np.int32(m)
                heads[new] = np.int32(m)
                waiting += 1
                bucket = min(bucket, new)
    state[0], state[1] = bucket, waiting
    return updates
