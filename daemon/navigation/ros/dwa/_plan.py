"""The part of a global plan that matters now, and the cells it runs through."""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.dwa._distances import Bits, Cells, add
from daemon.navigation.ros.grids import NO_INFORMATION
from grammars.values import Floats


@kernel
def near(
    plan: Floats, start: int, transform: Floats, pose: Floats, reach: float, out: Floats
) -> int:
    """Write the poses of ``plan`` near the robot to ``out`` and return how many.

    Leaves out the poses before the first one within ``reach`` [m] and stops behind the first one
    beyond it (base_local_planner ``transformGlobalPlan``). ``plan`` has rows x, y, yaw in the map
    frame, ``transform`` (x, y, cos, sin) is the map in odom, ``pose`` (x, y) the robot in the map;
    ``out`` gets x, y in odom.
    """
    limit = reach * reach
    first = start
    while first < plan.shape[0]:
        dx, dy = pose[0] - plan[first, 0], pose[1] - plan[first, 1]
        if dx * dx + dy * dy <= limit:
            break
        first += 1
    n = 0
    square = 0.0
    while first + n < plan.shape[0] and square <= limit:
        x, y = plan[first + n, 0], plan[first + n, 1]
        out[n, 0] = transform[0] + transform[2] * x - transform[3] * y
        out[n, 1] = transform[1] + transform[3] * x + transform[2] * y
        dx, dy = pose[0] - x, pose[1] - y
        square = dx * dx + dy * dy
        n += 1
    return n


@kernel
def cell_of(x: float, y: float, frame: Floats, rows: int, columns: int) -> int:
    """Return row * columns + column of a point, -1 off the grid (costmap_2d ``worldToMap``).

    ``frame`` is x, y of the lower-left corner and the resolution.
    """
    if x < frame[0] or y < frame[1]:
        return -1
    column, row = int((x - frame[0]) / frame[2]), int((y - frame[1]) / frame[2])
    if column >= columns or row >= rows:
        return -1
    return row * columns + column


@kernel
def _mark(x: float, y: float, cells: Cells, frame: Floats, seeds: Bits) -> int:
    rows, columns = cells.shape
    at = cell_of(x, y, frame, rows, columns)
    if at < 0:
        return -1
    row, column = at // columns, at % columns
    if cells[row, column] == NO_INFORMATION:
        return -1
    add(seeds, row, column)
    return at


@kernel
def walk(plan: Floats, n: int, end: Floats, cells: Cells, frame: Floats, seeds: Bits) -> int:
    """Mark the known cells a plan runs through and return the last one, -1 when there is none.

    The last of the ``n`` points is replaced by ``end``; gaps above the resolution are filled
    (``MapGrid::adjustPlanResolution``). Counts from the first point on a known cell until one is
    not (``setTargetCells``, ``setLocalGoal``). ``seeds`` is set to the cells, one bit each.
    """
    seeds[:] = np.uint64(0)
    last = -1
    before_x, before_y = 0.0, 0.0
    for i in range(n):
        x, y = plan[i, 0], plan[i, 1]
        if i == n - 1:
            x, y = end[0], end[1]
        if i > 0:
            square = (x - before_x) * (x - before_x) + (y - before_y) * (y - before_y)
            if square > frame[2] * frame[2]:
                steps = math.ceil(math.sqrt(square) / frame[2])
                dx, dy = (x - before_x) / steps, (y - before_y) / steps
                for j in range(1, steps):
                    at = _mark(before_x + j * dx, before_y + j * dy, cells, frame, seeds)
                    if at >= 0:
                        last = at
                    elif last >= 0:
                        return last
        at = _mark(x, y, cells, frame, seeds)
        if at >= 0:
            last = at
        elif last >= 0:
            return last
        before_x, before_y = x, y
    return last
