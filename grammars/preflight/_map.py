"""Checks of a map of one's own: does it belong to this building, does the robot stand in it?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import shapely

from grammars.model.geometry import Point2
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.scene import Scene
from grammars.text.diagnostics import Diagnostic, Severity, Where

_NEAR: Final = 0.2
"""So far may an occupied cell lie from what stands in the building to be of it [m]."""
_LEAST_SHARE: Final = 0.5
"""With fewer occupied cells near the building a map is said to lie beside it: furniture, people
and noise are in maps that robots drew, but rarely more of them than walls."""
_MOST_CELLS: Final = 5000
"""So many occupied cells are looked at, evenly spread."""


def check_map(
    grid: OccupancyGrid,
    scene: Scene,
    mission: Mission,
    *,
    laser_height: float,
    where: Where,
    places: Mapping[str, Where],
) -> list[Diagnostic]:
    """Return warnings about a map that is given as it is; ``where`` is its name's place.

    They are about a start or a waypoint on a cell that is not free, about values that stacks do not
    tell apart, and about a map whose occupied cells mostly lie away from what stands in the scene
    at ``laser_height`` [m].
    """
    spots = [("the start", "start", (mission.start.x, mission.start.y))]
    spots += [(f"waypoint {w.id}", w.id, (w.x, w.y)) for w in mission.waypoints]
    found = [
        Diagnostic(
            places.get(key, where),
            f"{label} ({point[0]:g}, {point[1]:g}) lies {state} the map of the campaign",
            "planners refuse such a place: check the origin of the map and its thresholds",
            Severity.WARNING,
        )
        for label, key, point in spots
        if (state := _not_free(grid, point))
    ]
    whole = (_between(grid, where), _beside(grid, scene, laser_height, where))
    return [*found, *(one for one in whole if one is not None)]


def _not_free(grid: OccupancyGrid, point: Point2) -> str:
    """Return how a point lies in a map when it is not known to be free, else nothing."""
    rows, columns = grid.cells.shape
    column = int(np.floor((point[0] - grid.x) / grid.resolution))
    row = int(np.floor((point[1] - grid.y) / grid.resolution))
    if not (0 <= row < rows and 0 <= column < columns):
        return "outside of"
    value = int(grid.cells[row, column])
    if value == OCCUPIED:
        return "on an occupied cell of"
    return "on an unknown cell of" if value == UNKNOWN else ""


def _between(grid: OccupancyGrid, where: Where) -> Diagnostic | None:
    count = int(np.count_nonzero((grid.cells > FREE) & (grid.cells < OCCUPIED)))
    if not count:
        return None
    return Diagnostic(
        where,
        f"{count} cells of the map are neither free nor occupied nor unknown, but in between",
        "the stacks here see three kinds, as costmap_2d and amcl do unless told otherwise: "
        "costmaps take these for free, amcl for unknown",
        Severity.WARNING,
    )


def _beside(
    grid: OccupancyGrid, scene: Scene, laser_height: float, where: Where
) -> Diagnostic | None:
    row, column = np.nonzero(grid.cells == OCCUPIED)
    if not len(row):
        return Diagnostic(
            where,
            "no cell of the map is occupied",
            'check "occupied_thresh" and "negate" in its file',
            Severity.WARNING,
        )
    standing = [
        shapely.Polygon(s.polygon) for s in scene.solids if s.z_min <= laser_height <= s.z_max
    ]
    if not standing:
        return None
    step = -(-len(row) // _MOST_CELLS)
    x = grid.x + (column[::step] + 0.5) * grid.resolution
    y = grid.y + (row[::step] + 0.5) * grid.resolution
    tree = shapely.STRtree(standing)
    near, _ = tree.query(shapely.points(x, y), predicate="dwithin", distance=_NEAR)
    share = len(np.unique(near)) / len(x)
    if share >= _LEAST_SHARE:
        return None
    return Diagnostic(
        where,
        f"{share:.0%} of the occupied cells of the map lie within {_NEAR:g} m of what stands in "
        f"{scene.name} at the height of the laser ({laser_height:g} m)",
        "if the robot is not to be given a wrong map: is it of this building, is its origin right?",
        Severity.WARNING,
    )
