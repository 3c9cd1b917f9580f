"""How long a mission takes at least: the shortest way through the free floor, at top speed."""

from __future__ import annotations

import functools
import heapq
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import inscribed_radius, valid_polygon
from grammars.model.geometry import Floats, Point2
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.preflight._checked import free_space
from grammars.text.diagnostics import Diagnostic, Severity, Where

_ARRIVAL: Final = 0.5
"""So far from a waypoint [m] may a system be content; the tolerances of stacks are smaller."""
_SLACK: Final = 1.5
"""So much longer than from door to door are ways hardly ever: shortcuts make them shorter."""
_TOUCHING: Final = 0.1
"""A doorway this near to the floor of a room [m] leads to it."""
_CONVEX: Final = 0.95
"""A room that fills so much of its convex hull has nothing to go round."""
_MOST_CORNERS: Final = 1500
"""Beyond so many corners of walls, as outlines of drawn maps have, ways are taken for straight."""
_GRAZE: Final = 1e-4
"""A line of sight may leave the floor by this [m]: it touches the corners that it goes round."""


def check_limit(
    scene: Scene,
    robot: Robot,
    mission: Mission,
    speeds: Mapping[str, float],
    *,
    limit: float,
    where: Where,
) -> list[Diagnostic]:
    """Return a warning for a limit [s] in which no run can end its mission.

    ``speeds`` are the largest of the systems under test by name [m/s], ``where`` is the place of
    the limit.
    """
    slowest = min(speeds.values(), default=math.inf)
    if not math.isfinite(slowest):
        return []
    way = shortest_way(scene, robot, mission, limit * slowest)
    late = [
        f"{name} at least {way / speed:.1f} s for {way:.1f} m at {speed:.2f} m/s"
        for name, speed in speeds.items()
        if way > limit * speed
    ]
    if not late:
        return []
    message = f"{limit:g} s are too short for mission {mission.name}: it takes {', '.join(late)}"
    hint = "give it a longer limit, or the runs end before the last waypoint"
    return [Diagnostic(where, message, hint, Severity.WARNING)]


def shortest_way(scene: Scene, robot: Robot, mission: Mission, enough: float) -> float:
    """Return a lower bound of the way of a mission [m].

    The robot is a disc of its inscribed radius, comes only near to each waypoint and finds all
    doors open. Ways are straight where already these are longer than ``enough`` [m], or where the
    ways from door to door are clearly shorter.
    """
    points = [(mission.start.x, mission.start.y), *((w.x, w.y) for w in mission.waypoints)]
    legs = list(itertools.pairwise(points))
    straight = _counted([math.dist(a, b) for a, b in legs])
    if straight > enough or _SLACK * _way_by_doors(scene, legs) < enough:
        return straight
    floor = _floor(scene, robot)
    return _counted([floor.distance(a, b) for a, b in legs])


def _way_by_doors(scene: Scene, legs: Sequence[tuple[Point2, Point2]]) -> float:
    """Return about how long a way is from doorway to doorway [m]; infinite where none is known."""
    rooms = np.array([valid_polygon(region.outline) for region in scene.regions], dtype=object)
    if not len(rooms):
        return math.inf
    doors = [valid_polygon(doorway.footprint) for doorway in scene.doorways]
    ends = [Point(point) for leg in legs for point in leg]
    places = np.array([*doors, *ends], dtype=object)
    # Ends and doorways of one room see each other, or there is a way along its walls.
    member, room = shapely.STRtree(rooms).query(places, predicate="dwithin", distance=_TOUCHING)
    inside = np.zeros((len(places), len(rooms)), bool)
    inside[member, room] = True
    centres = shapely.get_coordinates(shapely.centroid(places))
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    convex = shapely.area(rooms) > _CONVEX * shapely.area(shapely.convex_hull(rooms))
    around = np.where(convex, 0.0, shapely.length(rooms) / 2.0)
    ways = apart + np.where(inside[:, None] & inside[None], around, np.inf).min(axis=2)
    doorways = len(doors)
    between = ways[:doorways, :doorways]
    for door in range(doorways):
        between = np.minimum(between, between[:, door, None] + between[None, door])
    total = 0.0
    for index in range(doorways, len(places), 2):
        start, goal = ways[index, :doorways], ways[index + 1, :doorways]
        through = (start[:, None] + between + goal[None]).min() if doorways else np.inf
        total += min(float(ways[index, index + 1]), float(through))
    return total


