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

Potentials stand here less the highest one there can be: memory of zeros is then unreached, and
what nobody reaches is never touched.

The queue is an array of buckets, narrower than the smallest step from cell to cell; each is a list
of entries. A cell that comes to wait in a lower bucket gets another entry there, and the one it
had is passed over: little memory is touched, which is what a repair's time goes for.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.navfn.propagation import BLOCKED, NEUTRAL, Bytes

Shorts: TypeAlias = npt.NDArray[np.uint16]

BUCKET: Final = np.float32(32.0)
"""Width of a bucket [cost]; from cell to cell it is at least 0.704 times NEUTRAL, or 35.2."""
NOWHERE: Final = 0
"""No bucket, no entry, no cell: they count from 1, and cell 0 lies on the border."""
LOWEST, WAITING, UNUSED, FRESH = 0, 1, 2, 3
"""The state of the queue: the lowest bucket that may not be empty, how many entries wait, the first
of the entries that were used before, and how many never were."""
GRAIN: Final = np.float32(8.0)
"""Potentials are whole numbers of 1 / GRAIN: a change too small to matter ends where it is rounded
away, instead of running through everything behind it. With quarters the way of one run
of S1 was 139.1 m, with eighths 138.6 m, with navfn 138.1 m; finer ones need smaller maps."""
UNKNOWN: Final = np.float32(0.0)
"""What stands for a cell that is not reached."""
_ONE: Final = np.float32(1.0)
_HALF: Final = np.float32(0.5)
_CONSTANT, _LINEAR, _SQUARE = np.float32(0.7040), np.float32(0.5307), np.float32(0.2301)


@kernel
def potential_between(across: np.float32, along: np.float32, cost: np.float32) -> np.float32:
    """Return what a cell gets from its lowest horizontal and vertical neighbour, float32.

    The polynomial is navfn's, cut off at 1: otherwise a cell could depend on one that is higher.
    0 and more is unreached, as is a cell that is blocked.
    """
    lowest = min(across, along)
    share = min(abs(across - along) / cost, _ONE)
    share = min(_CONSTANT + share * (_LINEAR - _SQUARE * share), _ONE)
    value = lowest + np.float32(int(cost * share * GRAIN + _HALF)) / GRAIN
    return value if value < UNKNOWN and cost < BLOCKED else UNKNOWN


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
    queued: Shorts,
    heads: Integers,
    entries: Integers,
    state: Integers,
    columns: int,
    changed: Integers,
    count: int,
    start: int,
    beyond: np.float32,
    highest: np.float32,
) -> int:
    """Repair all potentials up to that of ``start`` and ``beyond``; return the number of updates.

    ``changed`` holds the cells with ``count`` changed costs. ``queued`` is the lowest bucket each
    cell waits in, ``heads`` the first entry of each bucket, ``entries`` (capacity, 2) the cell of
    each and the next one. Returns -1 when there is no room for more of them. Potentials stand less
    ``highest``.
    """
    one, line = np.uintp(1), np.uintp(columns)
    bucket, waiting = int(state[LOWEST]), int(state[WAITING])
    unused, fresh = int(state[UNUSED]), int(state[FRESH])
    updates = 0
    while count > 0 or waiting > 0:
        if count > 0:
            count -= 1
            n = np.uintp(changed[count])
            begin, end = 0, 1
            # All but the goal, whose 0 is given.
            floor = _ONE - highest
        else:
            entry = heads[bucket]
            if entry == NOWHERE:
                bucket += 1
                last = (potentials[start] + highest + beyond) / BUCKET + _ONE
                if potentials[start] < UNKNOWN and bucket > last:
                    break
                continue
            n = np.uintp(entries[entry, 0])
            heads[bucket] = entries[entry, 1]
            entries[entry, 1] = unused
            unused = entry
            waiting -= 1
            if queued[n] != bucket:
                continue
            queued[n] = NOWHERE
            updates += 1
            floor = potentials[n]
            value = potential_between(
                min(potentials[n - one], potentials[n + one]),
                min(potentials[n - line], potentials[n + line]),
                np.float32(costs[n]),
            )
            if value == floor:
                continue
            # No cell depends on one that is not lower.
            begin, end = 1, 5
            if int((min(value, floor) + highest) / BUCKET) + 1 > bucket:
                # What it waited for has risen in the meantime.
                begin, end = 0, 1
            elif value < floor:
                potentials[n] = value
                floor = value
            else:
                potentials[n] = UNKNOWN
                begin = 0
        if fresh + 5 > entries.shape[0]:
            return -1
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
            # The border is blocked, and there is no cell beyond it to be read.
            value = UNKNOWN
            if costs[m] < BLOCKED:
                value = potential_between(
                    min(potentials[m - one], potentials[m + one]),
                    min(potentials[m - line], potentials[m + line]),
                    np.float32(costs[m]),
                )
            if value == here:
                continue
            new = int((min(value, here) + highest) / BUCKET) + 1
            if queued[m] != NOWHERE and queued[m] <= new:
                continue
            queued[m] = new
            if unused != NOWHERE:
                entry = unused
                unused = entries[entry, 1]
            else:
                entry = fresh
                fresh += 1
            entries[entry, 0] = np.int32(m)
            entries[entry, 1] = heads[new]
            heads[new] = entry
            waiting += 1
            bucket = min(bucket, new)
    state[LOWEST], state[WAITING] = bucket, waiting
    state[UNUSED], state[FRESH] = unused, fresh
    return updates
