"""The path from the robot down a potential that is lowest at the goal.

Step for step navfn's descent (:func:`.propagation.descend_gradient`), but from the other end, and
over potentials of which only those up to a limit count: beyond it they may belong to costs that
are not true any more. They stand less the highest one, as in :mod:`.repair`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.navfn.propagation import NEUTRAL, STEP
from daemon.stacks.ros1.navfn.repair import UNKNOWN

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)


@kernel
def _slope(
    here: np.float32, left: np.float32, right: np.float32, below: np.float32, above: np.float32
) -> tuple[np.float32, np.float32]:
    """Return the normalised gradient at a cell from its own and four potentials, float32."""
    dx, dy = _ZERO, _ZERO
    if left < UNKNOWN:
        dx += left - here
    if right < UNKNOWN:
        dx += here - right
    if below < UNKNOWN:
        dy += below - here
    if above < UNKNOWN:
        dy += here - above
    norm = np.sqrt(dx * dx + dy * dy)
    if norm > _ZERO:
        scale = _ONE / norm
        return scale * dx, scale * dy
    return _ZERO, _ZERO


@kernel
def _known(potentials: Singles, n: np.uintp, limit: np.float32) -> np.float32:
    """Return the potential of a cell, unreached beyond the limit."""
    value = potentials[n]
    known: np.float32 = value if value <= limit else UNKNOWN
    return known


@kernel
def _lowest_around(
    potentials: Singles, n: int, columns: int, limit: np.float32, root: np.float32
) -> int:
    """Return the lowest of a cell and its eight neighbours; potentials compare as integers."""
    best, value = n, int(_known(potentials, np.uintp(n), limit) - root)
    for row in range(-1, 2):
        for column in range(-1, 2):
            m = n + row * columns + column
            here = _known(potentials, np.uintp(m), limit) - root
            if here < value:
                best, value = m, int(here)
    return best


@kernel
def descend_to_goal(
    potentials: Singles, columns: int, start: int, goal: int, limit: np.float32, path: Singles
) -> int:
    """Write the path from ``start`` down to ``goal`` to the end of ``path``; return its length.

    ``path`` has shape (steps, 2), column and row of each point [cells], float32, the last one is
    that of ``start``. The length is 0 where there is no path or it is longer than ``path``.
    """
    size, capacity, root = potentials.size, path.shape[0], potentials[goal]
    one, line = np.uintp(1), np.uintp(columns)
    n, dx, dy = start, _ZERO, _ZERO
    column, row = start % columns, start // columns
    goal_column, goal_row = goal % columns, goal // columns
    before, edge = -1, False
    ax, ay, bx, by = _ZERO, _ZERO, _ZERO, _ZERO
    cx, cy, ex, ey = _ZERO, _ZERO, _ZERO, _ZERO
    for at in range(capacity - 1, -1, -1):
        across = math.floor(dx + 0.5) if dx >= _ZERO else math.ceil(dx - 0.5)
        along = math.floor(dy + 0.5) if dy >= _ZERO else math.ceil(dy - 0.5)
        nearest = max(0, min(size - 1, n + across + columns * along))
        if potentials[nearest] - root < NEUTRAL:
            path[at, 0], path[at, 1] = goal_column, goal_row
            return int(capacity - at)
        if n <= columns or n >= size - columns - 1:
            return 0
        path[at, 0] = np.float32(column) + dx
        path[at, 1] = np.float32(row) + dy
        swinging = (
            at < capacity - 2 and path[at, 0] == path[at + 2, 0] and path[at, 1] == path[at + 2, 1]
        )
        # Half a cell at a time, every other point is reckoned from the same cells.
        if n != before:
            before = n
            a = np.uintp(n)
            d = a + line
            here = _known(potentials, a, limit)
            left, right = _known(potentials, a - one, limit), _known(potentials, a + one, limit)
            above, below = _known(potentials, d, limit), _known(potentials, a - line, limit)
            right_below = _known(potentials, a - line + one, limit)
            right_above = _known(potentials, d + one, limit)
            left_above = _known(potentials, d - one, limit)
            left_below = _known(potentials, a - line - one, limit)
            farthest = max(
                max(max(here, left), max(right, above)),
                max(max(below, right_below), max(right_above, max(left_above, left_below))),
            )
            edge = bool(farthest >= UNKNOWN)
            if not edge:
                two = _known(potentials, a + one + one, limit)
                two_above = _known(potentials, d + one + one, limit)
                higher, right_higher = np.float32(UNKNOWN), np.float32(UNKNOWN)
                if d + line + one < size:
                    higher = _known(potentials, d + line, limit)
                    right_higher = _known(potentials, d + line + one, limit)
                ax, ay = _slope(here, left, right, below, above)
                bx, by = _slope(right, here, two, right_below, right_above)
                cx, cy = _slope(above, left_above, right_above, here, higher)
                ex, ey = _slope(right_above, above, two_above, right, right_higher)
        # One cell from the goal the gradients around it point all ways, and a path could go on
        # swinging across it.
        arriving = abs(column - goal_column) <= 1 and abs(row - goal_row) <= 1
        if swinging or edge or arriving:
            n = _lowest_around(potentials, n, columns, limit, root)
            column, row = n % columns, n // columns
            dx, dy = _ZERO, _ZERO
            continue
        sx, sy = ax + dx * (bx - ax), ay + dx * (by - ay)
        tx, ty = cx + dx * (ex - cx), cy + dx * (ey - cy)
        x, y = sx + dy * (tx - sx), sy + dy * (ty - sy)
        if x == _ZERO and y == _ZERO:
            return 0
        scale = STEP / np.sqrt(x * x + y * y)
        dx += x * scale
        dy += y * scale
        if dx > _ONE:
            n += 1
            column += 1
            dx -= _ONE
        if dx < -_ONE:
            n -= 1
            column -= 1
            dx += _ONE
        if dy > _ONE:
            n += columns
            row += 1
            dy -= _ONE
        if dy < -_ONE:
            n -= columns
            row -= 1
            dy += _ONE
    return 0
