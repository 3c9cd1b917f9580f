"""Canonical polygons, so that equal geometry gives equal bytes on all machines, and their fast
decomposition into few convex pieces.

Triangles are joined across their longest common edges while the result stays convex (Hertel and
Mehlhorn, 1983: at most four times as many pieces as necessary). Each edge is visited once.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from typing import Any, Final, TypeAlias

import shapely
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import valid_polygon
from grammars.model.geometry import Point2, Pose2, Ring, signed_area, turn

# Nanometres: far below any building, far above the last digits, which differ between versions of
# GEOS. Digests of scenes must be equal on all machines.
DIGITS: Final = 9
SLIVER: Final = 1e-9
"""Pieces with a smaller area [m^2] are numerical noise."""
_FLAT: Final = 1e-10
_Edge: TypeAlias = tuple[Point2, Point2]
_BENT: Final = 1e-10
"""Corners with a smaller dent [m²] count as straight, as everywhere in a scene."""
_MOST_CUTS: Final = 40


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
    """Return the corners counter-clockwise from the smallest (x, y), without repeated corners."""
    corners: list[Point2] = []
    for point in map(rounded_point, points):
        if not corners or point != corners[-1]:
            corners.append(point)
    while len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if signed_area(corners) < 0.0:
        corners.reverse()
    # The first corner is arbitrary, but changes the bytes.
    start = corners.index(min(corners)) if corners else 0
    return tuple(corners[start:] + corners[:start])


def outline_of(polygon: Polygon) -> Ring:
    """Return the canonical outer ring of ``polygon``."""
    return canonical_ring((float(x), float(y)) for x, y in polygon.exterior.coords[:-1])


def polygons_of(geometry: BaseGeometry) -> list[Polygon]:
    """Return the polygons in ``geometry`` except slivers."""
    parts: list[Any] = list(getattr(geometry, "geoms", [geometry]))
    return [p for p in parts if isinstance(p, Polygon) and p.area > SLIVER]


def without_flat_corners(ring: Ring) -> Ring:
    """Return the ring without corners on the straight line between their neighbours."""
    corners = [
        point
        for i, point in enumerate(ring)
        if abs(turn(ring[i - 1], point, ring[(i + 1) % len(ring)])) > _FLAT
    ]
    return canonical_ring(corners) if len(corners) >= 3 else ring


def is_convex(ring: Ring) -> bool:
    """Return whether a counter-clockwise ring has no dents (up to rounding)."""
    return all(turn(ring[i - 2], ring[i - 1], ring[i]) >= -_FLAT for i in range(len(ring)))


def convex_rings(geometry: BaseGeometry) -> list[Ring]:
    """Decompose valid polygons with holes into convex rings; equal areas give equal rings."""
    rings: list[Ring] = []
    for polygon in polygons_of(geometry):
        outline = without_flat_corners(outline_of(polygon))
        if not polygon.interiors and is_convex(outline):
            rings.append(outline)
        else:
            rings.extend(map(_convex, _joined(_triangles(polygon, _MOST_CUTS))))
    return sorted(rings)


def _convex(ring: Ring) -> Ring:
    ring = without_flat_corners(ring)
    # Many nearly straight corners may add up to a real dent.
    return ring if is_convex(ring) else _hull(ring)


def _hull(ring: Ring) -> Ring:
    corners = shapely.get_coordinates(shapely.convex_hull(Polygon(ring)))[:-1].tolist()
    return without_flat_corners(canonical_ring((x, y) for x, y in corners))


def _triangles(area: Polygon, cuts: int) -> list[Ring]:
    try:
        triangles = shapely.constrained_delaunay_triangles(area)
    except shapely.GEOSException:
        # GEOS fails for some areas with touching holes, but not for their halves, and for corners
        # much less than a nanometre apart, which are the same in a scene.
        if cuts == 0:
            raise
        outline, *holes = (canonical_ring(r.coords[:-1]) for r in (area.exterior, *area.interiors))
        snapped = valid_polygon(outline, holes)
        halves = itertools.chain.from_iterable(
            polygons_of(snapped.intersection(half)) for half in _halves(area)
        )
        return [ring for half in halves for ring in _triangles(half, cuts - 1)]
    return sorted(outline_of(triangle) for triangle in polygons_of(triangles))


def _halves(area: Polygon) -> tuple[Polygon, Polygon]:
    x0, y0, x1, y1 = area.bounds
    if x1 - x0 > y1 - y0:
        middle = (x0 + x1) / 2
        return box(x0, y0, middle, y1), box(middle, y0, x1, y1)
    middle = (y0 + y1) / 2
    return box(x0, y0, x1, middle), box(x0, middle, x1, y1)


def _joined(triangles: Iterable[Ring]) -> Iterator[Ring]:
    """Yield convex unions of counter-clockwise triangles that share corners."""
    after: dict[_Edge, _Edge] = {}
    before: dict[_Edge, _Edge] = {}
    for ring in triangles:
        edges = list(itertools.pairwise((*ring, ring[0])))
        for one, other in itertools.pairwise((*edges, edges[0])):
            after[one], before[other] = other, one
    for edge in sorted(_shared(after), key=lambda edge: (-math.dist(*edge), edge)):
        back = (edge[1], edge[0])
        # The edges that would follow each other at both ends without this edge.
        ends = ((before[edge], after[back]), (before[back], after[edge]))
        if all(_bends_left(one[0], one[1], other[1]) for one, other in ends):
            for one, other in ends:
                after[one], before[other] = other, one
            for half in (edge, back):
                del after[half], before[half]
    while after:
        first = next(iter(after))
        corners, edge = [], first
        while edge in after:
            corners.append(edge[0])
            edge = after.pop(edge)
        yield canonical_ring(corners)


def _bends_left(a: Point2, b: Point2, c: Point2) -> bool:
    """Return whether a ring with the corners a, b, c has no dent at b."""
    bend = turn(a, b, c)
    # A turn by 180 degrees has no bend either: there two pieces share further edges.
    ahead = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) > 0.0
    return bend > _BENT or (ahead and bend >= -_BENT)


def _shared(edges: Iterable[_Edge]) -> list[_Edge]:
    """Return the edges that exist in both directions, each once."""
    unique = set(edges)
    return [edge for edge in unique if edge[0] < edge[1] and (edge[1], edge[0]) in unique]
