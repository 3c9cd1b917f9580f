"""The obstacle layer: rays clear, returns mark, the footprint is free.

Cells are flat, row by row. Every cell whose value changes is put on a list once (``flags``), for
the master grid to follow; several layers of a costmap share the list. Formulas are those of
costmap_2d's ``obstacle_layer`` and of ``raytraceLine`` and ``convexFillCells`` in ``costmap_2d.h``.

What a layer has heard is a table with a row for each scan of each source, in the order in which
the original goes through its buffers (:mod:`daemon.stacks.ros1.costmap._observations`).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import LETHAL
from grammars.model.geometry import Floats

Cells: TypeAlias = npt.NDArray[np.uint8]

STALE = 1
"""Flag: the master's value may be out of date."""
LOW = 2
"""Flag: somebody else wrote the master's value, which may be too low."""
LISTED = 128
"""Flag: on the list of this update."""
NEAREST, FARTHEST, HEIGHT, FIRST_RAY, RAYS, FIRST_DIRECTION = 3, 4, 5, 6, 7, 8
"""Columns of the table of scans; the first three are the pose of the laser."""
SCAN, OBSTACLE_RANGE, RAYTRACE_RANGE, MARKING, CLEARING, INFINITE, HEARD = 0, 1, 2, 3, 4, 5, 6
"""Columns of the table of what was heard: of a scan by a source."""
_BELOW_MAX_RANGE = np.float32(0.0001)


@kernel
def cell_value(cells: Cells, cell: int) -> int:
    """Return a cell as a signed number: numba makes real numbers of mixed signs."""
    return int(np.int64(cells[cell]))


@kernel
def set_cell(
    layer: Cells, cell: int, value: int, flags: Cells, queue: Integers, queued: int
) -> int:
    """Set a cell of the layer; list it if that changes it. Returns how many are listed."""
    if layer[cell] == value:
        return queued
    layer[cell] = value
    flag = flags[cell]
    flags[cell] = flag | STALE
    if flag == 0:
        flags[cell] = STALE | LISTED
        queue[queued] = cell
        return queued + 1
    return queued


@kernel
def grow_bounds(bounds: Floats, x: float, y: float) -> None:
    bounds[0], bounds[1] = min(bounds[0], x), min(bounds[1], y)
    bounds[2], bounds[3] = max(bounds[2], x), max(bounds[3], y)


