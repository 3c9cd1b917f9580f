"""The path from the goal down a potential to the robot, and the yaws of its points.

``GradientPath`` of global_planner, step for step, and ``OrientationFilter`` as far as it looks
forward.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.global_planner.expansion import MARGIN
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    DOUBTFUL,
    UNREACHED,
    States,
    at_edge,
    interpolate_rounded,
    lowest_around,
)
from grammars.model.geometry import Floats

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
def descend_gradient(
    potentials: Singles,
    columns: int,
    size: int,
    start: tuple[float, float],
    goal: tuple[float, float],
    path: Singles,
    cells: Integers,
) -> int:
    """Follow the gradient from ``goal`` to ``start`` (column, row), half a cell at a time.

    Writes (n, 2) columns and rows, float32, from the goal, and returns the length: 0 if there is no
    path, -1 if the array is too short. ``cells``, as long as ``path``, takes the entry that each
    point was reckoned from.
    """
    begin = MARGIN * columns
    n = begin + int(goal[0]) + int(goal[1]) * columns
    dx, dy = np.float32(goal[0] - int(goal[0])), np.float32(goal[1] - int(goal[1]))
    one = np.float32(1.0)
    before, edge = -1, False
    ax, ay, bx, by = dx, dx, dx, dx
    cx, cy, ex, ey = dx, dx, dx, dx
    # What the next step depends on, at a step that is a power of two (Brent): a descent that
    # comes back to it never ends, and the original goes round 4 * size times before it says so.
    mark, mark_n, mark_dx, mark_dy = 4, -1, dx, dy
    for count in range(4 * size):
        cell = n - begin
        x, y = np.float32(cell % columns) + dx, np.float32(cell // columns) + dy
        arrived = abs(np.float64(x) - start[0]) < 0.5 and abs(np.float64(y) - start[1]) < 0.5
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
            n = lowest_around(potentials, n, columns)
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


@kernel
def _through_quaternion(yaw: float) -> float:
    """Return a yaw as it is read back from a quaternion (tf2 ``setRPY``, ``getYaw``)."""
    z, w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return math.atan2(2.0 * (w * z), w * w - z * z)


@kernel
def look_forward(poses: Floats, window: int) -> None:
    """Set the yaw of ``poses`` (n, 3) but the last, the goal, along the path at each point.

    That is the direction from ``window`` points before it to as many behind it. It goes through a
    quaternion as in the original, because a half turn may fall to either side by the last bit.
    """
    last = poses.shape[0] - 1
    for i in range(last):
        a, b = max(0, i - window), min(last, i + window)
        dx, dy = poses[b, 0] - poses[a, 0], poses[b, 1] - poses[a, 1]
        poses[i, 2] = _through_quaternion(math.atan2(dy, dx))
