"""The floor that the links of an object cover while its joints move."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.kinematics import link_poses
from grammars.movers import is_fixed
from grammars.scene import Joint, Link, Scene, SceneObject

_TURN: Final = math.radians(4.0)
_SLIDE: Final = 0.05
DEPTH: Final = 0.01
"""Overlaps that are nowhere deeper than this [m] are taken for touching."""
JAMB: Final = 0.08
"""Around a hinge, wall and leaf may overlap: doors turn in rebates."""


def link_shape(body: SceneObject, link: Link, positions: Sequence[float]) -> BaseGeometry:
    """Return the outline of ``link`` in the world."""
    pose = link_poses(body, positions)[link.name]
    return shapely.union_all([Polygon(pose.apply_ring(ring)) for ring in link.polygons])


def moving_links(body: SceneObject) -> tuple[Link, ...]:
    """Return the links with a shape that a joint can move, directly or through others."""
    moved = _moved(body)
    return tuple(link for link in body.links if link.name in moved and link.polygons)


def still_links(body: SceneObject) -> tuple[Link, ...]:
    """Return the links that stand still whatever the joints do."""
    moved = _moved(body)
    return tuple(link for link in body.links if link.name not in moved)


def _moved(body: SceneObject) -> set[str]:
    above = {joint.child: joint for joint in body.joints}
    moved: set[str] = set()
    for link in body.links:
        name = link.name
        while name in above:
            if not is_fixed(above[name]):
                moved.add(link.name)
                break
            name = above[name].parent
    return moved


def swept(body: SceneObject, link: Link, ranges: Mapping[str, tuple[float, float]]) -> BaseGeometry:
    """Return what ``link`` covers while each joint moves alone through its range [rad or m].

    Joints without a range stay where they are at the start. Between steps the convex hull of two
    neighbouring placements is taken, so nothing is missed but the bulge of a short arc.
    """
    shapes = [link_shape(body, link, body.initial)]
    for index, joint in enumerate(body.joints):
        if joint.name not in ranges:
            continue
        low, high = ranges[joint.name]
        placements = [
            link_shape(body, link, [*body.initial[:index], q, *body.initial[index + 1 :]])
            for q in _steps(joint, low, high)
        ]
        shapes.extend(placements)
        shapes.extend(
            shapely.convex_hull(shapely.union(a, b))
            for a, b in itertools.pairwise(placements)
            if len(link.polygons) == 1
        )
    return shapely.union_all(shapes)


def _steps(joint: Joint, low: float, high: float) -> list[float]:
    step = _TURN if joint.kind == "revolute" else _SLIDE
    count = min(2 + int(abs(high - low) / step), 400)
    return [float(q) for q in np.linspace(low, high, count)]


def without_jamb(body: SceneObject, link: Link, overlap: BaseGeometry) -> BaseGeometry:
    """Return ``overlap`` without the surroundings of the hinge that carries ``link``."""
    for joint in body.joints:
        if joint.child == link.name and joint.kind == "revolute":
            return overlap.difference(Point(body.pose.apply(joint.anchor)).buffer(JAMB))
    return overlap


def is_deep(overlap: BaseGeometry) -> bool:
    """Return whether an overlap is more than touching."""
    return not overlap.is_empty and not overlap.buffer(-DEPTH).is_empty


class Obstacles:
    """The solids of a scene, searchable by place."""

    def __init__(self, scene: Scene) -> None:
        self.solids = scene.solids
        self.shapes = [Polygon(s.polygon) for s in scene.solids]
        self._tree = shapely.STRtree(self.shapes)

    def hit_by(self, shape: BaseGeometry, z_min: float, z_max: float) -> dict[str, BaseGeometry]:
        """Return the overlap of ``shape`` between two heights with solids, by owner."""
        found: dict[str, list[BaseGeometry]] = {}
        for index in sorted(self._tree.query(shape, predicate="intersects").tolist()):
            solid = self.solids[index]
            if solid.z_min < z_max and z_min < solid.z_max:
                overlap = shape.intersection(self.shapes[index])
                found.setdefault(solid.owner, []).append(overlap)
        return {owner: shapely.union_all(parts) for owner, parts in found.items()}

    def nearest(self, x: float, y: float, z_max: float) -> tuple[float, str]:
        """Return distance [m] and owner of the solid below ``z_max`` that is nearest to a point.

        The distance is 0 inside of a solid, infinite when there is none.
        """
        point = Point(x, y)
        best = (math.inf, "")
        for radius in (2.0, 1e6):
            for index in self._tree.query(point.buffer(radius)).tolist():
                if self.solids[index].z_min < z_max:
                    distance = self.shapes[index].distance(point)
                    best = min(best, (distance, self.solids[index].owner))
            if best[0] <= radius:
                break
        return best