@kernel
def project(
    ranges: Singles,
    directions: Floats,
    laser: Floats,
    range_min: float,
    range_max: float,
    infinite: bool,
    points: Singles,
) -> int:
    """Write the end points of valid rays in the global frame, return how many.

    A ray is valid from ``range_min`` up to but not including ``range_max`` (laser_geometry); with
    ``infinite``, a ray without return counts as one just short of ``range_max``.
    """
    # Clouds have single precision and are moved in it, by the matrix of a quaternion: 50 m from
    # the map's origin that is 4 um, enough for another cell now and then (``doTransform`` of
    # tf2_sensor_msgs).
    x0, y0 = np.float32(laser[0]), np.float32(laser[1])
    turn, w = np.float32(math.sin(laser[2] / 2.0)), np.float32(math.cos(laser[2] / 2.0))
    twice = turn + turn
    c, s = np.float32(1.0) - twice * turn, twice * w
    # A scan carries its limits as single precision, so a range clamped to one equals it.
    nearest, farthest = np.float32(range_min), np.float32(range_max)
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
def _clear_line(
    layer: Cells,
    columns: int,
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    most: int,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Clear along a Bresenham line of at most ``most`` cells, both ends included."""
    dx, dy = x1 - x0, y1 - y0
    across, up = abs(dx), abs(dy)
    step_x, step_y = (1 if dx > 0 else -1), (columns if dy > 0 else -columns)
    away = math.hypot(float(dx), float(dy))
    scale = 1.0 if away == 0.0 else min(1.0, most / away)
    cell = y0 * columns + x0
    if across >= up:
        long, short, step_long, step_short = across, up, step_x, step_y
    else:
        long, short, step_long, step_short = up, across, step_y, step_x
    error = long // 2
    for _ in range(int(scale * long)):
        if layer[cell] != 0:
            queued = set_cell(layer, cell, 0, flags, queue, queued)
        cell += step_long
        error += short
        if error >= long:
            cell += step_short
            error -= long
    if layer[cell] != 0:
        queued = set_cell(layer, cell, 0, flags, queue, queued)
    return queued


@kernel
def _clear_rays(
    layer: Cells,
    shape: tuple[int, int],
    frame: Floats,
    laser: Floats,
    points: Singles,
    count: int,
    reach: float,
    bounds: Floats,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Clear from the laser to every end point, cut off at the edge of the grid."""
    rows, columns = shape
    left, low, resolution = frame[0], frame[1], frame[2]
    ox, oy = laser[0], laser[1]
    if ox < left or oy < low:
        return queued
    x0, y0 = int((ox - left) / resolution), int((oy - low) / resolution)
    if x0 >= columns or y0 >= rows:
        return queued
    right, high = left + columns * resolution, low + rows * resolution
    most = int(max(0.0, math.ceil(reach / resolution)))
    grow_bounds(bounds, ox, oy)
    for i in range(count):
        wx, wy = float(points[i, 0]), float(points[i, 1])
        a, b = wx - ox, wy - oy
        if wx < left:
            wx, wy = left, oy + b * ((left - ox) / a)
        if wy < low:
            wx, wy = ox + a * ((low - oy) / b), low
        if wx > right:
            wx, wy = right - 0.001, oy + b * ((right - ox) / a)
        if wy > high:
            wx, wy = ox + a * ((high - oy) / b), high - 0.001
        if wx < left or wy < low:
            continue
        x1, y1 = int((wx - left) / resolution), int((wy - low) / resolution)
        if x1 >= columns or y1 >= rows:
            continue
        queued = _clear_line(layer, columns, x0, y0, x1, y1, most, flags, queue, queued)
        length = math.hypot(wx - ox, wy - oy)
        part = 1.0 if length == 0.0 else min(1.0, reach / length)
        grow_bounds(bounds, ox + (wx - ox) * part, oy + (wy - oy) * part)
    return queued


@kernel
def _mark(
    layer: Cells,
    shape: tuple[int, int],
    frame: Floats,
    laser: Floats,
    points: Singles,
    count: int,
    reach: float,
    bounds: Floats,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Make the cells of end points nearer than ``reach`` lethal."""
    rows, columns = shape
    left, low, resolution = frame[0], frame[1], frame[2]
    for i in range(count):
        px, py = float(points[i, 0]), float(points[i, 1])
        dx, dy = px - laser[0], py - laser[1]
        if dx * dx + dy * dy >= reach * reach or px < left or py < low:
            continue
        x, y = int((px - left) / resolution), int((py - low) / resolution)
        if x >= columns or y >= rows:
            continue
        queued = set_cell(layer, y * columns + x, LETHAL, flags, queue, queued)
        grow_bounds(bounds, px, py)
    return queued


@kernel
def polygon_spans(
    corners: Floats, shape: tuple[int, int], frame: Floats, first: Integers, last: Integers
) -> tuple[int, int]:
    """Return the half-open range of columns a convex polygon covers, empty off the grid.

    ``first`` and ``last`` (columns,) get the lowest and the highest row in each of them. With a
    corner off the grid nothing is covered (costmap_2d ``setConvexPolygonCost``).
    """
    rows, columns = shape
    count = corners.shape[0]
    cells = np.empty((count, 2), dtype=np.int64)
    begin, end = columns, 0
    for i in range(count):
        x, y = corners[i, 0] - frame[0], corners[i, 1] - frame[1]
        if x < 0.0 or y < 0.0:
            return 0, 0
        cells[i, 0], cells[i, 1] = int(x / frame[2]), int(y / frame[2])
        if cells[i, 0] >= columns or cells[i, 1] >= rows:
            return 0, 0
        begin, end = min(begin, cells[i, 0]), max(end, cells[i, 0] + 1)
    for x in range(begin, end):
        first[x], last[x] = rows, -1
    for i in range(count):
        k = (i + 1) % count
        x, y = cells[i, 0], cells[i, 1]
        dx, dy = cells[k, 0] - x, cells[k, 1] - y
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        flat = abs(dx) >= abs(dy)
        long, short = max(abs(dx), abs(dy)), min(abs(dx), abs(dy))
        error = long // 2
        for _ in range(long + 1):
            first[x], last[x] = min(first[x], y), max(last[x], y)
            error += short
            aside = error >= long
            if aside:
                error -= long
            x += step_x if flat or aside else 0
            y += step_y if not flat or aside else 0
            if long == 0:
                break
    return begin, end


@kernel
def _transform_corners(corners: Floats, x: float, y: float, yaw: float, bounds: Floats) -> Floats:
    """Return ``corners`` of the base frame in the global frame, within ``bounds`` from now on."""
    c, s = math.cos(yaw), math.sin(yaw)
    placed = np.empty_like(corners)
    for k in range(corners.shape[0]):
        placed[k, 0] = x + (corners[k, 0] * c - corners[k, 1] * s)
        placed[k, 1] = y + (corners[k, 0] * s + corners[k, 1] * c)
        grow_bounds(bounds, placed[k, 0], placed[k, 1])
    return placed


@kernel
def project_row(
    ranges: Singles, directions: Floats, scans: Floats, heard: Floats, k: int, points: Singles
) -> int:
    """Write the end points of the rays of row ``k`` that count, return how many."""
    if heard[k, HEARD] == 0.0:
        return 0
    scan = scans[int(heard[k, SCAN])]
    first, towards, rays = int(scan[FIRST_RAY]), int(scan[FIRST_DIRECTION]), int(scan[RAYS])
    return project(
        ranges[first : first + rays],
        directions[towards : towards + rays],
        scan[0:3],
        scan[NEAREST],
        scan[FARTHEST],
        heard[k, INFINITE] > 0.0,
        points,
    )


@kernel
def same_points(heard: Floats, k: int, other: int) -> bool:
    """Tell whether two rows are of the same scan and end their rays at the same points."""
    return (
        other >= 0
        and heard[k, SCAN] == heard[other, SCAN]
        and heard[k, INFINITE] == heard[other, INFINITE]
        and heard[k, HEARD] == heard[other, HEARD]
    )


@kernel
def free_footprint(
    layer: Cells,
    shape: tuple[int, int],
    frame: Floats,
    base: Floats,
    footprint: Floats,
    first: Integers,
    last: Integers,
    bounds: Floats,
    flags: Cells,
    queue: Integers,
    queued: int,
) -> int:
    """Free the cells under the footprint with the robot at ``base`` (x, y, yaw)."""
    if footprint.shape[0] == 0:
        return queued
    corners = _transform_corners(footprint, base[0], base[1], base[2], bounds)
    begin, end = polygon_spans(corners, shape, frame, first, last)
    for x in range(begin, end):
        for y in range(first[x], last[x] + 1):
            queued = set_cell(layer, y * shape[1] + x, 0, flags, queue, queued)
    return queued


@kernel
def observe(
    layer: Cells,
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
    """Bring the layer up to date; return how many cells are listed in ``queue`` now.

    ``base`` is the pose of the base; ``heard`` has a row for each of the ``scans`` that a source
    knows of, ``footprint`` (corners in the base frame) none when the layer does not clear it.
    ``bounds`` (x0, y0, x1, y1) [m] grow around all that was looked at.
    """
    count, projected = 0, -1
    # All sources clear before any marks, as in ``updateBounds``: marked cells survive the rays of
    # other sources.
    for task in (CLEARING, MARKING):
        for k in range(heard.shape[0]):
            if heard[k, task] == 0.0:
                continue
            if not same_points(heard, k, projected):
                count = project_row(ranges, directions, scans, heard, k, points)
                projected = k
            laser = scans[int(heard[k, SCAN]), 0:3]
            if task == CLEARING:
                reach = heard[k, RAYTRACE_RANGE]
                queued = _clear_rays(
                    layer, shape, frame, laser, points, count, reach, bounds, flags, queue, queued
                )
            else:
                reach = heard[k, OBSTACLE_RANGE]
                queued = _mark(
                    layer, shape, frame, laser, points, count, reach, bounds, flags, queue, queued
                )
    # The footprint last: where the robot stands is free, whatever was marked there.
    return free_footprint(
        layer, shape, frame, base, footprint, first, last, bounds, flags, queue, queued
    )
