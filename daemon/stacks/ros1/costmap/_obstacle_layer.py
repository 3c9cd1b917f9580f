"""Obstacle layer: rays clear, returns mark, the footprint is free.

Formulas are those of costmap_2d's ``obstacle_layer`` and of ``raytraceLine`` and
``convexFillCells`` in ``costmap_2d.h``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import FREE_SPACE, LETHAL
from daemon.stacks.ros1.costmap._grids import (
    Changes,
    Frame,
    Grid,
    Numbers,
    cell_at,
    grow_bounds,
    note_change,
)
from grammars.model.geometry import Floats

_BELOW_MAX_RANGE = np.float32(0.0001)


class LaserPose(NamedTuple):
    """Pose of a laser in the costmap's frame [m, rad], and the limits of its ranges [m]."""

    x: float
    y: float
    yaw: float
    height: float
    nearest: float
    farthest: float


@kernel
def project(
    laser: LaserPose, ranges: Singles, directions: Floats, infinite: bool, points: Singles
) -> int:
    """Write the end points of valid rays in the global frame, and return their number.

    A ray is valid from ``nearest`` up to but not including ``farthest`` (laser_geometry). With
    ``infinite``, a ray without return counts as one just short of ``farthest``.
    """
    # Clouds have single precision and are moved in it, by the matrix of a quaternion
    # (``doTransform`` of tf2_sensor_msgs). 50 m from the map's origin that is 4 um, sometimes
    # another cell.
    x0, y0 = np.float32(laser.x), np.float32(laser.y)
    turn, w = np.float32(math.sin(laser.yaw / 2.0)), np.float32(math.cos(laser.yaw / 2.0))
    twice = turn + turn
    c, s = np.float32(1.0) - twice * turn, twice * w
    # A scan carries its limits as single precision, so a range clamped to one equals it.
    nearest, farthest = np.float32(laser.nearest), np.float32(laser.farthest)
    count = 0
    for i in range(ranges.shape[0]):
        away = ranges[i]
        if infinite and away == np.inf:
            away = farthest - _BELOW_MAX_RANGE
        if not (away >= nearest and away < farthest):
            continue
        x, y = np.float32(away * directions[i, 0]), np.float32(away * directions[i, 1])
        points[count, 0] = c * x - s * y + x0
        points[count, 1] = s * x + c * y + y0
        count += 1
    return count


@kernel
def _cut_ray(frame: Frame, ox: float, oy: float, wx: float, wy: float) -> tuple[float, float]:
    """Return where a ray from (ox, oy) to (wx, wy) [m] ends, at most at the edge of the grid."""
    left, low, resolution = frame.x, frame.y, frame.resolution
    right, high = left + frame.columns * resolution, low + frame.rows * resolution
    a, b = wx - ox, wy - oy
    if wx < left:
        wx, wy = left, oy + b * ((left - ox) / a)
    if wy < low:
        wx, wy = ox + a * ((low - oy) / b), low
    if wx > right:
        wx, wy = right - 0.001, oy + b * ((right - ox) / a)
    if wy > high:
        wx, wy = ox + a * ((high - oy) / b), high - 0.001
    return wx, wy


