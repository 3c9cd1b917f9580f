"""The pilot's picture of the building: distance fields, obstacles the map lacks, and ways.

The planner is A* on the clearance field (eight neighbours, costs that grow near walls), then
smoothing and even resampling.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles, distance_transform
from grammars.model.geometry import Floats, Point2
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid

_BORDER = 2
"""Border of unknown cells around the known part of the map."""
_EXPLAINED = 0.15
"""Returns nearer to a wall of the map than this belong to the wall [m]."""
_NEIGHBOURS = 5
"""Returns this near, in rays, to an unexplained one may belong to the same object."""
_REACH = 4.0
"""Greatest distance from the base of a remembered return [m]."""


class MapField(NamedTuple):
    """Distance fields over the known part of a map, (rows, columns), float32, in metres.

    The lower-left corner of cell (0, 0) lies at (``x``, ``y``). ``surface`` is the signed
    distance of a cell centre to the painted surface of the walls: positive outside occupied
    cells, negative inside. It is zero on the edge between the last free and the first occupied
    cell, where a laser sees the wall. ``clearance`` is the distance to the nearest cell that is
    not free, 0 in such cells.
    """

    surface: Singles
    clearance: Singles
    x: float
    y: float
    resolution: float

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return the (row, column) that holds a point; may lie outside the field."""
        row = math.floor((y - self.y) / self.resolution)
        return row, math.floor((x - self.x) / self.resolution)


def map_field(grid: OccupancyGrid) -> MapField:
    """Prepare the distance fields of ``grid``; raises ``ValueError`` for a map without free cells.

    Distances run between cell centres, so the surface lies half a cell before the first centre
    beyond it.
    """
    free = grid.cells == FREE
    if not free.any():
        raise ValueError("the map has no free cell: nothing can be planned on it")
    is_known = (grid.cells == OCCUPIED) | free
    rows, columns = _extent(is_known.any(axis=1)), _extent(is_known.any(axis=0))
    cells = grid.cells[rows, columns]
    half = np.float32(0.5)
    to_occupied = distance_transform((cells == OCCUPIED).astype(np.uint8))
    to_free = distance_transform((cells == FREE).astype(np.uint8))
    to_blocked = distance_transform((cells != FREE).astype(np.uint8))
    surface = np.where(cells == OCCUPIED, half - to_free, to_occupied - half)
    scale = np.float32(grid.resolution)
    return MapField(
        surface=surface * scale,
        clearance=np.maximum(to_blocked - half, np.float32(0.0)) * scale,
        x=grid.x + columns.start * grid.resolution,
        y=grid.y + rows.start * grid.resolution,
        resolution=grid.resolution,
    )


def _extent(flags: np.ndarray) -> slice:
    """Return the range of true entries, with a border."""
    indices = np.flatnonzero(flags)
    return slice(max(0, int(indices[0]) - _BORDER), int(indices[-1]) + 1 + _BORDER)


@kernel
def interpolate(values: Singles, u: float, v: float) -> float:
    """Return a field at column ``u``, row ``v``, interpolated between centres; -1 outside."""
    column, row = math.floor(u), math.floor(v)
    if row < 0 or column < 0 or row + 1 >= values.shape[0] or column + 1 >= values.shape[1]:
        return -1.0
    a, b = u - column, v - row
    lower = (1.0 - a) * values[row, column] + a * values[row, column + 1]
    upper = (1.0 - a) * values[row + 1, column] + a * values[row + 1, column + 1]
    return float((1.0 - b) * lower + b * upper)


Scan: TypeAlias = tuple[Singles, tuple[float, float, float], tuple[float, float, float, float]]
"""A scan: ranges (rays,) [m]; pose (x, y, yaw) of the laser in the map; angle of the first ray and
between two rays [rad], least and longest range [m]."""


