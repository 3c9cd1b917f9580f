"""Where a disc of the robot's width can go."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.preflight.sweep import link_shape, still_links
from grammars.scene import Scene
from grammars.values import Point2, Ring

_CORNERS: Final = 8
_FLOOR: Final = 0.01
SNAP: Final = 0.05
"""A pose this near to free space [m] still counts as being in it; maps are no finer."""


def inscribed_radius(footprint: Ring) -> float:
    """Return the distance from the base frame to the nearest side of the footprint [m]."""
    ring = [*footprint, footprint[0]]
    return min(_to_side(a, b) for a, b in itertools.pairwise(ring))


def _to_side(a: Point2, b: Point2) -> float:
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    return abs(a[0] * b[1] - a[1] * b[0]) / length if length else math.hypot(*a)


class FreeSpace:
    """The floor below ``height`` [m] that no solid and no standing part of an object covers."""

    def __init__(self, scene: Scene, height: float, standing: Sequence[BaseGeometry] = ()) -> None:
        low = [s for s in scene.solids if s.z_min < height and s.z_max > _FLOOR]
        solid: list[BaseGeometry] = [Polygon(s.polygon) for s in low]
        posts = [
            link_shape(body, link, body.initial)
            for body in scene.objects
            for link in still_links(body)
            if link.z_min < height
        ]
        rooms = [_valid(r.outline) for r in scene.regions]
        passages = [
            _valid(d.footprint).buffer(0.02) for d in scene.doorways if d.z_min < _FLOOR + 0.02
        ]
        floor = shapely.union_all([*rooms, *passages])
        self.area: BaseGeometry = floor.difference(shapely.union_all([*solid, *posts]))

    def for_radius(self, radius: float, blocked: Iterable[BaseGeometry] = ()) -> Components:
        """Return where the centre of a disc can be, in parts that are not connected.

        ``blocked`` are further outlines that nothing passes, such as doors that stay shut.
        """
        area = self.area.difference(shapely.union_all(list(blocked)))
        return Components(area.buffer(-radius, quad_segs=_CORNERS))


class Components:
    """Parts of the plane without a way from one to another."""

    def __init__(self, area: BaseGeometry) -> None:
        self.parts: list[Any] = [p for p in shapely.get_parts(area).tolist() if p.area > 0.0]

    def of(self, point: Point2, reach: float = SNAP) -> int | None:
        """Return the part that holds ``point`` or is within ``reach`` [m] of it."""
        if not self.parts:
            return None
        distances = shapely.distance(np.array(self.parts, dtype=object), Point(point))
        nearest = int(np.argmin(distances))
        return nearest if float(distances[nearest]) <= reach else None


def _valid(ring: Ring) -> BaseGeometry:
    polygon = Polygon(ring)
    return polygon if polygon.is_valid else polygon.buffer(0)
