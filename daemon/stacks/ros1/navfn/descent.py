"""Path from the goal down a potential to the robot: along the gradient, half a cell a step.

These are ``calcPath`` of navfn and ``GradientPath`` of global_planner, step for step. They differ
in the end condition, the distance from the border, the greatest length, and the rounding.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.navfn.propagation import (
    NEUTRAL,
    SPARE_ROWS,
    UNREACHED,
    VALUE,
    Wave,
    interpolate_potential,
)

STEP: Final = np.float32(0.5)
"""Length of a step [cells]."""


@kernel
def _round_half_away(offset: np.float32) -> int:
    """Round half away from zero, as C does."""
    return math.floor(offset + 0.5) if offset >= 0.0 else math.ceil(offset - 0.5)


@kernel
def _length(x: np.float32, y: np.float32, as_navfn: bool) -> np.float32:
    """Return the length of a vector, float32; navfn rounds at each step, GlobalPlanner once."""
    if as_navfn:
        return np.float32(np.sqrt(x * x + y * y))
    a, b = np.float64(x), np.float64(y)
    return np.float32(math.sqrt(a * a + b * b))


@kernel
def _gradient(
    potentials: Singles, n: int, columns: int, as_navfn: bool
) -> tuple[np.float32, np.float32]:
    """Return the normalised gradient at a reached cell, float32; 0 in the outermost rows.

    Neighbours may be unreached.
    """
    outermost = (SPARE_ROWS + 1) * columns
    if n < outermost or n > potentials.size - outermost:
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
    norm = _length(dx, dy, as_navfn)
    if norm > np.float32(0.0):
        scale = np.float32(1.0) / norm
        return scale * dx, scale * dy
    return np.float32(0.0), np.float32(0.0)


@kernel
def at_edge(potentials: Singles, corner: int, columns: int) -> bool:
    """Tell whether any of nine cells is unreached; the lowest left one is ``corner``."""
    for row in range(3):
        for n in range(corner + row * columns, corner + row * columns + 3):
            if potentials[n] >= UNREACHED:
                return True
    return False


@kernel
def _lowest_around(potentials: Singles, n: int, columns: int) -> int:
    """Return the lowest of a cell and its eight neighbours, comparing potentials as integers."""
    best, value = n, int(potentials[n])
    for row in range(-1, 2):
        for column in range(-1, 2):
            m = n + row * columns + column
            if potentials[m] < value:
                best, value = m, int(potentials[m])
    return best


@kernel
def _interpolate(a: np.float32, b: np.float32, share: np.float32) -> np.float32:
    """Return a + share (b - a) rounded as in the original, float32."""
    return np.float32((1.0 - np.float64(share)) * np.float64(a) + np.float64(share * b))


@kernel
def descend_gradient(
    potentials: Singles,
    columns: int,
    start: tuple[float, float],
    goal: tuple[float, float],
    as_navfn: bool,
    steps: int,
    path: Singles,
    cells: Integers,
) -> int:
    """Follow the gradient from ``goal`` to ``start`` (column, row), at most ``steps`` points.

    Writes (n, 2) columns and rows, float32, from the goal. Returns the length: 0 if there is no
    path, -1 if the array is too short. ``cells``, as long as ``path``, receives the cell behind
    each point.
    """
    # The originals' descent step for step, with its whole state in registers.
    begin = SPARE_ROWS * columns
    size = potentials.size - 2 * begin
    first, last = (columns + 1, size - columns - 2) if as_navfn else (columns, size - columns)
    n = begin + int(goal[0]) + int(goal[1]) * columns
    dx, dy = np.float32(goal[0] - int(goal[0])), np.float32(goal[1] - int(goal[1]))
    one = np.float32(1.0)
    column, row = 0, 0
    previous, edge = -1, True
    ax, ay, bx, by = dx, dx, dx, dx
    cx, cy, ex, ey = dx, dx, dx, dx
    # The state of the descent at a step that is a power of two (Brent). A descent that returns to
    # it never ends; the originals go round until all steps are used up.
    mark, mark_n, mark_dx, mark_dy = 4, -1, dx, dy
    for count in range(steps):
        cell = n - begin
        if n != previous:
            column, row = cell % columns, cell // columns
        x, y = np.float32(column) + dx, np.float32(row) + dy
        if as_navfn:
            nearest = cell + _round_half_away(dx) + columns * _round_half_away(dy)
            arrived = potentials[begin + max(0, min(size - 1, nearest))] < NEUTRAL
        else:
            arrived = abs(np.float64(x) - start[0]) < 0.5 and abs(np.float64(y) - start[1]) < 0.5
        if not arrived and (cell < first or cell > last):
            return 0
        if count >= path.shape[0]:
            return -1
        cells[count] = n
        path[count, 0] = np.float32(start[0]) if arrived else x
        path[count, 1] = np.float32(start[1]) if arrived else y
        if arrived:
            return count + 1
        swinging = count >= 2 and x == path[count - 2, 0] and y == path[count - 2, 1]
        again = n == mark_n and dx == mark_dx and dy == mark_dy
        for k in range(3):
            again = (
                again
                and path[mark - k, 0] == path[count - k, 0]
                and path[mark - k, 1] == path[count - k, 1]
            )
        if again:
            return 0
        if count == 2 * mark:
            mark, mark_n, mark_dx, mark_dy = count, n, dx, dy
        # With steps of half a cell, every other point comes from the same cells.
        if n != previous:
            previous, edge = n, at_edge(potentials, n - columns - 1, columns)
            if not edge:
                ax, ay = _gradient(potentials, n, columns, as_navfn)
                bx, by = _gradient(potentials, n + 1, columns, as_navfn)
                cx, cy = _gradient(potentials, n + columns, columns, as_navfn)
                ex, ey = _gradient(potentials, n + columns + 1, columns, as_navfn)
        if swinging or edge:
            n = _lowest_around(potentials, n, columns)
            dx, dy = np.float32(0.0), np.float32(0.0)
            if potentials[n] >= UNREACHED:
                return 0
            continue
        x = _interpolate(_interpolate(ax, bx, dx), _interpolate(cx, ex, dx), dy)
        y = _interpolate(_interpolate(ay, by, dx), _interpolate(cy, ey, dx), dy)
        if x == np.float32(0.0) and y == np.float32(0.0):
            return 0
        scale = STEP / _length(x, y, as_navfn)
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
def fill_around_goal(wave: Wave, goal_costs: Singles, goal: int, count: int) -> int:
    """Give unreached cells among the 25 around the goal a potential, blocked or not.

    The descent can then follow the gradient to the exact goal (``Expander::clearEndpoint``).
    ``goal_costs`` by state are whole numbers. Returns the number of cells with a potential. Cells
    off the map are skipped; the original writes there.
    """
    states, potentials, columns = wave.states, wave.potentials, wave.columns
    begin = SPARE_ROWS * columns
    for i in range(-2, 3):
        for j in range(-2, 3):
            n = goal + i + columns * j
            if n < begin or n >= potentials.size - begin or potentials[n] < UNREACHED:
                continue
            cost = goal_costs[states[n] & VALUE]
            across = min(potentials[n - 1], potentials[n + 1])
            along = min(potentials[n - columns], potentials[n + columns])
            # At the border the start's potential may lie below 0, but it counts.
            free = cost == np.float32(0.0)
            potentials[n] = (
                min(across, along) if free else interpolate_potential(across, along, cost)
            )
            wave.reached[count] = n
            count += 1
    return count
