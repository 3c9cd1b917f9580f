"""The global planner: from here to a waypoint on the map, keeping off walls and obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daemon.navigation.kernels import Singles
from daemon.navigation.pilot._astar import search
from daemon.navigation.pilot._field import MapField
from daemon.navigation.pilot._smoothing import lengths_along, resample, shorten
from grammars.values import Floats, Point2

SPACING = 0.05
"""Distance between two points of a path [m]."""
_ESCAPE = 0.45
"""Around the start, tight cells may be crossed out to here [m]."""
_SHORTCUT = 6.0
"""Longest stretch of a grid path that one shortcut replaces [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
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

    def plan(self, start: Point2, goal: Point2, clearance: Singles | None = None) -> Path | None:
        """Return the cheapest path, or ``None`` when there is none.

        ``clearance`` replaces the map's own field, to plan around obstacles it does not show.
        """
        field = self.field
        clearance = field.clearance if clearance is None else clearance
        here, there = field.cell(*start), self._footing(goal, clearance)
        if there is None or not field.inside(*here):
            return None
        cells, _ = search(
            clearance, here[0], here[1], there[0], there[1],
            self.lethal, self.preferred, self.weight, _ESCAPE / field.resolution,
        )  # fmt: skip
        if cells.size == 0:
            return None
        reach = round(_SHORTCUT / field.resolution)
        corners = shorten(clearance, cells, self.lethal, self.preferred, self.weight, reach)
        rows, columns = np.divmod(corners, clearance.shape[1])
        points = np.empty((max(2, corners.size), 2))
        points[: corners.size, 0] = field.x + (columns + 0.5) * field.resolution
        points[: corners.size, 1] = field.y + (rows + 0.5) * field.resolution
        # The first and last cell centre would only be a kink beside the true start and goal.
        points[-1] = goal if there == field.cell(*goal) else points[corners.size - 1]
        points[0] = start
        line = resample(points, SPACING)
        return Path(line, lengths_along(line))

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
