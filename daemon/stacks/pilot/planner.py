"""Global planner of the pilot.

A* on the clearance field (eight neighbours, costs that grow near walls), then smoothing and even
resampling.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.pilot.maps import MapField
from grammars.model.geometry import Floats, Point2

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
