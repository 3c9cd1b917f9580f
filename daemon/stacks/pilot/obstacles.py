"""What the scans show and the map does not: marked cells, cleared by sight, forgotten in time."""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.pilot.map_field import MapField
from grammars.model.geometry import Floats, Pose2
from grammars.model.robot import Laser

_HINGE = 0.3
"""Returns this near to an obstacle the map does not show may belong to it [m]."""


@kernel
def clear_cells(
    cells: Integers,
    count: int,
    stamps: Integers,
    oldest: int,
    columns: int,
    x0: float,
    y0: float,
    resolution: float,
    sensor: Floats,
    first: float,
    step: float,
    ranges: Singles,
    reach: float,
    margin: float,
) -> int:
    """Drop cells that a ray looks through or that were last seen before ``oldest``.

    Each marked cell asks the ray that points at it, which costs nothing for the empty space the
    other rays cross and leaves no gaps between rays. Returns how many cells stay.
    """
    kept = 0
    rays = ranges.shape[0]
    for i in range(count):
        cell = cells[i]
        dx = x0 + (cell % columns + 0.5) * resolution - sensor[0]
        dy = y0 + (cell // columns + 0.5) * resolution - sensor[1]
        away2 = dx * dx + dy * dy
        gone = stamps[cell] < oldest
        if not gone and away2 < reach * reach:
            angle = math.atan2(dy, dx) - sensor[2] - first
            angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))
            ray = round(angle / step) if step > 0.0 else 0
            if ray < rays and abs(angle - ray * step) <= step:
                # A lost ray is nan and compares false: it clears nothing.
                gone = ranges[ray] > math.sqrt(away2) + margin
        if gone:
            stamps[cell] = 0
        else:
            cells[kept] = cell
            kept += 1
    return kept


@kernel
def mark_cells(
    points: Floats,
    known: np.ndarray,
    count: int,
    pose: Floats,
    surface: Singles,
    x0: float,
    y0: float,
    resolution: float,
    explained: float,
    reach: float,
    stamp: int,
    stamps: Integers,
    cells: Integers,
    marked: int,
) -> int:
    """Mark the cells of returns the map does not explain; return the new number of cells.

    ``known[i]`` becomes 1 for a return that lies within ``explained`` [m] of a painted wall or
    behind it, else 0. Returns farther than ``reach`` from the base are not marked.
    """
    rows, columns = surface.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(count):
        px, py = points[i, 0], points[i, 1]
        known[i] = 1
        column = math.floor((pose[0] + c * px - s * py - x0) / resolution)
        row = math.floor((pose[1] + s * px + c * py - y0) / resolution)
        if row < 0 or column < 0 or row >= rows or column >= columns:
            known[i] = 0
            continue
        if surface[row, column] <= explained:
            continue
        known[i] = 0
        if px * px + py * py > reach * reach:
            continue
        cell = row * columns + column
        if stamps[cell] == 0:
            cells[marked] = cell
            marked += 1
        stamps[cell] = stamp
    return marked


@kernel
def stamp_clearance(
    clearance: Singles, cells: Integers, count: int, resolution: float, reach: float
) -> None:
    """Lower ``clearance`` [m] in place around marked cells, out to ``reach`` [m]."""
    rows, columns = clearance.shape
    span = math.ceil(reach / resolution)
    for i in range(count):
        row, column = cells[i] // columns, cells[i] % columns
        for r in range(max(0, row - span), min(rows, row + span + 1)):
            for c in range(max(0, column - span), min(columns, column + span + 1)):
                away = resolution * (math.hypot(float(r - row), float(c - column)) - 0.5)
                if away < clearance[r, c]:
                    clearance[r, c] = max(away, 0.0)


@kernel
def first_blocked(
    path: Floats,
    begin: int,
    end: int,
    cells: Integers,
    count: int,
    columns: int,
    x0: float,
    y0: float,
    resolution: float,
    radius: float,
) -> int:
    """Return the first index in [begin, end) with a marked cell within ``radius`` [m], or -1."""
    limit = radius * radius
    for i in range(begin, end):
        u = (path[i, 0] - x0) / resolution - 0.5
        v = (path[i, 1] - y0) / resolution - 0.5
        for k in range(count):
            dc, dr = cells[k] % columns - u, cells[k] // columns - v
            if (dc * dc + dr * dr) * resolution * resolution < limit:
                return i
    return -1


