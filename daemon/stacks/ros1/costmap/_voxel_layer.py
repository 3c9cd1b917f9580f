"""The voxel layer: an obstacle layer that tells heights apart, over lasers that lie level.

A column of up to sixteen voxels stands on every cell. A return marks the voxel it lies in, a ray
clears the voxels it passes through, and the cell is lethal, free or unknown by how many voxels of
its column are marked and unknown. Formulas are those of costmap_2d's ``voxel_layer`` and of
``voxel_grid``, whose rays differ from those of the obstacle layer: they end two cells before the
return, are cut off at the middle of the last cell, and are counted along all three axes.

A column is a number of 32 bits, as in the original: the upper half says which voxels are marked,
the lower half which are marked or unknown.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import FREE_SPACE, LETHAL, NO_INFORMATION
from daemon.stacks.ros1.costmap._obstacle_layer import (
    CLEARING,
    HEIGHT,
    MARKING,
    OBSTACLE_RANGE,
    RAYTRACE_RANGE,
    SCAN,
    Cells,
    free_footprint,
    grow_bounds,
    project_row,
    same_points,
    set_cell,
)
from daemon.stacks.ros1.costmap.layers import VoxelLayer
from grammars.model.geometry import Floats

Columns: TypeAlias = npt.NDArray[np.uint32]
_BITS = 16
UNKNOWN_COLUMN = 0xFFFF
"""A column nobody has looked at: all voxels unknown, also those above its top."""
_BOTTOM, _STEP, _LEVELS, _UNKNOWN, _MARKED, _MAX_HEIGHT = 0, 1, 2, 3, 4, 5
"""Places in the array of heights."""


def heights_of(layer: VoxelLayer) -> Floats:
    """Return what the kernels need to know of a layer's columns."""
    # The voxels above the top of a column stay unknown for ever, and are not to count.
    unknown = layer.unknown_threshold + _BITS - layer.z_voxels
    return np.array(
        [
            *(layer.origin_z, layer.z_resolution, layer.z_voxels),
            *(unknown, layer.mark_threshold, layer.max_obstacle_height),
        ],
        dtype=np.float64,
    )


@kernel
def _count_bits(number: int) -> int:
    count = 0
    while number != 0:
        number &= number - 1
        count += 1
    return count


@kernel
def _ratio(numerator: float, denominator: float) -> float:
    """Divide as C++ does, where numba raises: by a zero that came of a difference."""
    if denominator != 0.0:
        return numerator / denominator
    if numerator == 0.0 or numerator != numerator:
        return np.nan
    return np.inf if numerator > 0.0 else -np.inf


