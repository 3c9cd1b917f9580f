"""Areas covered by links at rest and in motion, and the remaining free floor.

All areas are seen from above, as shapely geometry in the world [m]; shapes meet only if their
heights overlap.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.kinematics import link_poses
from grammars.model.movers import is_fixed
from grammars.model.scene import Joint, Link, Scene, SceneObject

# For a leaf of 1 m, the arc between placements 4 degrees apart bulges 0.6 mm over their hull.
_TURN: Final = math.radians(4.0)
_SLIDE: Final = 0.05
TOUCHING_DEPTH: Final = 0.01
"""Overlaps up to this depth [m] count as touching."""
JAMB_RADIUS: Final = 0.08
"""Radius around a hinge [m] within which wall and leaf may overlap: doors turn in rebates."""


def link_shapes(body: SceneObject, positions: Sequence[float]) -> dict[str, BaseGeometry]:
    """Return the outlines of all links in the world by name, at joint ``positions`` [rad or m]."""
    poses = link_poses(body, positions)
    return {
        link.name: shapely.union_all(
            [Polygon(poses[link.name].apply_ring(ring)) for ring in link.polygons]
        )
        for link in body.links
    }


def moving_links(body: SceneObject) -> tuple[Link, ...]:
    """Return the links with a shape that a joint can move, directly or through other links."""
    moving = _moving_link_names(body)
    return tuple(link for link in body.links if link.name in moving and link.polygons)


def still_links(body: SceneObject) -> tuple[Link, ...]:
    """Return the links that no joint can move."""
    moving = _moving_link_names(body)
    return tuple(link for link in body.links if link.name not in moving)


def _moving_link_names(body: SceneObject) -> set[str]:
    above = {joint.child: joint for joint in body.joints}
    moving: set[str] = set()
    for link in body.links:
        name = link.name
        while name in above:
            if not is_fixed(above[name]):
                moving.add(link.name)
                break
            name = above[name].parent
    return moving


def swept_area(
    body: SceneObject, link: Link, ranges: Mapping[str, tuple[float, float]]
) -> BaseGeometry:
    """Return the area of ``link`` while each joint moves alone through its range [rad or m].

    Joints without a range stay at their start position. The area is the union of convex hulls of
    neighbouring placements, so it misses only the bulges of short arcs.
    """
    return shapely.union_all(swept_pieces(body, link, ranges))


def swept_pieces(
    body: SceneObject, link: Link, ranges: Mapping[str, tuple[float, float]]
) -> list[BaseGeometry]:
    """Return convex pieces that make up :func:`swept_area`."""
    start = link_poses(body, body.initial)[link.name]
    pieces: list[BaseGeometry] = [Polygon(start.apply_ring(ring)) for ring in link.polygons]
    for index, joint in enumerate(body.joints):
        if joint.name not in ranges:
            continue
        low, high = ranges[joint.name]
        poses = [
            link_poses(body, [*body.initial[:index], q, *body.initial[index + 1 :]])[link.name]
            for q in _steps(joint, low, high)
        ]
        pieces += [hull for ring in link.polygons for hull in hulls_between(poses, ring)]
    return pieces


def hulls_between(poses: Sequence[Pose2], ring: Ring) -> list[BaseGeometry]:
    """Return the convex hull of a convex ring at each pose and the next one."""
    placed = np.array([pose.apply_ring(ring) for pose in poses])
    both = np.concatenate([placed[:-1], placed[1:]], axis=1)
    hulls: Any = shapely.convex_hull(shapely.linestrings(both))
    return list(hulls)


def _steps(joint: Joint, low: float, high: float) -> list[float]:
    step = _TURN if joint.kind == "revolute" else _SLIDE
    # Practically unlimited joints reach 10 km: they are swept coarsely.
    count = min(2 + int(abs(high - low) / step), 400)
    return [float(q) for q in np.linspace(low, high, count)]


def without_jamb(body: SceneObject, link: Link, overlap: BaseGeometry) -> BaseGeometry:
    """Return ``overlap`` without the surroundings of the hinge that carries ``link``."""
    for joint in body.joints:
        if joint.child == link.name and joint.kind == "revolute":
            return overlap.difference(Point(body.pose.apply(joint.anchor)).buffer(JAMB_RADIUS))
    return overlap


def is_overlap(overlap: BaseGeometry) -> bool:
    """Return whether an overlap is more than touching."""
    return not overlap.is_empty and not overlap.buffer(-TOUCHING_DEPTH).is_empty


class SolidIndex:
    """The solids of a scene, searchable by place."""

    def __init__(self, scene: Scene) -> None:
        self.solids = scene.solids
        self.shapes = [Polygon(s.polygon) for s in scene.solids]
        self._tree = shapely.STRtree(self.shapes)

    def hit_by(self, shape: BaseGeometry, z_min: float, z_max: float) -> dict[str, BaseGeometry]:
        """Return the overlap of ``shape`` between two heights with solids, by owner."""
        overlaps: dict[str, list[BaseGeometry]] = {}
        for index in sorted(self._tree.query(shape, predicate="intersects").tolist()):
            solid = self.solids[index]
            if solid.z_min < z_max and z_min < solid.z_max:
                overlap = shape.intersection(self.shapes[index])
                overlaps.setdefault(solid.owner, []).append(overlap)
        return {owner: shapely.union_all(parts) for owner, parts in overlaps.items()}

    def nearest(self, x: float, y: float, z_max: float) -> tuple[float, str]:
        """Return distance [m] and owner of the nearest solid below ``z_max``.

        The distance is 0 inside a solid, and infinite without solids.
        """
        point = Point(x, y)
        best = (math.inf, "")
        # If a wall is within 2 m, skip the rest of the building.
        for radius in (2.0, 1e6):
            for index in self._tree.query(point.buffer(radius)).tolist():
                if self.solids[index].z_min < z_max:
                    distance = self.shapes[index].distance(point)
                    best = min(best, (distance, self.solids[index].owner))
            if best[0] <= radius:
                break
        return best


_CORNERS: Final = 8
_FLOOR: Final = 0.01
SNAP_DISTANCE: Final = 0.05
"""Poses up to this distance [m] from free space count as inside; maps have this resolution."""


def inscribed_radius(footprint: Ring) -> float:
    """Return the distance from the base frame to the nearest side of the footprint [m]."""
    ring = [*footprint, footprint[0]]
    return min(_to_side(a, b) for a, b in itertools.pairwise(ring))


def circumscribed_radius(footprint: Ring) -> float:
    """Return the largest distance from the base frame to a corner of the footprint [m]."""
    return max(math.hypot(*corner) for corner in footprint)


def _to_side(a: Point2, b: Point2) -> float:
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    return abs(a[0] * b[1] - a[1] * b[0]) / length if length else math.hypot(*a)


class FreeSpace:
    """The floor not covered by solids or still links of objects below ``height`` [m]."""

    def __init__(self, scene: Scene, height: float, standing: Sequence[BaseGeometry] = ()) -> None:
        low = [s for s in scene.solids if s.z_min < height and s.z_max > _FLOOR]
        solid: list[BaseGeometry] = [Polygon(s.polygon) for s in low]
        posts = [
            shapes[link.name]
            for body in scene.objects
            for shapes in [link_shapes(body, body.initial)]
            for link in still_links(body)
            if link.z_min < height
        ]
        rooms = [valid_polygon(region.outline, region.holes) for region in scene.regions]
        # Slightly wider than real: doorway and room share an edge only up to rounding errors, and
        # a slit would split the floor.
        passages = [
            valid_polygon(d.footprint).buffer(0.02)
            for d in scene.doorways
            if d.z_min < _FLOOR + 0.02
        ]
        floor = shapely.union_all([*rooms, *passages])
        self.area: BaseGeometry = floor.difference(shapely.union_all([*solid, *posts]))

    def for_radius(self, radius: float, blocked: Iterable[BaseGeometry] = ()) -> ConnectedParts:
        """Return the possible positions of the centre of a disc, in connected parts.

        ``blocked`` has further impassable outlines, such as doors that stay shut.
        """
        return _connected_parts(self, radius, tuple(blocked))


# Buffering is slow, and scenarios in one building mostly have the same shut doors.
@functools.lru_cache(maxsize=128)
def _connected_parts(
    space: FreeSpace, radius: float, blocked: tuple[BaseGeometry, ...]
) -> ConnectedParts:
    area = space.area.difference(shapely.union_all(blocked)) if blocked else space.area
    return ConnectedParts(area.buffer(-radius, quad_segs=_CORNERS))


class ConnectedParts:
    """Connected parts of an area."""

    def __init__(self, area: BaseGeometry) -> None:
        self.parts: list[Any] = [p for p in shapely.get_parts(area).tolist() if p.area > 0.0]

    def of(self, point: Point2, reach: float = SNAP_DISTANCE) -> int | None:
        """Return the index of the part within ``reach`` [m] of ``point``, if any."""
        if not self.parts:
            return None
        distances = shapely.distance(np.array(self.parts, dtype=object), Point(point))
        nearest = int(np.argmin(distances))
        return nearest if float(distances[nearest]) <= reach else None


def valid_polygon(ring: Ring, holes: Sequence[Ring] = ()) -> BaseGeometry:
    """Return the area of an outline, even if it touches or crosses itself."""
    polygon = Polygon(ring, holes)
    return polygon if polygon.is_valid else polygon.buffer(0)
