"""Does a body get through the narrow places of a building, turning as it must?

Where a disc around the whole body passes the body does, whatever way it looks; where not even its
inscribed disc passes, it does not. Only between the two a search over position and heading is made:
the free positions at every few degrees of heading, connected where neighbouring ones overlap
(the slices of Lozano-Perez, Spatial planning: a configuration space approach, 1983). The body is
taken a little smaller than it is, so that no way is missed between two headings: what is said not
to pass does not pass, what barely does not is let through.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import SNAP_DISTANCE, ConnectedParts, inscribed_radius
from grammars.model.geometry import Floats, Point2, Pose2, Ring

_STEP: Final = math.radians(2.0)
"""Between two headings that are looked at."""
_MARGIN: Final = 1e-3
"""What simplifying the outlines of walls moves them at most [m]."""
_MOST_EDGES: Final = 2000
"""Around so many edges in one place, as maps that were not made straight have, nothing is said."""
_SEGMENTS: Final = 8


def circumscribed_radius(footprint: Ring) -> float:
    """Return the distance from the base frame to the farthest corner of the footprint [m]."""
    return max(math.hypot(*corner) for corner in footprint)


def smallest_width(footprint: Ring) -> float:
    """Return the width of a convex footprint across the way on which it is narrowest [m].

    No convex body passes a gap narrower than that (Strang, The width of a chair, 1982).
    """
    corners = np.array(footprint)
    ways = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(ways, axis=1)
    normals = np.column_stack([-ways[:, 1], ways[:, 0]])[lengths > 0.0]
    across = corners @ (normals / lengths[lengths > 0.0, None]).T
    return float((across.max(axis=0) - across.min(axis=0)).min())


class _Sets:
    """Disjoint sets of numbers."""

    def __init__(self) -> None:
        self._above: list[int] = []

    def add(self) -> int:
        self._above.append(len(self._above))
        return self._above[-1]

    def find(self, one: int) -> int:
        while self._above[one] != one:
            self._above[one] = self._above[self._above[one]]
            one = self._above[one]
        return one

    def join(self, one: int, other: int) -> None:
        self._above[self.find(other)] = self.find(one)


@dataclass(frozen=True, slots=True)
class _Spot:
    """A start or a goal: its number among the sets, and which way the body looks there."""

    number: int
    point: Point2
    yaw: float | None = None


class TurningSpace:
    """Where a body can be in ``area``, the free floor, if it may look any way.

    ``footprint`` is convex, around the base frame [m].
    """

    def __init__(self, area: BaseGeometry, footprint: Ring) -> None:
        self._area = area
        self._footprint = footprint
        self._radius = circumscribed_radius(footprint)
        self._play = self._radius - inscribed_radius(footprint)
        # Within a hub the body turns as it likes.
        self._near = ConnectedParts(area.buffer(-self._radius, quad_segs=_SEGMENTS))
        self._hubs = self._near.parts

    def blocked(self, start: Pose2, points: Sequence[Point2]) -> dict[int, Point2]:
        """Return which points the body cannot get to from ``start``, and where it gets stuck."""
        first = self._hubs_near((start.x, start.y))
        ways = [self._hubs_near(point) for point in points]
        if first and all(not first.isdisjoint(way) for way in ways):
            return {}
        return self._search(start, points, first, ways)

    @functools.cached_property
    def _walls(self) -> BaseGeometry:
        """The outlines of all that stands around and in the floor."""
        return self._area.simplify(_MARGIN).boundary

    def _hubs_near(self, point: Point2) -> set[int]:
        # From beside a straight wall, or out of a corner of a room, a body gets to where it can
        # turn.
        reach = 1.5 * self._play + SNAP_DISTANCE
        return self._near.near(point, reach)

    def _search(
        self, start: Pose2, points: Sequence[Point2], first: set[int], ways: Sequence[set[int]]
    ) -> dict[int, Point2]:
        sets = _Sets()
        hubs = [sets.add() for _ in self._hubs]
        home = _Spot(sets.add(), (start.x, start.y), start.yaw)
        goals = [_Spot(sets.add(), point) for point in points]
        lost = []
        for spot, near in zip((home, *goals), (first, *ways), strict=True):
            for hub in near:
                sets.join(spot.number, hubs[hub])
            if not near:
                lost.append(spot)
        tight: list[tuple[int, BaseGeometry]] = []
        for window in self._windows():
            if all(sets.find(goal.number) == sets.find(home.number) for goal in goals):
                break
            here = [spot for spot in lost if window.distance(Point(spot.point)) <= SNAP_DISTANCE]
            beside = {
                hubs[index]: hub for index, hub in enumerate(self._hubs) if hub.intersects(window)
            }
            nodes = [*beside, *(spot.number for spot in here)]
            if len({sets.find(node) for node in nodes}) > 1:
                tight += _join_slices(sets, self._slices(window), beside, here)
        found: dict[int, Point2] = {}
        for index, goal in enumerate(goals):
            if sets.find(goal.number) != sets.find(home.number):
                places = [
                    shapely.union_all([p for n, p in tight if sets.find(n) == sets.find(number)])
                    for number in (home.number, goal.number)
                ]
                # Who is beside all that was looked at is given the benefit of the doubt.
                if not any(place.is_empty for place in places):
                    found[index] = _between(*places)
        return found

    def _windows(self) -> Iterator[BaseGeometry]:
        """Yield the places around which the body cannot turn as it likes."""
        opened = [hub.buffer(self._play + 0.02, quad_segs=_SEGMENTS) for hub in self._hubs]
        free = self._area.buffer(self._play - self._radius, quad_segs=_SEGMENTS)
        tight = [free.difference(shapely.union_all(opened))]
        if opened:
            shapes = np.array(opened, dtype=object)
            pairs = shapely.STRtree(shapes).query(shapes, predicate="intersects").T.tolist()
            tight += [opened[a].intersection(opened[b]) for a, b in pairs if a < b]
        reach = 2.0 * self._play + 0.05
        around = shapely.union_all([part.buffer(reach, quad_segs=2) for part in tight])
        yield from _parts(around.intersection(self._area))

    def _slices(self, window: BaseGeometry) -> list[tuple[float, list[Any]]]:
        """Return headings [rad] and the parts of ``window`` in which the body can be at each."""
        # Half a step turns no corner of the body farther than this.
        shrunk = Polygon(self._footprint).buffer(
            -self._radius * math.sin(_STEP / 2.0) - _MARGIN, join_style="mitre"
        )
        if shrunk.is_empty:
            return [(0.0, [window])]
        corners = shapely.get_coordinates(shrunk.exterior)[:-1]
        near = shapely.box(*window.bounds).buffer(self._radius)
        edges = _edges(self._walls.intersection(near))
        if len(edges) > _MOST_EDGES:
            return [(0.0, [window])]
        opposite = shapely.symmetric_difference(shrunk, Polygon(-corners)).area
        around = math.pi if opposite < 1e-6 else math.tau
        headings = [k * _STEP for k in range(round(around / _STEP))]
        return [(heading, _free_at(window, edges, corners, heading)) for heading in headings]


def _parts(area: BaseGeometry) -> list[Any]:
    return [part for part in shapely.get_parts(area).tolist() if part.area > 0.0]


def _edges(lines: BaseGeometry) -> Floats:
    """Return the pieces of lines as an array (n, 2, 2) [m]."""
    pieces = [
        np.stack([line[:-1], line[1:]], axis=1)
        for line in map(shapely.get_coordinates, shapely.get_parts(lines).tolist())
        if len(line) > 1
    ]
    return np.concatenate(pieces) if pieces else np.zeros((0, 2, 2))


def _free_at(window: BaseGeometry, edges: Floats, corners: Floats, heading: float) -> list[Any]:
    """Return where in ``window`` a body of ``corners`` meets no edge while it looks one way."""
    cos, sin = math.cos(heading), math.sin(heading)
    turned = corners @ np.array([[cos, sin], [-sin, cos]])
    # A body at p meets an edge where p lies in the edge swept by the body turned inside out.
    swept = (edges[:, :, None, :] - turned[None, None, :, :]).reshape(len(edges), -1, 2)
    hit = shapely.union_all(shapely.convex_hull(shapely.linestrings(swept)))
    return _parts(window.difference(hit))


def _join_slices(
    sets: _Sets,
    slices: Sequence[tuple[float, list[Any]]],
    hubs: dict[int, Any],
    spots: Sequence[_Spot],
) -> list[tuple[int, BaseGeometry]]:
    """Join what is connected through the slices of one window; return its parts, numbered."""
    numbers = [[sets.add() for _ in parts] for _, parts in slices]
    for index, (heading, parts) in enumerate(slices):
        following = (index + 1) % len(slices)
        for number, part in zip(numbers[index], parts, strict=True):
            shapely.prepare(part)
            for other, neighbour in zip(numbers[following], slices[following][1], strict=True):
                if sets.find(number) != sets.find(other) and part.intersects(neighbour):
                    sets.join(number, other)
            for hub, shape in hubs.items():
                if sets.find(number) != sets.find(hub) and part.intersects(shape):
                    sets.join(number, hub)
            for spot in spots:
                turned = 0.0 if spot.yaw is None else abs(math.sin(heading - spot.yaw))
                near = part.distance(Point(spot.point)) <= SNAP_DISTANCE
                if near and turned <= math.sin(1.5 * _STEP):
                    sets.join(spot.number, number)
    return [
        (number, part)
        for row, (_, parts) in zip(numbers, slices, strict=True)
        for number, part in zip(row, parts, strict=True)
    ]


def _between(reached: BaseGeometry, wanted: BaseGeometry) -> Point2:
    """Return a point where a body gets to, though not looking the way in which it could go on."""
    common = reached.intersection(wanted)
    if common.is_empty:
        common = shapely.shortest_line(reached, wanted)
    return (float(common.centroid.x), float(common.centroid.y))
