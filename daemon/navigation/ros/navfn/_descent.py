"""The path: down the gradient of the potential, half a cell at a time (navfn ``calcPath``)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.navigation.kernels import Integers, Singles, kernel
from daemon.navigation.ros.navfn._costs import NEUTRAL, UNREACHED
from grammars.values import Floats

STEP: Final = np.float32(0.5)


@kernel
def _rounded(offset: np.float32) -> int:
    """Round half away from zero, as C does."""
    return math.floor(offset + 0.5) if offset >= 0.0 else math.ceil(offset - 0.5)


@kernel
def _gradient(potentials: Singles, n: int, columns: int) -> tuple[np.float32, np.float32]:
    """Return the normalised gradient at a reached cell, float32; neighbours may be unreached."""
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
    norm = np.sqrt(dx * dx + dy * dy)
    if norm > np.float32(0.0):
        scale = np.float32(1.0) / norm
        return scale * dx, scale * dy
    return np.float32(0.0), np.float32(0.0)


@kernel
def at_edge(potentials: Singles, n: int, columns: int) -> bool:
    """Tell whether a cell or one of its eight neighbours was not reached."""
    for row in range(-1, 2):
        for column in range(-1, 2):
            if potentials[n + row * columns + column] >= UNREACHED:
                return True
    return False


@kernel
def _lowest(potentials: Singles, n: int, columns: int) -> int:
    """Return the lowest of a cell and its eight neighbours; potentials compare as integers."""
    best, value = n, int(potentials[n])
    for row in range(-1, 2):
        for column in range(-1, 2):
            m = n + row * columns + column
            if potentials[m] < value:
                best, value = m, int(potentials[m])
    return best


@kernel
def _mixed(a: np.float32, b: np.float32, share: np.float32) -> np.float32:
    """Return a + share (b - a) rounded as in the original, float32."""
    return np.float32((1.0 - np.float64(share)) * np.float64(a) + np.float64(share * b))


@kernel
def descend(
    potentials: Singles, columns: int, start: int, goal: int, path: Singles, cells: Integers
) -> int:
    """Write the path from ``goal`` down to ``start`` into ``path``; return its length, or 0.

    ``path`` has shape (steps, 2), column and row of each point [cells], float32; no path is longer.
    ``cells`` (steps,) takes the cell each point was reckoned from.
    """
    size = potentials.size
    n, dx, dy = goal, np.float32(0.0), np.float32(0.0)
    before, edge = -1, False
    ax, ay, bx, by = dx, dx, dx, dx
    cx, cy, ex, ey = dx, dx, dx, dx
    for count in range(path.shape[0]):
        cells[count] = n
        nearest = max(0, min(size - 1, n + _rounded(dx) + columns * _rounded(dy)))
        if potentials[nearest] < NEUTRAL:
            path[count, 0], path[count, 1] = start % columns, start // columns
            return count + 1
        if n <= columns or n >= size - columns - 1:
            return 0
        path[count, 0] = np.float32(n % columns) + dx
        path[count, 1] = np.float32(n // columns) + dy
        swinging = (
            count >= 2
            and path[count, 0] == path[count - 2, 0]
            and path[count, 1] == path[count - 2, 1]
        )
        # Half a cell at a time, every other point is reckoned from the same cells.
        if n != before:
            before, edge = n, at_edge(potentials, n, columns)
            if not edge:
                ax, ay = _gradient(potentials, n, columns)
                bx, by = _gradient(potentials, n + 1, columns)
                cx, cy = _gradient(potentials, n + columns, columns)
                ex, ey = _gradient(potentials, n + columns + 1, columns)
        if swinging or edge:
            n = _lowest(potentials, n, columns)
            dx, dy = np.float32(0.0), np.float32(0.0)
            continue
        x = _mixed(_mixed(ax, bx, dx), _mixed(cx, ex, dx), dy)
        y = _mixed(_mixed(ay, by, dx), _mixed(cy, ey, dx), dy)
        if x == np.float32(0.0) and y == np.float32(0.0):
            return 0
        scale = STEP / np.sqrt(x * x + y * y)
        dx += x * scale
        dy += y * scale
        if dx > 1.0:
            n += 1
            dx -= np.float32(1.0)
        if dx < -1.0:
            n -= 1
            dx += np.float32(1.0)
        if dy > 1.0:
            n += columns
            dy -= np.float32(1.0)
        if dy < -1.0:
            n -= columns
            dy += np.float32(1.0)
    return 0


@kernel
def turn_round(
    path: Singles, shift: float, resolution: float, x: float, y: float, poses: Floats
) -> None:
    """Write a path, cells from the goal, as x, y, yaw 0 from the start into ``poses``, (n, 3).

    ``shift`` [cells] is added; the corner of cell (0, 0) lies at ``x``, ``y``.
    """
    count = path.shape[0]
    for i in range(count):
        k = count - 1 - i
        poses[i, 0] = (np.float64(path[k, 0]) + shift) * resolution + x
        poses[i, 1] = (np.float64(path[k, 1]) + shift) * resolution + y
        poses[i, 2] = 0.0
