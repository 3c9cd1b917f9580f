"""Voxel layer: an obstacle layer that distinguishes heights, for level lasers.

A column of up to sixteen voxels stands on every cell. A return marks its voxel, a ray clears the
voxels on its way. The numbers of marked and unknown voxels make the cell lethal, free or unknown.
Formulas are those of costmap_2d's ``voxel_layer`` and of ``voxel_grid``. Its rays differ from those
of the obstacle layer: they end two cells before the return and at the middle of the last cell, and
they are counted along all three axes.

A column is a number of 32 bits, as in the original: bits of marked voxels in the upper half, bits
of marked or unknown voxels in the lower half.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import FREE_SPACE, LETHAL, NO_INFORMATION
from daemon.stacks.ros1.costmap._grids import (
    Changes,
    Frame,
    Grid,
    cell_at,
    grow_bounds,
    note_change,
)
from daemon.stacks.ros1.costmap._obstacle_layer import LaserPose
from daemon.stacks.ros1.costmap.layers import VoxelLayer

Columns: TypeAlias = npt.NDArray[np.uint32]
Place: TypeAlias = tuple[float, float, float]
"""x, y and z, in metres or in cells and voxels."""
_BITS = 16
UNKNOWN_COLUMN = 0xFFFF
"""An unseen column: all voxels unknown, also those above its top."""


class Heights(NamedTuple):
    """Voxels of height ``step`` from ``bottom`` on [m], ``levels`` of them in a column.

    A cell is lethal with more than ``marked`` marked voxels, otherwise unknown with more than
    ``unknown`` unknown ones. Rays are cut off at ``ceiling`` [m].
    """

    bottom: float
    step: float
    levels: int
    unknown: int
    marked: int
    ceiling: float


class Voxels(NamedTuple):
    """Columns of a layer, one on each cell, and their heights."""

    columns: Columns
    heights: Heights


def voxels_of(layer: VoxelLayer, cells: int) -> Voxels:
    """Return unseen columns for a number of ``cells``."""
    heights = Heights(
        layer.origin_z,
        layer.z_resolution,
        layer.z_voxels,
        # The voxels above the top of a column stay unknown for ever and must not count.
        layer.unknown_threshold + _BITS - layer.z_voxels,
        layer.mark_threshold,
        layer.max_obstacle_height,
    )
    return Voxels(np.full(cells, UNKNOWN_COLUMN, dtype=np.uint32), heights)


@kernel
def _count_bits(number: int) -> int:
    count = 0
    while number != 0:
        number &= number - 1
        count += 1
    return count


@kernel
def _ratio(numerator: float, denominator: float) -> float:
    """Divide as C++ does, also by zero, where numba raises."""
    if denominator != 0.0:
        return numerator / denominator
    if numerator == 0.0 or numerator != numerator:
        return np.nan
    return np.inf if numerator > 0.0 else -np.inf


@kernel
def _clear_line(
    grid: Grid, changes: Changes, voxels: Voxels, begin: Place, end: Place, most: int
) -> None:
    """Clear from ``begin`` to ``end`` (x, y, z in cells), at most ``most`` cells."""
    layer, columns, width = grid.cells, voxels.columns, grid.frame.columns
    x, y, level = int(begin[0]), int(begin[1]), int(begin[2])
    dx, dy, dz = int(end[0]) - x, int(end[1]) - y, int(end[2]) - level
    across, along, up = abs(dx), abs(dy), abs(dz)
    step_x, step_y, step_z = (1 if dx > 0 else -1), (width if dy > 0 else -width), 1
    if dz <= 0:
        step_z = -1
    # One of the three axes leads; the others advance when their error is large enough.
    if across >= max(along, up):
        lead, second, third = across, along, up
        cells_lead, cells_second, cells_third = step_x, step_y, 0
        levels_lead, levels_third = 0, step_z
    elif along >= up:
        lead, second, third = along, across, up
        cells_lead, cells_second, cells_third = step_y, step_x, 0
        levels_lead, levels_third = 0, step_z
    else:
        lead, second, third = up, across, along
        cells_lead, cells_second, cells_third = 0, step_x, step_y
        levels_lead, levels_third = step_z, 0
    a, b, c = begin[0] - end[0], begin[1] - end[1], begin[2] - end[2]
    away = math.sqrt(a * a + b * b + c * c)
    scale = 1.0 if away == 0.0 else min(1.0, most / away)
    cell, second_error, third_error = y * width + x, lead // 2, lead // 2
    unknown, marked = voxels.heights.unknown, voxels.heights.marked
    # Inlined, because passing arrays to a function for every voxel was ten times as slow.
    for _ in range(min(int(scale * lead), lead) + 1):
        before = int(np.int64(columns[cell]))
        column = before & ~(0x10001 << level)
        if column != before:
            columns[cell] = column
        # The cell follows unless too many other voxels of the column are marked.
        above = column >> _BITS
        if above == 0 or _count_bits(above) <= marked:
            value = FREE_SPACE
            if unknown < _BITS and _count_bits(above ^ (column & 0xFFFF)) > unknown:
                value = NO_INFORMATION
            if layer[cell] != value:
                layer[cell] = value
                note_change(changes, cell)
        cell += cells_lead
        level += levels_lead
        second_error += second
        third_error += third
        if second_error >= lead:
            cell += cells_second
            second_error -= lead
        if third_error >= lead:
            cell += cells_third
            level += levels_third
            third_error -= lead


@kernel
def _to_cells(frame: Frame, heights: Heights, x: float, y: float, z: float) -> tuple[bool, Place]:
    """Return whether a point [m] is on the grid, and its place in cells and voxels."""
    u, v = (x - frame.x) / frame.resolution, (y - frame.y) / frame.resolution
    w = (z - heights.bottom) / heights.step
    inside = x >= frame.x and y >= frame.y and z >= heights.bottom
    return inside and u < frame.columns and v < frame.rows and w < heights.levels, (u, v, w)


@kernel
def _cut(part: float, begin: float, end: float, low: float, cells: int, resolution: float) -> float:
    """Return the part of the way from ``begin`` to ``end`` on the grid, at most ``part``."""
    # costmap_2d takes the middle of the last cell for the size of a grid.
    high = low + (cells - 1 + 0.5) * resolution
    if end < low:
        part = min(part, _ratio(low - begin, end - begin))
    if end > high:
        part = min(part, _ratio(high - begin, end - begin))
    return part


@kernel
def _part_inside(
    frame: Frame, heights: Heights, laser: LaserPose, x: float, y: float, z: float
) -> float:
    """Return the part of the way from the laser to a point [m] that lies in the grid."""
    part = 1.0
    if z > heights.ceiling:
        above = heights.ceiling - 0.01 - laser.height
        part = max(0.0, min(part, _ratio(above, z - laser.height)))
    elif z < heights.bottom:
        part = min(part, _ratio(heights.bottom - laser.height, z - laser.height))
    part = _cut(part, laser.x, x, frame.x, frame.columns, frame.resolution)
    return _cut(part, laser.y, y, frame.y, frame.rows, frame.resolution)


@kernel
def clear_voxels(
    grid: Grid, changes: Changes, voxels: Voxels, laser: LaserPose, points: Singles, reach: float
) -> None:
    """Clear from the laser towards every end point."""
    frame, heights = grid.frame, voxels.heights
    ox, oy, oz = laser.x, laser.y, laser.height
    inside, begin = _to_cells(frame, heights, ox, oy, oz)
    if not inside:
        return
    most = int(max(0.0, math.ceil(reach / frame.resolution)))
    height = np.float64(np.float32(oz))
    for i in range(points.shape[0]):
        x, y = np.float64(points[i, 0]), np.float64(points[i, 1])
        a, b, c = x - ox, y - oy, height - oz
        away = math.sqrt(a * a + b * b + c * c)
        # A ray ends two cells before its return.
        share = 0.0 if away == 0.0 else max(min(1.0, (away - 2.0 * frame.resolution) / away), 0.0)
        x, y, z = share * a + ox, share * b + oy, share * c + oz
        part = _part_inside(frame, heights, laser, x, y, z)
        x, y, z = ox + (x - ox) * part, oy + (y - oy) * part, oz + (z - oz) * part
        inside, end = _to_cells(frame, heights, x, y, z)
        if not inside:
            continue
        _clear_line(grid, changes, voxels, begin, end, most)
        dx, dy = x - ox, y - oy
        length = math.hypot(dx, dy)
        part = 1.0 if length == 0.0 else min(1.0, reach / length)
        grow_bounds(changes.bounds, ox + dx * part, oy + dy * part)


@kernel
def mark_voxels(
    grid: Grid, changes: Changes, voxels: Voxels, laser: LaserPose, points: Singles, reach: float
) -> None:
    """Mark the voxels of end points nearer than ``reach``."""
    heights, height = voxels.heights, np.float64(np.float32(laser.height))
    level = (max(height, heights.bottom) - heights.bottom) / heights.step
    if level >= heights.levels:
        return
    bits = 0x10001 << int(level)
    up = height - laser.height
    for i in range(points.shape[0]):
        x, y = np.float64(points[i, 0]), np.float64(points[i, 1])
        dx, dy = x - laser.x, y - laser.y
        if dx * dx + dy * dy + up * up >= reach * reach:
            continue
        column, row = cell_at(grid.frame, x, y)
        if column < 0:
            continue
        cell = row * grid.frame.columns + column
        marked = int(np.int64(voxels.columns[cell])) | bits
        voxels.columns[cell] = marked
        if _count_bits(marked >> _BITS) > heights.marked:
            if grid.cells[cell] != LETHAL:
                grid.cells[cell] = LETHAL
                note_change(changes, cell)
            grow_bounds(changes.bounds, x, y)