@kernel
def clear_rays(
    grid: Grid, changes: Changes, laser: LaserPose, points: Singles, reach: float
) -> None:
    """Clear from the laser to every end point, at most to the edge of the grid.

    Each ray clears a Bresenham line of at most ``reach`` [m], both ends included.
    """
    cells, frame = grid
    ox, oy = laser.x, laser.y
    x0, y0 = cell_at(frame, ox, oy)
    if x0 < 0:
        return
    most = int(max(0.0, math.ceil(reach / frame.resolution)))
    grow_bounds(changes.bounds, ox, oy)
    for i in range(points.shape[0]):
        wx, wy = _cut_ray(frame, ox, oy, np.float64(points[i, 0]), np.float64(points[i, 1]))
        x1, y1 = cell_at(frame, wx, wy)
        if x1 < 0:
            continue
        # Inlined, because passing arrays to a function for every ray took longer.
        dx, dy = x1 - x0, y1 - y0
        across, up = abs(dx), abs(dy)
        step_x, step_y = (1 if dx > 0 else -1), (frame.columns if dy > 0 else -frame.columns)
        away = math.hypot(float(dx), float(dy))
        scale = 1.0 if away == 0.0 else min(1.0, most / away)
        cell = y0 * frame.columns + x0
        if across >= up:
            long, short, step_long, step_short = across, up, step_x, step_y
        else:
            long, short, step_long, step_short = up, across, step_y, step_x
        error = long // 2
        for _ in range(int(scale * long) + 1):
            if cells[cell] != FREE_SPACE:
                cells[cell] = FREE_SPACE
                note_change(changes, cell)
            cell += step_long
            error += short
            if error >= long:
                cell += step_short
                error -= long
        length = math.hypot(wx - ox, wy - oy)
        part = 1.0 if length == 0.0 else min(1.0, reach / length)
        grow_bounds(changes.bounds, ox + (wx - ox) * part, oy + (wy - oy) * part)


@kernel
def mark(grid: Grid, changes: Changes, laser: LaserPose, points: Singles, reach: float) -> None:
    """Make the cells of end points nearer than ``reach`` lethal."""
    for i in range(points.shape[0]):
        x, y = np.float64(points[i, 0]), np.float64(points[i, 1])
        dx, dy = x - laser.x, y - laser.y
        if dx * dx + dy * dy >= reach * reach:
            continue
        column, row = cell_at(grid.frame, x, y)
        if column < 0:
            continue
        cell = row * grid.frame.columns + column
        if grid.cells[cell] != LETHAL:
            grid.cells[cell] = LETHAL
            note_change(changes, cell)
        grow_bounds(changes.bounds, x, y)


@kernel
def polygon_spans(corners: Floats, frame: Frame) -> Numbers:
    """Return the lowest and the highest row of each column under a convex polygon, (2, columns).

    All columns are empty, the lowest row above the highest, if a corner lies off the grid
    (costmap_2d ``setConvexPolygonCost``).
    """
    count = corners.shape[0]
    spans = np.empty((2, frame.columns), dtype=np.int64)
    spans[0], spans[1] = frame.rows, -1
    for i in range(count):
        column, _ = cell_at(frame, corners[i, 0], corners[i, 1])
        if column < 0:
            return spans
    for i in range(count):
        k = (i + 1) % count
        x, y = cell_at(frame, corners[i, 0], corners[i, 1])
        x1, y1 = cell_at(frame, corners[k, 0], corners[k, 1])
        dx, dy = x1 - x, y1 - y
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        flat = abs(dx) >= abs(dy)
        long, short = max(abs(dx), abs(dy)), min(abs(dx), abs(dy))
        error = long // 2
        for _ in range(long + 1):
            spans[0, x], spans[1, x] = min(spans[0, x], y), max(spans[1, x], y)
            error += short
            aside = error >= long
            if aside:
                error -= long
            x += step_x if flat or aside else 0
            y += step_y if not flat or aside else 0
            if long == 0:
                break
    return spans


@kernel
def free_footprint(
    grid: Grid, changes: Changes, footprint: Floats, x: float, y: float, yaw: float
) -> None:
    """Free the cells under the ``footprint`` (k, 2) with the robot at (x, y, yaw)."""
    c, s = math.cos(yaw), math.sin(yaw)
    corners = np.empty((footprint.shape[0], 2))
    for k in range(footprint.shape[0]):
        corners[k, 0] = x + (footprint[k, 0] * c - footprint[k, 1] * s)
        corners[k, 1] = y + (footprint[k, 0] * s + footprint[k, 1] * c)
        grow_bounds(changes.bounds, corners[k, 0], corners[k, 1])
    spans = polygon_spans(corners, grid.frame)
    for column in range(grid.frame.columns):
        for row in range(spans[0, column], spans[1, column] + 1):
            cell = row * grid.frame.columns + column
            if grid.cells[cell] != FREE_SPACE:
                grid.cells[cell] = FREE_SPACE
                note_change(changes, cell)
