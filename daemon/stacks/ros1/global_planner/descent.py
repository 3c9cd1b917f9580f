"""The path from the goal down a potential to the robot: along the gradient, or cell by cell.

``GradientPath`` and ``GridPath`` of global_planner, step for step. Both write (n, 2) columns and
rows, float32, from the goal, and return the length: 0 when there is no path, -1 when the array
is too short. ``lenient`` ones have arrived less than a cell from the start in columns and rows.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.global_planner.expansion import MARGIN, States
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    DOUBTFUL,
    UNREACHED,
    at_edge,
    interpolate_rounded,
)

HALF_CELL = np.float32(0.5)


@kernel
def _gradient(
    potentials: Singles, n: int, columns: int, size: int
) -> tuple[np.float32, np.float32]:
    """Return the normalised gradient at a reached cell, float32; none in the outermost rows."""
    begin = MARGIN * columns
    if n - begin < columns or n - begin > size - columns:
        return np.float32(0.0), np.float32(0.0)
    here = potentials[n]
    dx, dy = np.float32(0.0), np.float32(0.0)
    if potentials[n - 1] < UNREACHED:
        dx += potentials[n - 1] - here
    if potentials[n + 1] < UNREACHED:
        dx += here - potentials[n + 1]
    if potentials[n - columns] < UNREACHED:
        dy += potentials[n - columns] - here
    if potentials[n + columns] < UNREACHED:
        dy += here - potentials[n + columns]
    norm = _length(dx, dy)
    if norm > np.float32(0.0):
        scale = np.float32(1.0) / norm
        return scale * dx, scale * dy
    return np.float32(0.0), np.float32(0.0)


@kernel
def _length(x: np.float32, y: np.float32) -> np.float32:
    """Return the length of a vector, float32: as hypotf of glibc, rounded once."""
    a, b = np.float64(x), np.float64(y)
    return np.float32(math.sqrt(a * a + b * b))


@kernel
def _lowest(potentials: Singles, n: int, columns: int) -> int:
    """Return the lowest of a cell and its eight neighbours; the lowest so far is rounded to 0."""
    best, value = n, int(potentials[n])
    for row in range(-1, 2):
        for column in range(-1, 2):
            m = n + row * columns + column
            if m != n and potentials[m] < value:
                best, value = m, int(potentials[m])
    return best


@kernel
def descend_gradient(
    potentials: Singles,
    columns: int,
    size: int,
    start: tuple[float, float],
    goal: tuple[float, float],
    lenient: bool,
    path: Singles,
    cells: Integers,
) -> int:
    """Follow the gradient from ``goal`` to ``start`` (column, row), half a cell at a time.

    ``cells``, as long as ``path``, takes the entry that each point was reckoned from.
    """
    begin = MARGIN * columns
    n = begin + int(goal[0]) + int(goal[1]) * columns
    dx, dy = np.float32(goal[0] - int(goal[0])), np.float32(goal[1] - int(goal[1]))
    one = np.float32(1.0)
    near = 1.0 if lenient else 0.5
    before, edge = -1, False
    ax, ay, bx, by = dx, dx, dx, dx
    cx, cy, ex, ey = dx, dx, dx, dx
    # What the next step depends on, at a step that is a power of two (Brent): a descent that
    # comes back to it never ends, and the original goes round 4 * size times before it says so.
    mark, mark_n, mark_dx, mark_dy = 4, -1, dx, dy
    for count in range(4 * size):
        cell = n - begin
        x, y = np.float32(cell % columns) + dx, np.float32(cell // columns) + dy
        arrived = abs(np.float64(x) - start[0]) < near and abs(np.float64(y) - start[1]) < near
        if not arrived and (cell < columns or cell > size - columns):
            return 0
        if count >= path.shape[0]:
            return -1
        cells[count] = n
        path[count, 0] = np.float32(start[0]) if arrived else x
        path[count, 1] = np.float32(start[1]) if arrived else y
        if arrived:
            return count + 1
        swinging = count >= 2 and x == path[count - 2, 0] and y == path[count - 2, 1]
        if n == mark_n and dx == mark_dx and dy == mark_dy and _same_points(path, mark, count):
            return 0
        if count == 2 * mark:
            mark, mark_n, mark_dx, mark_dy = count, n, dx, dy
        # Half a cell at a time, every other point is reckoned from the same cells.
        if n != before:
            before, edge = n, at_edge(potentials, n, columns)
            if not edge:
                ax, ay = _gradient(potentials, n, columns, size)
                bx, by = _gradient(potentials, n + 1, columns, size)
                cx, cy = _gradient(potentials, n + columns, columns, size)
                ex, ey = _gradient(potentials, n + columns + 1, columns, size)
        if swinging or edge:
            n = _lowest(potentials, n, columns)
            dx, dy = np.float32(0.0), np.float32(0.0)
            if potentials[n] >= UNREACHED:
                return 0
            continue
        x = interpolate_rounded(
            interpolate_rounded(ax, bx, dx), interpolate_rounded(cx, ex, dx), dy
        )
        y = interpolate_rounded(
            interpolate_rounded(ay, by, dx), interpolate_rounded(cy, ey, dx), dy
        )
        if x == np.float32(0.0) and y == np.float32(0.0):
            return 0
        scale = HALF_CELL / _length(x, y)
        dx += x * scale
        dy += y * scale
        if dx > one:
            n += 1
            dx -= one
        if dx < -one:
            n -= 1
            dx += one
        if dy > one:
            n += columns
            dy -= one
        if dy < -one:
            n -= columns
            dy += one
    return 0


@kernel
def _same_points(path: Singles, first: int, second: int) -> bool:
    """Tell whether two points and the two before each are the same."""
    for k in range(3):
        if path[first - k, 0] != path[second - k, 0] or path[first - k, 1] != path[second - k, 1]:
            return False
    return True


@kernel
def descend_cells(
    potentials: Singles,
    columns: int,
    size: int,
    start: tuple[float, float],
    goal: tuple[float, float],
    lenient: bool,
    path: Singles,
) -> int:
    """Go from ``goal`` to the lowest of eight neighbours until in the cell of ``start``.

    The first point is the goal itself, the others are cells. Cell (0, 0) is never gone to: the
    original takes it for the lack of a lowest one.
    """
    begin = MARGIN * columns
    target = int(start[0]) + int(start[1]) * columns
    x, y = np.float32(goal[0]), np.float32(goal[1])
    # A step depends on the cell alone: the same one as at a power of two, and it never ends
    # (Brent); the original goes round 4 * size times before it says so.
    seen_x, seen_y = np.float32(math.nan), np.float32(math.nan)
    for count in range(4 * size + 2):
        if count >= path.shape[0]:
            return -1
        path[count, 0], path[count, 1] = x, y
        near = abs(np.float64(x) - start[0]) < 1.0 and abs(np.float64(y) - start[1]) < 1.0
        if int(x) + int(y) * columns == target or (lenient and near):
            return count + 1
        if x == seen_x and y == seen_y:
            return 0
        if count > 0 and count & (count - 1) == 0:
            seen_x, seen_y = x, y
        lowest = UNREACHED
        best_x, best_y = 0, 0
        for i in range(-1, 2):
            for j in range(-1, 2):
                if i == 0 and j == 0:
                    continue
                # Rounded to 0, which right of column 0 and above row 0 alone is a matter.
                u, v = int(x + np.float32(i)), int(y + np.float32(j))
                value = potentials[begin + u + v * columns]
                if value < lowest:
                    lowest, best_x, best_y = value, u, v
        if best_x == 0 and best_y == 0:
            return 0
        x, y = np.float32(best_x), np.float32(best_y)
    return 0


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
