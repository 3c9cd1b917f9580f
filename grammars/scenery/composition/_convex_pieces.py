"""Cutting large areas, such as all the walls of a map, into few convex pieces in little time.

Triangles are joined across their longest common edges while the result stays convex (Hertel and
Mehlhorn, 1983: at most four times as many pieces as necessary), each edge looked at once.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from typing import Final, TypeAlias

import shapely
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import valid_polygon
from grammars.model.geometry import Point2, Ring, turn
from grammars.scenery.composition._rings import (
    canonical_ring,
    is_convex,
    outline_of,
    polygons_of,
    without_flat_corners,
)

_Edge: TypeAlias = tuple[Point2, Point2]
_BENT: Final = 1e-10
"""Corners that turn back by less [m²] are straight, as everywhere in a scene."""
_MOST_CUTS: Final = 40


def convex_rings(geometry: BaseGeometry) -> list[Ring]:
    """Cut valid polygons, holes and all, into convex rings; equal areas give equal rings."""
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
    # Dents of many corners that are each as good as straight may add up to one that is not.
    return ring if is_convex(ring) else _hull(ring)


def _hull(ring: Ring) -> Ring:
    corners = shapely.get_coordinates(shapely.convex_hull(Polygon(ring)))[:-1].tolist()
    return without_flat_corners(canonical_ring((x, y) for x, y in corners))


def _triangles(area: Polygon, cuts: int) -> list[Ring]:
    try:
        found = shapely.constrained_delaunay_triangles(area)
    except shapely.GEOSException:
        # GEOS gives up on some areas with holes that touch, halves of which it can do, and on
        # corners much less than a nanometre apart, which are one in a scene.
        if cuts == 0:
            raise
        outline, *holes = (canonical_ring(r.coords[:-1]) for r in (area.exterior, *area.interiors))
        snapped = valid_polygon(outline, holes)
        halves = itertools.chain.from_iterable(
            polygons_of(snapped.intersection(half)) for half in _halves(area)
        )
        return [ring for half in halves for ring in _triangles(half, cuts - 1)]
    return sorted(outline_of(triangle) for triangle in polygons_of(found))


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
        # At each end of the edge: the corner it leaves if it goes.
        ends = ((before[edge], after[back]), (before[back], after[edge]))
        if all(_bends_left(come[0], come[1], go[1]) for come, go in ends):
            for come, go in ends:
                after[come], before[go] = go, come
            for gone in (edge, back):
                del after[gone], before[gone]
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
    # A way straight back has no bend either: there two pieces share more edges than this one.
    ahead = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) > 0.0
    return bend > _BENT or (ahead and bend >= -_BENT)


def _shared(edges: Iterable[_Edge]) -> list[_Edge]:
    """Return the edges that are there in both directions, each once."""
    known = set(edges)
    return [edge for edge in known if edge[0] < edge[1] and (edge[1], edge[0]) in known]
