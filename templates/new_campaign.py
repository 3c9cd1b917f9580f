"""Files of a new campaign, in its own flat or in an existing building.

Comments explain the lines. In an existing building, start and waypoints are at places where a robot
of usual size has room.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import FreeSpace, valid_polygon
from grammars.model.geometry import Point2, Pose2
from grammars.model.mission import Waypoint
from grammars.model.scene import Scene
from templates.naming import file_name
from templates.rendering import render

ROBOT_FILE: Final = "my_robot.yaml"
"""File name of the robot in a new campaign."""
_HEIGHT: Final = 0.35
"""Height of the robot in a new campaign [m], as in robot.yaml.j2."""
_CLEAR: Final = (0.6, 0.45, 0.35)
"""Clearances of the robot's base [m], the best one first; its footprint lies within 0.32 m."""
_PASSING: Final = 0.3
"""Radius of the disc that must pass between two places [m]: half the width of a narrow door."""
_MOST_WAYPOINTS: Final = 4
_PRECISION: Final = 0.05
"""Precision of the place farthest from all walls [m]."""


@dataclass(frozen=True, slots=True)
class Errand:
    """Start and stops of the robot."""

    start: Pose2
    stops: tuple[Waypoint, ...]

    @property
    def length(self) -> float:
        """Length of the straight lines from stop to stop [m]."""
        points = [(self.start.x, self.start.y), *((stop.x, stop.y) for stop in self.stops)]
        return sum(math.dist(a, b) for a, b in itertools.pairwise(points))


_OWN_ERRAND: Final = Errand(
    Pose2(), (Waypoint("kitchen", 4.6, 0.8), Waypoint("window", -1.0, 1.8), Waypoint("home", 0, 0))
)


def propose_errand(scene: Scene) -> Errand:
    """Return a start in the middle of the largest space, and waypoints in other reachable spaces.

    In a building of one space the waypoints are far from the start and from each other. Raises
    ``ValueError`` if there is no room for the robot.
    """
    free = FreeSpace(scene, _HEIGHT)
    ways = free.for_radius(_PASSING)
    if not ways.parts:
        raise ValueError(f"{scene.name} has no room for a robot of {2 * _PASSING:g} m")
    # All places are in one part, so that each is reachable from the others.
    part = max(ways.parts, key=lambda area: float(area.area))
    for clear in _CLEAR:
        standing = free.area.buffer(-clear).intersection(part)
        rooms = [
            (region.name, standing.intersection(valid_polygon(region.outline)))
            for region in scene.regions
        ]
        places = [(name, _middle(area)) for name, area in rooms if area.area > _PRECISION]
        if places:
            break
    else:
        raise ValueError(f"{scene.name} has no place {_CLEAR[-1]:g} m away from all walls")
    areas = {name: area.area for name, area in rooms}
    home, start = max(places, key=lambda place: areas[place[0]])
    others = [place for place in places if place[0] != home][:_MOST_WAYPOINTS]
    if not others:
        others = [(f"stop_{i}", point) for i, point in enumerate(_far(standing, start), start=1)]
    stops = [Waypoint(file_name(name), *_rounded(point)) for name, point in others]
    x, y = _rounded(start)
    return Errand(Pose2(x, y), (*stops, Waypoint("home", x, y)))


def _rounded(point: Point2) -> Point2:
    return round(point[0], 2), round(point[1], 2)


def _middle(area: BaseGeometry) -> Point2:
    """Return the point of the largest part of an area that is farthest from its edge."""
    largest = max(shapely.get_parts(area).tolist(), key=lambda piece: float(piece.area))
    inside = shapely.maximum_inscribed_circle(largest, tolerance=_PRECISION).coords[0]
    return float(inside[0]), float(inside[1])


def _far(area: BaseGeometry, start: Point2) -> list[Point2]:
    """Return the corner of an area farthest from ``start``, and the one farthest from both."""
    corners = [(float(x), float(y)) for x, y in shapely.get_coordinates(area)]
    points = [start]
    for _ in range(2):
        points.append(max(corners, key=lambda c: min(math.dist(c, other) for other in points)))
    return [point for point in points[1:] if Point(point).distance(Point(start)) > _PRECISION]


def new_campaign(
    name: str,
    *,
    plan: str = "",
    errand: Errand | None = None,
    robot: str = "",
    suts: Sequence[str] = ("pilot",),
) -> dict[str, str]:
    """Return the files of a new campaign by name, ``campaign.yaml`` first.

    ``plan`` and ``errand`` belong to an existing building; by default it is a flat of two rooms and
    a door. Without a ``robot``, :data:`ROBOT_FILE` is among the files. ``plan`` and ``robot`` are
    names in the campaign's folder. ``suts`` are the systems under test.
    """
    own = not plan
    ways = errand or _OWN_ERRAND

    def fill(template: str, **values: object) -> str:
        return render(f"new/{template}.j2", doors=own, **values)

    files = {
        "campaign.yaml": fill(
            "campaign.yaml",
            name=name,
            about="A robot runs an errand in a flat." if own else "A robot runs an errand.",
            repeats=3,
            limit=_limit(ways.length),
            plan="flat" if own else _yaml_text(plan),
            robot=_yaml_text(robot or ROBOT_FILE.removesuffix(".yaml")),
            suts=suts,
        ),
        "errand.mission.yaml": fill(
            "mission.yaml",
            frame="floor plan" if own else "building",
            start=ways.start,
            stops=ways.stops,
        ),
        "navigation.oracles.yaml": fill("oracles.yaml"),
    }
    if not robot:
        files[ROBOT_FILE] = fill("robot.yaml")
    if own:
        layers = ("flat.fpm", "doors.scenery", "door_open.scenery", "door_opens_late.scenery")
        files |= {layer: fill(layer) for layer in layers}
    return files


def _limit(length: float) -> str:
    """Return a time limit for a speed of 0.2 m/s, which leaves time for detours."""
    return f"{max(2, math.ceil(length / 0.2 / 60.0))} min"


def _yaml_text(text: str) -> str:
    return text if re.fullmatch(r"[A-Za-z0-9_.][A-Za-z0-9_./-]*", text) else json.dumps(text)
