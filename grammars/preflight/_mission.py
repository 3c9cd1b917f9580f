"""Checks of a mission: its time limit, and a given map."""

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
"""Largest tolerance of arrival at a waypoint [m]; the tolerances of stacks are smaller."""
_NEAR: Final = 0.2
"""Largest distance of occupied cells to the building that counts as near [m]."""
_LEAST_SHARE: Final = 0.5
"""A map with a smaller share of its occupied cells near the building gets a warning: real maps also
contain furniture, people and noise, but rarely more than walls."""
_MOST_CELLS: Final = 5000
"""Occupied cells checked at most, evenly spread."""


class Spot(NamedTuple):
    """The start or a waypoint: its name in messages, its position [m], its place in a file."""

    label: str
    point: Point2
    where: Where


def spots_of(mission: Mission, places: Mapping[str, Where], home: Where) -> list[Spot]:
    """Return the start and the waypoints; ``places`` go by id, ``home`` is the default."""
    start = mission.start
    return [
        Spot("the start", (start.x, start.y), places.get("start", home)),
        *(Spot(f"waypoint {w.id}", (w.x, w.y), places.get(w.id, home)) for w in mission.waypoints),
    ]


def check_limit(
    mission: Mission, speeds: Mapping[str, float], *, limit: float, where: Where
) -> tuple[Finding, ...]:
    """Return a warning for a limit [s] that is too short for the mission.

    Legs count as straight, stays in full. ``speeds`` has the top speeds [m/s] of the systems under
    test by name, ``where`` is the place of the limit.
    """
    spots = spots_of(mission, {}, where)
    legs = [math.dist(a.point, b.point) for a, b in itertools.pairwise(spots)]
    # A robot need not reach waypoints exactly, but the first leg begins exactly at the start.
    ends = [_ARRIVAL, *([2.0 * _ARRIVAL] * (len(legs) - 1))]
    way = math.fsum(max(0.0, leg - end) for leg, end in zip(legs, ends, strict=True))
    stays = math.fsum(waypoint.wait for waypoint in mission.waypoints)
    waits = f" and {stays:g} s of waiting" if stays else ""
    late = [
        f"{name} at least {way / speed + stays:.1f} s for {way:.1f} m at {speed:.2f} m/s{waits}"
        for name, speed in speeds.items()
        if way > (limit - stays) * speed
    ]
    findings = Findings()
    if late:
        takes = ", ".join(late)
        message = f"{limit:g} s are too short for mission {mission.name}: it takes {takes}"
        findings.warning(where, message, "use a longer limit")
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
    """Return warnings about a given map; ``where`` is the place of its name.

    The reasons: a start or waypoint on a cell that is not free, values that stacks treat
    differently, or most occupied cells far from solids of the scene at ``laser_height`` [m].
    """
    findings = Findings()
    for label, point, place in spots_of(mission, places, where):
        state = _not_free(grid, point)
        if state:
            findings.warning(
                place,
                f"{label} ({point[0]:g}, {point[1]:g}) is {state} the map of the campaign",
                "planners refuse such places: check the origin of the map and its thresholds",
            )
    between = int(np.count_nonzero((grid.cells > FREE) & (grid.cells < OCCUPIED)))
    if between:
        findings.warning(
            where,
            f"{between} cells of the map have values between free and occupied",
            "the stacks here treat them like costmap_2d and amcl do by default: costmaps as free, "
            "amcl as unknown",
        )
    if not np.any(grid.cells == OCCUPIED):
        hint = 'check "occupied_thresh" and "negate" in its file'
        findings.warning(where, "no cell of the map is occupied", hint)
    elif (share := _share_near(grid, scene, laser_height)) < _LEAST_SHARE:
        findings.warning(
            where,
            f"only {share:.0%} of the occupied cells of the map are within {_NEAR:g} m of walls "
            f"of {scene.name} at the height of the laser ({laser_height:g} m)",
            "check that the map shows this building and has the right origin",
        )
    return findings.all


def _not_free(grid: OccupancyGrid, point: Point2) -> str:
    """Return a phrase for a point that is outside the map or not free, otherwise an empty text."""
    rows, columns = grid.cells.shape
    column = int(np.floor((point[0] - grid.x) / grid.resolution))
    row = int(np.floor((point[1] - grid.y) / grid.resolution))
    if not (0 <= row < rows and 0 <= column < columns):
        return "outside"
    value = int(grid.cells[row, column])
    if value == OCCUPIED:
        return "on an occupied cell of"
    return "on an unknown cell of" if value == UNKNOWN else ""


def _share_near(grid: OccupancyGrid, scene: Scene, height: float) -> float:
    """Return the share of occupied cells near solids at a height [m]; 1 without solids."""
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