@kernel
def project(field: MapField, scan: Scan) -> tuple[Floats, np.ndarray, Floats]:
    """Return the returns of a scan (n, 2) in the map, flags of walls (n,), and the sure returns.

    Lost rays and rays without a return are left out (REP 117). A flag is 1 for a return near or
    behind a painted wall, otherwise 0. Neighbours of returns with 0 are not sure: the end of a
    leaf that touches its wall would turn the wall with it.
    """
    rows, columns = field.surface.shape
    ranges, (sx, sy, yaw), (first, step, least, most) = scan
    points, sure = np.empty((ranges.shape[0], 2)), np.empty((ranges.shape[0], 2))
    is_wall = np.empty(ranges.shape[0], dtype=np.uint8)
    c, s = math.cos(yaw + first), math.sin(yaw + first)
    turn_c, turn_s = math.cos(step), math.sin(step)
    count = sures = 0
    for i in range(ranges.shape[0]):
        away = float(ranges[i])
        x, y = sx + away * c, sy + away * s
        # Turn from ray to ray, because a sine for each would take most of the time.
        c, s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
        if not (least <= away <= most):
            continue
        column = math.floor((x - field.x) / field.resolution)
        row = math.floor((y - field.y) / field.resolution)
        inside = 0 <= row < rows and 0 <= column < columns
        is_wall[count] = inside and field.surface[row, column] <= _EXPLAINED
        points[count, 0], points[count, 1] = x, y
        count += 1
    odd = -_NEIGHBOURS - 1
    for i in range(count + _NEIGHBOURS):
        if i < count and not is_wall[i]:
            odd = i
        k = i - _NEIGHBOURS
        if k >= 0 and k - odd > _NEIGHBOURS:
            sure[sures, 0], sure[sures, 1] = points[k, 0], points[k, 1]
            sures += 1
    return points[:count], is_wall[:count], sure[:sures]


@kernel
def _is_seen_through(scan: Scan, x: float, y: float, margin: float) -> bool:
    """Tell whether the ray towards a point reaches more than ``margin`` [m] beyond it."""
    ranges, (sx, sy, yaw), (first, step, _, most) = scan
    away = math.hypot(x - sx, y - sy)
    angle = math.atan2(y - sy, x - sx) - yaw - first
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))
    ray = round(angle / step) if step > 0.0 else 0
    if away >= most or ray >= ranges.shape[0]:
        return False
    # A lost ray is nan and compares false: it clears nothing.
    return bool(abs(angle - ray * step) <= step and ranges[ray] > away + margin)


@kernel
def update_marks(
    field: MapField,
    centres: Floats,
    stamps: Integers,
    numbers: tuple[int, int],
    scan: Scan,
    points: Floats,
    is_wall: np.ndarray,
) -> Floats:
    """Return the centres of the marked cells (n, 2) [m] after one scan.

    ``stamps`` (rows, columns) change in place: the number of the scan that saw a cell last, 0 in
    unmarked cells. ``numbers`` are that of this scan and that of the oldest one that counts. A
    marked cell goes when the ray that points at it looks through it. Asking cells instead of
    following rays costs nothing in empty space and leaves no gaps between rays. Then the returns
    that are not walls are marked.
    """
    size, (now, oldest) = field.resolution, numbers
    marks = np.empty((centres.shape[0] + points.shape[0], 2))
    count = 0
    for i in range(centres.shape[0]):
        x, y = centres[i, 0], centres[i, 1]
        row, column = math.floor((y - field.y) / size), math.floor((x - field.x) / size)
        if stamps[row, column] < oldest or _is_seen_through(scan, x, y, 2.0 * size):
            stamps[row, column] = 0
        else:
            marks[count, 0], marks[count, 1] = x, y
            count += 1
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        row, column = math.floor((y - field.y) / size), math.floor((x - field.x) / size)
        inside = 0 <= row < stamps.shape[0] and 0 <= column < stamps.shape[1]
        if is_wall[i] or not inside or math.hypot(x - scan[1][0], y - scan[1][1]) > _REACH:
            continue
        if stamps[row, column] == 0:
            marks[count, 0] = field.x + (column + 0.5) * size
            marks[count, 1] = field.y + (row + 0.5) * size
            count += 1
        stamps[row, column] = now
    return marks[:count]


@kernel
def first_blocked(path: Floats, centres: Floats, radius: float) -> int:
    """Return the index of the first point of ``path`` (n, 2) within ``radius`` of a mark, or -1."""
    for i in range(path.shape[0]):
        for k in range(centres.shape[0]):
            dx, dy = path[i, 0] - centres[k, 0], path[i, 1] - centres[k, 1]
            if dx * dx + dy * dy < radius * radius:
                return i
    return -1


