"""The global planner: from here to a waypoint on the map, keeping off walls and obstacles.

A* on the clearance field (eight neighbours, a binary heap, a cost that keeps off the walls),
then any-angle shortcuts that cost no more, then even resampling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.pilot.map_field import MapField
from grammars.model.geometry import Floats, Point2

_ROWS = (0, 0, 1, -1, 1, 1, -1, -1)
_COLUMNS = (1, -1, 0, 0, 1, -1, 1, -1)
_ESCAPE_FACTOR = 30.0
"""Cost factor of cells too tight for the robot that it may only cross to get out of them."""


@kernel
def cost_factor(clearance: float, lethal: float, preferred: float, weight: float) -> float:
    """Return what a metre costs at ``clearance`` [m]: 1 in the open, 1 + weight at ``lethal``."""
    if clearance >= preferred:
        return 1.0
    near = (preferred - clearance) / (preferred - lethal)
    return 1.0 + weight * near * near


@kernel
def _factor(
    clearance: Singles,
    row: int,
    column: int,
    start_row: int,
    start_column: int,
    escape2: float,
    lethal: float,
    preferred: float,
    weight: float,
) -> float:
    """Return the cost factor of a cell, 0 when it cannot be crossed."""
    value = float(clearance[row, column])
    if value >= lethal:
        return cost_factor(value, lethal, preferred, weight)
    away2 = float((row - start_row) ** 2 + (column - start_column) ** 2)
    if away2 <= escape2 and value >= 0.5 * lethal:
        return _ESCAPE_FACTOR * (1.0 + weight)
    return 0.0


@kernel
def _push(keys: Singles, items: Integers, count: int, key: float, item: int) -> None:
    child = count
    while child > 0:
        parent = (child - 1) >> 1
        if keys[parent] <= key:
            break
        keys[child], items[child] = keys[parent], items[parent]
        child = parent
    keys[child], items[child] = key, item


@kernel
def _pop(keys: Singles, items: Integers, last: int) -> None:
    """Remove the root of a heap whose last entry is at ``last``."""
    key, item = keys[last], items[last]
    parent = 0
    while True:
        child = 2 * parent + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[parent], items[parent] = keys[child], items[child]
        parent = child
    keys[parent], items[parent] = key, item


@kernel
def search_astar(
    clearance: Singles,
    start_row: int,
    start_column: int,
    goal_row: int,
    goal_column: int,
    lethal: float,
    preferred: float,
    weight: float,
    escape: float,
) -> tuple[Integers, float]:
    """Return the cheapest path as flat cell indices from start to goal, and its cost [cells].

    Cells with ``clearance`` below ``lethal`` [m] are closed; within ``escape`` cells of the start,
    where the robot may already stand too close to something, only those below half of it. A step
    costs its length times the mean cost factor of its two cells; a diagonal needs both cells
    beside it. Without a path the result is empty and the cost infinite.
    """
    # One kernel: heap, costs and parents are flat arrays that every step of the search touches.
    rows, columns = clearance.shape
    goal = goal_row * columns + goal_column
    start = start_row * columns + start_column
    # Filled one by one, and later copied so: numba compiles numpy's functions for each type.
    spent = np.empty(rows * columns, dtype=np.float32)
    came, done = np.empty(rows * columns, dtype=np.int8), np.empty(rows * columns, dtype=np.int8)
    for cell in range(rows * columns):
        spent[cell], came[cell], done[cell] = np.inf, -1, 0
    keys, items = np.empty(1 << 16, dtype=np.float32), np.empty(1 << 16, dtype=np.int32)
    diagonal = math.sqrt(2.0)
    spent[start] = 0.0
    keys[0], items[0] = 0.0, start
    count = 1
    escape2 = escape * escape
    while count > 0:
        here = items[0]
        count -= 1
        _pop(keys, items, count)
        if done[here]:
            continue
        done[here] = 1
        if here == goal:
            break
        row, column = here // columns, here % columns
        factor = _factor(
            clearance, row, column, start_row, start_column, escape2, lethal, preferred, weight
        )
        for k in range(8):
            r, c = row + _ROWS[k], column + _COLUMNS[k]
            if r < 0 or c < 0 or r >= rows or c >= columns:
                continue
            there = r * columns + c
            if done[there]:
                continue
            other = _factor(
                clearance, r, c, start_row, start_column, escape2, lethal, preferred, weight
            )
            if other == 0.0:
                continue
            length = 1.0
            if k >= 4:
                length = diagonal
                if (
                    _factor(clearance, row, c, start_row, start_column, escape2, lethal,
                            preferred, weight) == 0.0
                    or _factor(clearance, r, column, start_row, start_column, escape2, lethal,
                               preferred, weight) == 0.0
                ):  # fmt: skip
                    continue
            cost = spent[here] + 0.5 * length * (factor + other)
            if cost >= spent[there]:
                continue
            spent[there] = cost
            came[there] = k
            dr, dc = abs(r - goal_row), abs(c - goal_column)
            ahead = max(dr, dc) + (diagonal - 1.0) * min(dr, dc)
            if count == keys.shape[0]:
                more_keys = np.empty(2 * count, dtype=np.float32)
                more_items = np.empty(2 * count, dtype=np.int32)
                for i in range(count):
                    more_keys[i], more_items[i] = keys[i], items[i]
                keys, items = more_keys, more_items
            _push(keys, items, count, cost + ahead, there)
            count += 1
    if not done[goal]:
        return np.empty(0, dtype=np.int32), np.inf
    length_of_path = 1
    cell = goal
    while cell != start:
        cell -= _ROWS[came[cell]] * columns + _COLUMNS[came[cell]]
        length_of_path += 1
    path = np.empty(length_of_path, dtype=np.int32)
    cell = goal
    for i in range(length_of_path - 1, -1, -1):
        path[i] = cell
        if cell != start:
            cell -= _ROWS[came[cell]] * columns + _COLUMNS[came[cell]]
    return path, float(spent[goal])


@kernel
def _line_cost(
    clearance: Singles,
    row0: int,
    column0: int,
    row1: int,
    column1: int,
    lethal: float,
    preferred: float,
    weight: float,
) -> float:
    """Return the cost of the straight line between two cell centres [cells], inf if closed."""
    dr, dc = float(row1 - row0), float(column1 - column0)
    length = math.hypot(dr, dc)
    steps = max(1, math.ceil(2.0 * length))
    total = 0.0
    for i in range(steps + 1):
        t = i / steps
        value = clearance[round(row0 + t * dr), round(column0 + t * dc)]
        if value < lethal:
            return np.inf
        share = 0.5 if i == 0 or i == steps else 1.0
        total += share * cost_factor(value, lethal, preferred, weight)
    return total * length / steps


@kernel
def shortcut_path(
    clearance: Singles,
    path: Integers,
    lethal: float,
    preferred: float,
    weight: float,
    reach: int,
) -> Integers:
    """Return the corners of ``path`` (flat cell indices) after taking every worthwhile shortcut.

    A straight line replaces a stretch of at most ``reach`` cells when it costs no more, so that a
    shortcut never trades the middle of a doorway for its jamb.
    """
    columns = clearance.shape[1]
    count = path.shape[0]
    corners = np.empty(count, dtype=np.int32)
    corners[0] = path[0]
    kept = 1
    i = 0
    while i < count - 1:
        row, column = path[i] // columns, path[i] % columns
        spent = 0.0
        best = i + 1
        for j in range(i + 1, min(count, i + reach + 1)):
            before, here = path[j - 1], path[j]
            r, c = here // columns, here % columns
            length = math.hypot(float(r - before // columns), float(c - before % columns))
            spent += 0.5 * length * (
                cost_factor(clearance[before // columns, before % columns], lethal, preferred,
                            weight)
                + cost_factor(clearance[r, c], lethal, preferred, weight)
            )  # fmt: skip
            if j - i > 1:
                line = _line_cost(clearance, row, column, r, c, lethal, preferred, weight)
                if line <= 1.002 * spent:
                    best = j
        corners[kept] = path[best]
        kept += 1
        i = best
    return corners[:kept].copy()


@kernel
def resample(corners: Floats, spacing: float) -> Floats:
    """Return points (n, 2) along the polyline ``corners`` (m, 2), at most ``spacing`` [m] apart.

    Corners are kept.
    """
    total = 1
    for i in range(corners.shape[0] - 1):
        length = math.hypot(corners[i + 1, 0] - corners[i, 0], corners[i + 1, 1] - corners[i, 1])
        total += max(1, math.ceil(length / spacing - 1e-9))
    points = np.empty((total, 2))
    points[0, 0], points[0, 1] = corners[0, 0], corners[0, 1]
    k = 1
    for i in range(corners.shape[0] - 1):
        dx, dy = corners[i + 1, 0] - corners[i, 0], corners[i + 1, 1] - corners[i, 1]
        steps = max(1, math.ceil(math.hypot(dx, dy) / spacing - 1e-9))
        for j in range(1, steps + 1):
            points[k, 0] = corners[i, 0] + dx * j / steps
            points[k, 1] = corners[i, 1] + dy * j / steps
            k += 1
    return points


@kernel
def cumulative_lengths(points: Floats) -> Floats:
    """Return the distance travelled at each point of a polyline (n, 2) [m]."""
    travelled = np.empty(points.shape[0])
    travelled[0] = 0.0
    for i in range(1, points.shape[0]):
        step = math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
        travelled[i] = travelled[i - 1] + step
    return travelled


SPACING = 0.05
"""Distance between two points of a path [m]."""
_ESCAPE = 0.45
"""Around the start, tight cells may be crossed out to here [m]."""
_SHORTCUT = 6.0
"""Longest stretch of a grid path that one shortcut replaces [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPath:
    """Where to drive: ``points`` (n, 2) in the map frame, ``travelled`` (n,) distance there [m]."""

    points: Floats
    travelled: Floats

    @property
    def length(self) -> float:
        """Total length [m]."""
        return float(self.travelled[-1])


@dataclass(frozen=True, slots=True)
class Planner:
    """Plans on a map. Distances in metres.

    ``lethal`` is the least clearance of the base's centre, ``preferred`` the clearance beyond
    which nothing is gained, ``weight`` how much more a metre costs at ``lethal`` than in the open.
    ``tolerance`` is how far from a goal that cannot be stood on the path may end.
    """

    field: MapField
    lethal: float
    preferred: float
    weight: float
    tolerance: float

    def plan(
        self, start: Point2, goal: Point2, clearance: Singles | None = None
    ) -> PlannedPath | None:
        """Return the cheapest path, or ``None`` when there is none.

        ``clearance`` replaces the map's own field, to plan around obstacles it does not show.
        """
        field = self.field
        clearance = field.clearance if clearance is None else clearance
        here, there = field.cell(*start), self._footing(goal, clearance)
        if there is None or not field.inside(*here):
            return None
        cells, _ = search_astar(
            clearance, here[0], here[1], there[0], there[1],
            self.lethal, self.preferred, self.weight, _ESCAPE / field.resolution,
        )  # fmt: skip
        if cells.size == 0:
            return None
        reach = round(_SHORTCUT / field.resolution)
        corners = shortcut_path(clearance, cells, self.lethal, self.preferred, self.weight, reach)
        rows, columns = np.divmod(corners, clearance.shape[1])
        points = np.empty((max(2, corners.size), 2))
        points[: corners.size, 0] = field.x + (columns + 0.5) * field.resolution
        points[: corners.size, 1] = field.y + (rows + 0.5) * field.resolution
        # The first and last cell centre would only be a kink beside the true start and goal.
        points[-1] = goal if there == field.cell(*goal) else points[corners.size - 1]
        points[0] = start
        line = resample(points, SPACING)
        return PlannedPath(line, cumulative_lengths(line))

    def _footing(self, goal: Point2, clearance: Singles) -> tuple[int, int] | None:
        """Return the cell nearest to ``goal`` the robot can stand on, within the tolerance."""
        field = self.field
        row, column = field.cell(*goal)
        if field.inside(row, column) and clearance[row, column] >= self.lethal:
            return row, column
        span = math.floor(self.tolerance / field.resolution)
        best: tuple[int, int] | None = None
        nearest = math.inf
        for r in range(row - span, row + span + 1):
            for c in range(column - span, column + span + 1):
                away = math.hypot(r - row, c - column)
                if away <= min(span, nearest) and away < nearest and field.inside(r, c):
                    if clearance[r, c] < self.lethal:
                        continue
                    best, nearest = (r, c), away
        return best