@kernel
def _clear_line(
    layer: Cells,
    voxels: Columns,
    width: int,
    begin: Floats,
    end: Floats,
    most: int,
    heights: Floats,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Clear from ``begin`` to ``end`` (x, y, z in cells), at most ``most`` cells of the way."""
    x, y, level = int(begin[0]), int(begin[1]), int(begin[2])
    dx, dy, dz = int(end[0]) - x, int(end[1]) - y, int(end[2]) - level
    across, along, up = abs(dx), abs(dy), abs(dz)
    step_x, step_y, step_z = (1 if dx > 0 else -1), (width if dy > 0 else -width), 1
    if dz <= 0:
        step_z = -1
    # One of the three leads; each of the others moves on when its error is large enough.
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
    unknown, marked = int(heights[_UNKNOWN]), int(heights[_MARKED])
    # The inside of this loop is no function of its own: arrays handed on for every voxel made it
    # ten times as slow.
    for _ in range(min(int(scale * lead), lead) + 1):
        before = int(np.int64(voxels[cell]))
        column = before & ~(0x10001 << level)
        if column != before:
            voxels[cell] = column
        # The cell follows unless too many other voxels of the column are marked.
        above = column >> _BITS
        if above == 0 or _count_bits(above) <= marked:
            value = FREE_SPACE
            if unknown < _BITS and _count_bits(above ^ (column & 0xFFFF)) > unknown:
                value = NO_INFORMATION
            if layer[cell] != value:
                queued = set_cell(layer, cell, value, flags, queue, queued)
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
    return queued


@kernel
def _to_cells(
    x: float, y: float, z: float, shape: tuple[int, int], frame: Floats, heights: Floats, to: Floats
) -> bool:
    """Write where a point [m] lies in cells and voxels; false off the grid."""
    if x < frame[0] or y < frame[1] or z < heights[_BOTTOM]:
        return False
    to[0], to[1] = (x - frame[0]) / frame[2], (y - frame[1]) / frame[2]
    to[2] = (z - heights[_BOTTOM]) / heights[_STEP]
    return bool(to[0] < shape[1] and to[1] < shape[0] and to[2] < heights[_LEVELS])


@kernel
def _part_inside(
    laser: Floats, way: Floats, end: Floats, shape: tuple[int, int], frame: Floats, heights: Floats
) -> float:
    """Return how much of the ``way`` from ``laser`` to ``end`` is in the grid to be raytraced."""
    part = 1.0
    if end[2] > heights[_MAX_HEIGHT]:
        part = max(0.0, min(part, _ratio(heights[_MAX_HEIGHT] - 0.01 - laser[2], way[2])))
    elif end[2] < heights[_BOTTOM]:
        part = min(part, _ratio(heights[_BOTTOM] - laser[2], way[2]))
    for k in range(2):
        low = frame[k]
        # The middle of the last cell: what costmap_2d takes for the size of a grid.
        high = low + (shape[1 - k] - 1 + 0.5) * frame[2]
        if end[k] < low:
            part = min(part, _ratio(low - laser[k], way[k]))
        if end[k] > high:
            part = min(part, _ratio(high - laser[k], way[k]))
    return part


@kernel
def _clear_rays(
    layer: Cells,
    voxels: Columns,
    shape: tuple[int, int],
    frame: Floats,
    laser: Floats,
    points: Singles,
    count: int,
    reach: float,
    heights: Floats,
    bounds: Floats,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Clear from ``laser`` (x, y, z) towards every end point."""
    begin, end = np.empty(3), np.empty(3)
    if count == 0 or not _to_cells(laser[0], laser[1], laser[2], shape, frame, heights, begin):
        return queued
    most = int(max(0.0, math.ceil(reach / frame[2])))
    height = float(np.float32(laser[2]))
    at, way = np.empty(3), np.empty(3)
    for i in range(count):
        at[0], at[1], at[2] = float(points[i, 0]), float(points[i, 1]), height
        a, b, c = at[0] - laser[0], at[1] - laser[1], at[2] - laser[2]
        away = math.sqrt(a * a + b * b + c * c)
        # A ray ends two cells before its return.
        share = 0.0 if away == 0.0 else max(min(1.0, (away - 2.0 * frame[2]) / away), 0.0)
        for k in range(3):
            at[k] = share * (at[k] - laser[k]) + laser[k]
            way[k] = at[k] - laser[k]
        part = _part_inside(laser, way, at, shape, frame, heights)
        for k in range(3):
            at[k] = laser[k] + way[k] * part
        if not _to_cells(at[0], at[1], at[2], shape, frame, heights, end):
            continue
        queued = _clear_line(
            layer, voxels, shape[1], begin, end, most, heights, flags, queue, queued
        )
        dx, dy = at[0] - laser[0], at[1] - laser[1]
        length = math.hypot(dx, dy)
        part = 1.0 if length == 0.0 else min(1.0, reach / length)
        grow_bounds(bounds, laser[0] + dx * part, laser[1] + dy * part)
    return queued


@kernel
def _mark(
    layer: Cells,
    voxels: Columns,
    shape: tuple[int, int],
    frame: Floats,
    laser: Floats,
    points: Singles,
    count: int,
    reach: float,
    heights: Floats,
    bounds: Floats,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Mark the voxels of end points nearer than ``reach``; ``laser`` is x, y, z."""
    height = float(np.float32(laser[2]))
    level = (max(height, heights[_BOTTOM]) - heights[_BOTTOM]) / heights[_STEP]
    if level >= heights[_LEVELS]:
        return queued
    bits = 0x10001 << int(level)
    left, low, resolution = frame[0], frame[1], frame[2]
    up = height - laser[2]
    for i in range(count):
        px, py = float(points[i, 0]), float(points[i, 1])
        dx, dy = px - laser[0], py - laser[1]
        if dx * dx + dy * dy + up * up >= reach * reach or px < left or py < low:
            continue
        x, y = int((px - left) / resolution), int((py - low) / resolution)
        if x >= shape[1] or y >= shape[0]:
            continue
        cell = y * shape[1] + x
        column = int(np.int64(voxels[cell])) | bits
        voxels[cell] = column
        if _count_bits(column >> _BITS) > heights[_MARKED]:
            queued = set_cell(layer, cell, LETHAL, flags, queue, queued)
            grow_bounds(bounds, px, py)
    return queued


@kernel
def observe_voxels(
    layer: Cells,
    voxels: Columns,
    heights: Floats,
    shape: tuple[int, int],
    frame: Floats,
    ranges: Singles,
    directions: Floats,
    base: Floats,
    scans: Floats,
    heard: Floats,
    points: Singles,
    footprint: Floats,
    first: Integers,
    last: Integers,
    bounds: Floats,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Bring the layer and its columns up to date, as ``observe`` of the obstacle layer does."""
    count, projected = 0, -1
    laser = np.empty(3)
    for task in (CLEARING, MARKING):
        for k in range(heard.shape[0]):
            if heard[k, task] == 0.0:
                continue
            if not same_points(heard, k, projected):
                count = project_row(ranges, directions, scans, heard, k, points)
                projected = k
            scan = scans[int(heard[k, SCAN])]
            laser[0], laser[1], laser[2] = scan[0], scan[1], scan[HEIGHT]
            if task == CLEARING:
                queued = _clear_rays(
                    layer, voxels, shape, frame, laser, points, count, heard[k, RAYTRACE_RANGE],
                    heights, bounds, flags, queue, queued,
                )  # fmt: skip
            else:
                queued = _mark(
                    layer, voxels, shape, frame, laser, points, count, heard[k, OBSTACLE_RANGE],
                    heights, bounds, flags, queue, queued,
                )  # fmt: skip
    # The columns under the footprint stay as they are; only the cells are free.
    return free_footprint(
        layer, shape, frame, base, footprint, first, last, bounds, flags, queue, queued
    )