def _counted(legs: Sequence[float]) -> float:
    """Return the length of a way that begins and ends legs within the arrival distance [m]."""
    ends = [_ARRIVAL, *([2.0 * _ARRIVAL] * (len(legs) - 1))]
    return math.fsum(max(0.0, leg - end) for leg, end in zip(legs, ends, strict=True))


@functools.lru_cache(maxsize=4)
def _floor(scene: Scene, robot: Robot) -> _Floor:
    radius = inscribed_radius(robot.footprint)
    return _Floor(free_space(scene, robot.height).area.buffer(-radius, join_style="bevel"))


class _Floor:
    """Where a point may be, and the shortest ways through it (by lines of sight)."""

    def __init__(self, area: BaseGeometry) -> None:
        self.parts: list[Any] = [p for p in shapely.get_parts(area).tolist() if p.area > 0.0]
        self._sight = shapely.buffer(np.array(self.parts, dtype=object), _GRAZE)
        shapely.prepare(self._sight)
        self._seen: dict[tuple[int, float, float], Any] = {}

    def distance(self, start: Point2, goal: Point2) -> float:
        """Return the length of the shortest way [m], of the straight one where none is known."""
        straight = math.dist(start, goal)
        if not self.parts:
            return straight
        parts = np.array(self.parts, dtype=object)
        homes = [int(np.argmin(shapely.distance(parts, Point(spot)))) for spot in (start, goal)]
        part = self.parts[homes[0]]
        if homes[0] != homes[1] or len(_corners(part)) > _MOST_CORNERS:
            return straight
        ends = [shapely.shortest_line(part, Point(spot)) for spot in (start, goal)]
        first, last = (shapely.get_coordinates(line)[0] for line in ends)
        # A spot a little beside the floor begins on it: the way there is not counted.
        found = self._search(homes[0], first, last)
        return max(straight - math.fsum(line.length for line in ends), found)

    def _search(self, part: int, start: Floats, goal: Floats) -> float:
        """Return the length of the shortest way in a part (A*) [m]."""
        turns = _corners(self.parts[part])
        corners = np.vstack([turns, start, goal])
        last, first = len(corners) - 1, len(corners) - 2
        ahead = np.linalg.norm(corners - goal, axis=1)
        best = np.full(len(corners), np.inf)
        best[first] = 0.0
        queue = [(float(ahead[first]), first)]
        done = np.zeros(len(corners), bool)
        while queue:
            _, here = heapq.heappop(queue)
            if here == last:
                break
            if done[here]:
                continue
            done[here] = True
            seen = np.zeros(len(corners), bool)
            seen[:first] = self._seen_from(part, corners[here], turns)
            seen[last] = self._sees(part, corners[here], corners[last:])[0]
            ways = best[here] + np.linalg.norm(corners - corners[here], axis=1)
            shorter = np.flatnonzero(seen & (ways < best))
            best[shorter] = ways[shorter]
            for node in shorter.tolist():
                heapq.heappush(queue, (float(best[node] + ahead[node]), node))
        return float(best[last]) if np.isfinite(best[last]) else 0.0

    def _seen_from(self, part: int, here: Floats, turns: Floats) -> Any:
        key = (part, float(here[0]), float(here[1]))
        if key not in self._seen:
            self._seen[key] = self._sees(part, here, turns)
        return self._seen[key]

    def _sees(self, part: int, here: Floats, there: Floats) -> Any:
        lines = shapely.linestrings(np.stack([np.broadcast_to(here, there.shape), there], axis=1))
        return shapely.covers(self._sight[part], lines)


def _corners(part: BaseGeometry) -> Floats:
    """Return the corners that stick out into the floor: shortest ways turn nowhere else."""
    polygon: Any = shapely.normalize(part)
    found = []
    for ring in (polygon.exterior, *polygon.interiors):
        corners = shapely.get_coordinates(ring)[:-1]
        before = corners - np.roll(corners, 1, axis=0)
        after = np.roll(corners, -1, axis=0) - corners
        turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        # Normalised rings have the floor to their right, outside and around holes alike.
        found.append(corners[turn > 0.0])
    return np.concatenate(found)