@kernel
def append_nearby(
    cells: Integers,
    count: int,
    columns: int,
    x0: float,
    y0: float,
    resolution: float,
    pose: Floats,
    reach: float,
    points: Floats,
    used: int,
) -> int:
    """Append the centres of marked cells within ``reach`` of the base to ``points`` (base frame).

    ``points[:used]`` stay; returns the new number of points (never above its capacity).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(count):
        dx = x0 + (cells[i] % columns + 0.5) * resolution - pose[0]
        dy = y0 + (cells[i] // columns + 0.5) * resolution - pose[1]
        if dx * dx + dy * dy <= reach * reach and used < points.shape[0]:
            points[used, 0] = c * dx + s * dy
            points[used, 1] = c * dy - s * dx
            used += 1
    return used


@kernel
def _within_hinge(dx: float, dy: float) -> bool:
    return dx * dx + dy * dy < _HINGE * _HINGE


@kernel
def select_map_returns(
    points: Floats,
    count: int,
    pose: Floats,
    stamps: Integers,
    rows: int,
    columns: int,
    x0: float,
    y0: float,
    resolution: float,
    spacing: float,
    result: Floats,
) -> int:
    """Write points that tell something about the map into ``result``; return how many.

    Of returns closer together than ``spacing`` [m] only the first is kept: they share the error of
    one map cell, and a leaf in front of the laser must not outvote the wall behind it. Returns on
    or beside a marked cell are left out, and so are their neighbours up to ``_HINGE`` away: the
    end of a leaf that touches the wall would turn the wall with it.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    kept = 0
    last_x = last_y = odd_x = odd_y = 1e9
    for i in range(count):
        px, py = points[i, 0], points[i, 1]
        if (px - last_x) ** 2 + (py - last_y) ** 2 < spacing * spacing:
            continue
        last_x, last_y = px, py
        column = math.floor((pose[0] + c * px - s * py - x0) / resolution)
        row = math.floor((pose[1] + s * px + c * py - y0) / resolution)
        marked = False
        for r in range(max(0, row - 1), min(rows, row + 2)):
            for k in range(max(0, column - 1), min(columns, column + 2)):
                marked = marked or stamps[r * columns + k] != 0
        if marked:
            odd_x, odd_y = px, py
            while kept > 0 and _within_hinge(result[kept - 1, 0] - px, result[kept - 1, 1] - py):
                kept -= 1
        elif not _within_hinge(px - odd_x, py - odd_y):
            result[kept, 0], result[kept, 1] = px, py
            kept += 1
    return kept


class UnmappedObstacles:
    """Cells of the map that scans found occupied although the map says free."""

    def __init__(self, field: MapField, *, explained: float, reach: float, memory: int) -> None:
        """``memory`` counts scans, of whatever laser."""
        self._field = field
        self._explained, self._reach, self._memory = explained, reach, memory
        self._stamps = np.zeros(field.clearance.size, dtype=np.int32)
        self.cells = np.zeros(1024, dtype=np.int32)
        self.count = 0
        self._now = 0
        self._pose, self._sensor = np.zeros(3), np.zeros(3)

    def update(self, laser: Laser, ranges: Singles, points: Floats, known: np.ndarray, count: int,
               base: Pose2) -> None:  # fmt: skip
        """Take one scan of ``laser`` seen from ``base``: clear what it looks through, mark what it
        hits.

        ``points[:count]`` are its returns in the base frame; ``known`` (rays,) uint8 is filled.
        """
        field = self._field
        self._now += 1
        missing = self.count + count - self.cells.size
        if missing > 0:
            more = np.zeros(max(missing, self.cells.size), dtype=np.int32)
            self.cells = np.concatenate((self.cells, more))
        sensor = base @ laser.mount
        self._sensor[:] = sensor.x, sensor.y, sensor.yaw
        self._pose[:] = base.x, base.y, base.yaw
        columns = field.clearance.shape[1]
        self.count = clear_cells(
            self.cells, self.count, self._stamps, self._now - self._memory, columns,
            field.x, field.y, field.resolution, self._sensor, laser.angle_min,
            laser.angle_increment, ranges, laser.range_max, 2.0 * field.resolution,
        )  # fmt: skip
        self.count = mark_cells(
            points, known, count, self._pose, field.surface, field.x, field.y, field.resolution,
            self._explained, self._reach, self._now, self._stamps, self.cells, self.count,
        )  # fmt: skip

    def sift(self, points: Floats, count: int, base: Pose2, result: Floats) -> int:
        """Write the returns that tell about the map into ``result`` (rays, 2); return how many."""
        field = self._field
        rows, columns = field.clearance.shape
        self._pose[:] = base.x, base.y, base.yaw
        return select_map_returns(
            points, count, self._pose, self._stamps, rows, columns, field.x, field.y,
            field.resolution, field.resolution, result,
        )  # fmt: skip

    def clearance(self, reach: float) -> Singles:
        """Return the map's clearance field with the marked cells stamped in, out to ``reach``."""
        combined = self._field.clearance.copy()
        stamp_clearance(combined, self.cells, self.count, self._field.resolution, reach)
        return combined

    def first_blocked(self, path: Floats, begin: int, end: int, radius: float) -> int:
        """Return the first index of ``path`` in [begin, end) too close to a mark, or -1."""
        field = self._field
        return first_blocked(
            path, begin, end, self.cells, self.count, field.clearance.shape[1],
            field.x, field.y, field.resolution, radius,
        )  # fmt: skip

    def append_nearby(self, base: Pose2, reach: float, points: Floats, used: int) -> int:
        """Append marks near ``base`` to ``points`` in the base frame; return their number."""
        field = self._field
        self._pose[:] = base.x, base.y, base.yaw
        return append_nearby(
            self.cells, self.count, field.clearance.shape[1], field.x, field.y,
            field.resolution, self._pose, reach, points, used,
        )  # fmt: skip