class UnmappedObstacles:
    """Cells that are occupied in scans but free in the map.

    Attributes:
        centres: the centres of the marked cells (n, 2) in the map [m].
    """

    def __init__(self, field: MapField, memory: int) -> None:
        """Keep a cell for ``memory`` scans of any laser after it was last seen."""
        self._field, self._memory, self._now = field, memory, 0
        self._stamps = np.zeros(field.clearance.shape, dtype=np.int32)
        self.centres = np.empty((0, 2))

    def update(self, scan: Scan, points: Floats, is_wall: np.ndarray) -> None:
        """Take a projected scan."""
        self._now += 1
        numbers = self._now, self._now - self._memory
        self.centres = update_marks(
            self._field, self.centres, self._stamps, numbers, scan, points, is_wall
        )

    def clearance(self, reach: float) -> Singles:
        """Return the clearance of the map and the marks, which matter up to ``reach`` [m]."""
        field = self._field
        combined = field.clearance.copy()
        if len(self.centres):
            cells = (self.centres - (field.x, field.y)) / field.resolution
            columns, rows = cells.astype(np.int64).T
            span = math.ceil(reach / field.resolution)
            row0, column0 = max(0, rows.min() - span), max(0, columns.min() - span)
            part = combined[row0 : rows.max() + span + 1, column0 : columns.max() + span + 1]
            solid = np.zeros(part.shape, dtype=np.uint8)
            solid[rows - row0, columns - column0] = 1
            away = (distance_transform(solid) - np.float32(0.5)) * np.float32(field.resolution)
            np.minimum(part, away.clip(0.0), out=part)
        return combined


_WEIGHT = 6.0
"""Extra cost of a metre at the tightest passable place, relative to the open."""


@kernel
def cost_factor(clearance: float, lethal: float, preferred: float) -> float:
    """Return the cost of a metre at ``clearance`` [m]: 1 in the open, infinite below ``lethal``."""
    if clearance < lethal:
        return math.inf
    near = max(0.0, preferred - clearance) / (preferred - lethal)
    return 1.0 + _WEIGHT * near * near


@kernel
def search_astar(
    clearance: Singles,
    costs: Singles,
    start: tuple[int, int],
    goal: tuple[int, int],
    lethal: float,
    preferred: float,
) -> Integers:
    """Return the cheapest path as flat cell indices from start to goal, empty if there is none.

    Cells with ``clearance`` below ``lethal`` [m] are closed. A step costs its length times the
    mean cost factor of its two cells; a diagonal needs both cells beside it. ``costs``
    (rows * columns,), infinite everywhere, receives the cost of reaching each cell [cells].
    """
    rows, columns = clearance.shape
    came = np.empty(rows * columns, dtype=np.int32)
    first, last = start[0] * columns + start[1], goal[0] * columns + goal[1]
    costs[first] = 0.0
    queue = [(np.float32(0.0), np.float32(0.0), first)]
    while queue:
        _, cost, here = heapq.heappop(queue)
        if here == last:
            break
        if cost > costs[here]:
            continue
        row, column = here // columns, here % columns
        factor = cost_factor(clearance[row, column], lethal, preferred)
        for k in range(9):
            r, c = row + k // 3 - 1, column + k % 3 - 1
            if r < 0 or c < 0 or r >= rows or c >= columns:
                continue
            there = r * columns + c
            # Most neighbours are nearer to the start: skip them first.
            if costs[there] <= cost:
                continue
            if clearance[row, c] < lethal or clearance[r, column] < lethal:
                continue
            # Roots, as a general hypotenuse would take half of the time.
            length = 0.5 * math.sqrt((r - row) ** 2 + (c - column) ** 2)
            other = cost_factor(clearance[r, c], lethal, preferred)
            total = np.float32(cost + length * (factor + other))
            if total < costs[there]:
                costs[there], came[there] = total, here
                ahead = math.sqrt((r - goal[0]) ** 2 + (c - goal[1]) ** 2)
                heapq.heappush(queue, (np.float32(total + ahead), total, there))
    if math.isinf(costs[last]):
        return np.empty(0, dtype=np.int32)
    path = [last]
    while path[-1] != first:
        path.append(came[path[-1]])
    return np.array(path[::-1], dtype=np.int32)


