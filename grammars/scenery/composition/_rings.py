"""Polygons in canonical form, so that equal geometry gives equal bytes on every machine."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.geometry import Point2, Pose2, Ring, signed_area, turn

# Nanometres: far below anything built, far above the last digits in which versions of GEOS differ.
# Digests of scenes are taken of these numbers and must be equal on every machine.
DIGITS: Final = 9
SLIVER: Final = 1e-9
"""Pieces with less area [m^2] are numerical dust."""
_FLAT: Final = 1e-10


def rounded(value: float, digits: int = DIGITS) -> float:
    """Return ``value`` rounded to nanometres, without negative zero."""
    return round(value, digits) + 0.0


def rounded_point(point: Point2) -> Point2:
    """Return ``point`` with rounded coordinates."""
    return (rounded(point[0]), rounded(point[1]))


def rounded_pose(pose: Pose2) -> Pose2:
    """Return ``pose`` with rounded numbers (yaw to 1e-12 rad)."""
    return Pose2(rounded(pose.x), rounded(pose.y), rounded(pose.yaw, 12))


def canonical_ring(points: Iterable[Point2]) -> Ring:
    """Return the corners counter-clockwise from the lowest (x, y), without repeated corners."""
    corners: list[Point2] = []
    for point in map(rounded_point, points):
        if not corners or point != corners[-1]:
            corners.append(point)
    while len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if signed_area(corners) < 0.0:
        corners.reverse()
    # Where a ring begins means nothing, but it shows in its bytes.
    start = corners.index(min(corners)) if corners else 0
    return tuple(corners[start:] + corners[:start])


def outline_of(polygon: Polygon) -> Ring:
    """Return the canonical outer ring of ``polygon``."""
    return canonical_ring((float(x), float(y)) for x, y in polygon.exterior.coords[:-1])


def polygons_of(geometry: BaseGeometry) -> list[Polygon]:
    """Return the polygons in ``geometry`` that are more than dust."""
    parts: list[Any] = list(getattr(geometry, "geoms", [geometry]))
    return [p for p in parts if isinstance(p, Polygon) and p.area > SLIVER]


def without_flat_corners(ring: Ring) -> Ring:
    """Drop corners on the straight line between their neighbours."""
    kept = [
        point
        for i, point in enumerate(ring)
        if abs(turn(ring[i - 1], point, ring[(i + 1) % len(ring)])) > _FLAT
    ]
    return canonical_ring(kept) if len(kept) >= 3 else ring


def is_convex(ring: Ring) -> bool:
    """Return whether a counter-clockwise ring has no dents (up to rounding)."""
    return all(turn(ring[i - 2], ring[i - 1], ring[i]) >= -_FLAT for i in range(len(ring)))
