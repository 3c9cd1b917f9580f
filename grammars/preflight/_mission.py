"""Checks of a mission: is there time for it, does the map that is given to it suit it?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
import shapely

from grammars.model.geometry import Point2
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.scene import Scene
from grammars.text.diagnostics import Finding, Findings, Where

_ARRIVAL: Final = 0.5
"""So far from a waypoint [m] may a system be content; the tolerances of stacks are smaller."""
_NEAR: Final = 0.2
"""So far may an occupied cell lie from what stands in the building to be of it [m]."""
_LEAST_SHARE: Final = 0.5
"""With fewer occupied cells near the building a map is said to lie beside it: furniture, people
and noise are in maps that robots drew, but rarely more of them than walls."""
_MOST_CELLS: Final = 5000
"""So many occupied cells are looked at, evenly spread."""


class Spot(NamedTuple):
    """The start or a waypoint: its name in messages, where it is [m], its place in a file."""

    label: str
    point: Point2
    where: Where


def spots_of(mission: Mission, places: Mapping[str, Where], home: Where) -> list[Spot]:
    """Return the start and the waypoints; ``places`` are by id, ``home`` is that of the rest."""
    start = mission.start
    return [
        Spot("the start", (start.x, start.y), places.get("start", home)),
        *(Spot(f"waypoint {w.id}", (w.x, w.y), places.get(w.id, home)) for w in mission.waypoints),
    ]


def check_limit(
    mission: Mission, speeds: Mapping[str, float], *, limit: float, where: Where
) -> tuple[Finding, ...]:
    """Return a warning for a limit [s] in which no run can end its mission.

    The way is straight from waypoint to waypoint. ``speeds`` are the largest of the systems under
    test by name [m/s], ``where`` is the place of the limit.
    """
    spots = spots_of(mission, {}, where)
    legs = [math.dist(a.point, b.point) for a, b in itertools.pairwise(spots)]
    # Only near to each waypoint: the first leg begins at the start itself, all others do not.
    ends = [_ARRIVAL, *([2.0 * _ARRIVAL] * (len(legs) - 1))]
    way = math.fsum(max(0.0, leg - end) for leg, end in zip(legs, ends, strict=True))
    late = [
        f"{name} at least {way / speed:.1f} s for {way:.1f} m at {speed:.2f} m/s"
        for name, speed in speeds.items()
        if way > limit * speed
    ]
    findings = Findings()
    if late:
        takes = ", ".join(late)
        message = f"{limit:g} s are too short for mission {mission.name}: it takes {takes}"
        hint = "give it a longer limit, or the runs end before the last waypoint"
        findings.warning(where, message, hint)
    return findings.all


def check_map(
    grid: OccupancyGrid,
    scene: Scene,
    mission: Mission,
    *,
    laser_height: float,
    where: Where,
    places: Mapping[str, Where],
) -> tuple[Finding, ...]:
    """Return warnings about a map that is given as it is; ``where`` is its name's place.

    They are about a start or a waypoint on a cell that is not free, about values that stacks do not
    tell apart, and about a map whose occupied cells mostly lie away from what stands in the scene
    at ``laser_height`` [m].
    """
    findings = Findings()
    for label, point, place in spots_of(mission, places, where):
        state = _not_free(grid, point)
        if state:
            findings.warning(
                place,
                f"{label} ({point[0]:g}, {point[1]:g}) lies {state} the map of the campaign",
                "planners refuse such a place: check the origin of the map and its thresholds",
            )
    between = int(np.count_nonzero((grid.cells > FREE) & (grid.cells < OCCUPIED)))
    if between:
        findings.warning(
            where,
            f"{between} cells of the map are neither free nor occupied nor unknown, but in between",
            "the stacks here see three kinds, as costmap_2d and amcl do unless told otherwise: "
            "costmaps take these for free, amcl for unknown",
        )
    if not np.any(grid.cells == OCCUPIED):
        hint = 'check "occupied_thresh" and "negate" in its file'
        findings.warning(where, "no cell of the map is occupied", hint)
    elif (share := _share_near(grid, scene, laser_height)) < _LEAST_SHARE:
        findings.warning(
            where,
            f"{share:.0%} of the occupied cells of the map lie within {_NEAR:g} m of what stands "
            f"in {scene.name} at the height of the laser ({laser_height:g} m)",
            "if the robot is not to be given a wrong map: is it of this building, is its origin "
            "right?",
        )
    return findings.all


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


def _share_near(grid: OccupancyGrid, scene: Scene, height: float) -> float:
    """Return which share of the occupied cells lies near to what stands at a height [m].

    Where nothing stands no cell can be wrong: that is all of them.
    """
    standing = [shapely.Polygon(s.polygon) for s in scene.solids if s.z_min <= height <= s.z_max]
    if not standing:
        return 1.0
    row, column = np.nonzero(grid.cells == OCCUPIED)
    step = -(-len(row) // _MOST_CELLS)
    x = grid.x + (column[::step] + 0.5) * grid.resolution
    y = grid.y + (row[::step] + 0.5) * grid.resolution
    tree = shapely.STRtree(standing)
    near, _ = tree.query(shapely.points(x, y), predicate="dwithin", distance=_NEAR)
    return len(np.unique(near)) / len(x)