_SPACING: Final = 0.05
"""Longest distance between two points of a path [m]."""
_ESCAPE: Final = 0.45
"""Radius around the start where the path may cross tight cells [m]."""
_SMOOTHING: Final = 8
"""Number of smoothing passes."""


class PlannedPath(NamedTuple):
    """A way to drive: ``points`` (n, 2) in the map, evenly ``spacing`` [m] apart."""

    points: Floats
    spacing: float


@dataclass(frozen=True, slots=True)
class Planner:
    """Planner on one map. Distances in metres.

    ``lethal`` is the least clearance of the base's centre. Clearance beyond ``preferred`` is no
    better. The path may end within ``tolerance`` of a goal where the robot cannot stand.
    """

    field: MapField
    lethal: float
    preferred: float
    tolerance: float

    def plan(
        self, start: Point2, goal: Point2, clearance: Singles | None = None
    ) -> PlannedPath | None:
        """Return the cheapest path, or ``None`` if there is no path.

        ``clearance`` replaces the map's own field, to plan around obstacles the map lacks.
        """
        field = self.field
        clearance = field.clearance if clearance is None else clearance
        here, there = field.cell(*start), self._footing(goal, clearance)
        rows, columns = clearance.shape
        if there is None or not (0 <= here[0] < rows and 0 <= here[1] < columns):
            return None
        if clearance[here] < self.lethal:
            clearance = self._with_way_out(clearance, here)
        costs = np.full(clearance.size, np.inf, dtype=np.float32)
        cells = search_astar(clearance, costs, here, there, self.lethal, self.preferred)
        if cells.size == 0:
            return None
        cells = np.column_stack(np.divmod(cells, columns)).astype(np.float64)
        for _ in range(_SMOOTHING):
            # Each point goes to the middle of its neighbours: the steps of the grid vanish.
            cells[1:-1] = 0.25 * (cells[:-2] + 2.0 * cells[1:-1] + cells[2:])
        points = (cells[:, ::-1] + 0.5) * field.resolution + (field.x, field.y)
        # The first and last cell centre would put kinks beside the true start and goal.
        end = goal if there == field.cell(*goal) else points[-1]
        return _resampled(np.concatenate(([start], points[1:-1], [end])))

    def _with_way_out(self, clearance: Singles, start: tuple[int, int]) -> Singles:
        """Return ``clearance`` with tight cells opened around a start that is itself too tight.

        Cells below half of the least clearance stay closed.
        """
        opened = clearance.copy()
        span = math.floor(_ESCAPE / self.field.resolution)
        row0, column0 = max(0, start[0] - span), max(0, start[1] - span)
        part = opened[row0 : start[0] + span + 1, column0 : start[1] + span + 1]
        part[(part >= 0.5 * self.lethal) & (part < self.lethal)] = self.lethal
        return opened

    def _footing(self, goal: Point2, clearance: Singles) -> tuple[int, int] | None:
        """Return the nearest cell within the tolerance of ``goal`` where the robot can stand."""
        row, column = self.field.cell(*goal)
        span = math.floor(self.tolerance / self.field.resolution)
        row0, column0 = max(0, row - span), max(0, column - span)
        part = clearance[row0 : max(0, row + span + 1), column0 : max(0, column + span + 1)]
        rows, columns = np.nonzero(part >= self.lethal)
        away = np.hypot(rows + row0 - row, columns + column0 - column)
        if not away.size or away.min() > span:
            return None
        best = away.argmin()
        return int(rows[best] + row0), int(columns[best] + column0)


def _resampled(corners: Floats) -> PlannedPath:
    """Return the path along the polyline ``corners`` (m, 2)."""
    legs = np.hypot(np.diff(corners[:, 0]), np.diff(corners[:, 1]))
    at = np.concatenate(([0.0], legs.cumsum()))
    ways = np.linspace(0.0, at[-1], max(2, math.ceil(at[-1] / _SPACING) + 1))
    points = np.column_stack([np.interp(ways, at, corners[:, k]) for k in (0, 1)])
    return PlannedPath(points, float(ways[1]))
