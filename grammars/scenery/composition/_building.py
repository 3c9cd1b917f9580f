"""The building: walls, columns and dividers as convex solids with the openings cut out, and the
outline of all solids at a given height, which a laser plane can hit.

Walls and features are prisms on the floor, openings are prisms through the walls that they list
(FloorPlan language).
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from grammars.floorplan import FloorPlan, Opening, Point3, Wall
from grammars.model.free_space import valid_polygon
from grammars.model.geometry import Floats
from grammars.model.kinematics import is_cut
from grammars.model.scene import Scene, Solid
from grammars.scenery.composition._rings import convex_rings, polygons_of, rounded

# The published mesh generator also extends openings by 5 cm on both sides.
MARGIN: Final = 0.05
"""Extension of a cut beyond the faces of the walls [m], so that no thin skin remains."""
_STEP: Final = 0.05
"""Height of the steps that approximate a sloped edge of an opening [m]."""


@dataclass(frozen=True, slots=True)
class _Cut:
    """A vertical prism to remove."""

    area: Polygon
    z_min: float
    z_max: float


@functools.lru_cache(maxsize=8)
def solids_of(plan: FloorPlan) -> tuple[Solid, ...]:
    """Return the convex solids of ``plan``: walls in source order, then features.

    The scenarios of a campaign share few plans; building C takes 20 ms.
    """
    cuts: dict[str, list[_Cut]] = {}
    for opening in plan.openings:
        for wall in dict.fromkeys(opening.walls):
            cuts.setdefault(wall, []).extend(_cuts(opening))
    solids = [s for wall in plan.walls for s in _wall_solids(wall, cuts.get(wall.id, []))]
    for feature in plan.features:
        solids.extend(
            Solid(feature.id, feature.kind, ring, 0.0, rounded(feature.height))
            for ring in convex_rings(valid_polygon(feature.footprint, feature.holes))
            if feature.height > 0.0
        )
    return tuple(solids)


def _wall_solids(wall: Wall, cuts: list[_Cut]) -> list[Solid]:
    height = rounded(wall.height)
    if height <= 0.0:
        return []
    pieces: list[tuple[BaseGeometry, tuple[_Cut, ...]]] = [(valid_polygon(wall.footprint), ())]
    for cut in cuts:
        if cut.z_max <= 0.0 or cut.z_min >= height:
            continue
        pieces = [part for piece in pieces for part in _split(piece, cut)]
    return [
        Solid(wall.id, "wall", ring, low, high)
        for area, above in pieces
        for low, high in _standing(height, above)
        for ring in convex_rings(area)
    ]


def _split(
    piece: tuple[BaseGeometry, tuple[_Cut, ...]], cut: _Cut
) -> list[tuple[BaseGeometry, tuple[_Cut, ...]]]:
    """Split a piece, seen from above, into the parts outside and inside a cut."""
    area, cuts = piece
    inside = area.intersection(cut.area)
    if not polygons_of(inside):
        return [piece]
    outside = area.difference(cut.area)
    rest = [(outside, cuts)] if polygons_of(outside) else []
    return [*rest, (inside, (*cuts, cut))]


def _standing(height: float, cuts: tuple[_Cut, ...]) -> list[tuple[float, float]]:
    """Return the height ranges of remaining wall: below, between and above the cuts."""
    ranges: list[tuple[float, float]] = []
    floor = 0.0
    # From the floor up; cuts may overlap, such as a window above a door.
    for cut in sorted(cuts, key=lambda c: (c.z_min, c.z_max)):
        if cut.z_min > floor:
            ranges.append((floor, min(cut.z_min, height)))
        floor = max(floor, cut.z_max)
    if floor < height:
        ranges.append((floor, height))
    return ranges


def _cuts(opening: Opening) -> list[_Cut]:
    """Return the prisms of an opening; a sloped or curved outline becomes steps."""
    to_local = opening.frame.inverse()
    outline = Polygon([(to_local.apply((x, y))[0], z) for x, y, z in opening.near])
    if not outline.is_valid or outline.area <= 0.0:
        return []
    depth = _depth(opening)
    # The usual door and window: one cut, no steps.
    if outline.equals_exact(outline.envelope.normalize(), 1e-9) or _is_upright(opening.near):
        x_min, z_min, x_max, z_max = outline.bounds
        return [_prism(opening, x_min, x_max, depth, z_min, z_max)]
    cuts = []
    for low, high in itertools.pairwise(_levels([z for _, _, z in opening.near])):
        x_min, _, x_max, _ = outline.bounds
        band = Polygon([(x_min, low), (x_max, low), (x_max, high), (x_min, high)])
        for part in polygons_of(outline.intersection(band)):
            width = part.area / (high - low)
            middle = part.centroid.x
            cuts.append(_prism(opening, middle - width / 2, middle + width / 2, depth, low, high))
    return cuts


def _is_upright(ring: tuple[Point3, ...]) -> bool:
    """Return whether a ring of four corners has only level and plumb edges."""
    edges = zip(ring, (*ring[1:], ring[0]), strict=True)
    return len(ring) == 4 and all(
        abs(a[2] - b[2]) < 1e-9 or abs(a[0] - b[0]) + abs(a[1] - b[1]) < 1e-9 for a, b in edges
    )


def _levels(heights: list[float]) -> list[float]:
    levels: list[float] = []
    for low, high in itertools.pairwise(sorted({rounded(z) for z in heights})):
        count = max(1, round((high - low) / _STEP))
        levels.extend(low + (high - low) * i / count for i in range(count))
    return [*levels, rounded(max(heights))]


def _depth(opening: Opening) -> tuple[float, float]:
    to_local = opening.frame.inverse()
    through = [to_local.apply((p[0], p[1]))[1] for p in (*opening.near, *opening.far)]
    return (min(through) - MARGIN, max(through) + MARGIN)


def _prism(
    opening: Opening,
    x_min: float,
    x_max: float,
    depth: tuple[float, float],
    z_min: float,
    z_max: float,
) -> _Cut:
    near, far = depth
    ring = opening.frame.apply_ring(((x_min, near), (x_max, near), (x_max, far), (x_min, far)))
    return _Cut(Polygon(ring), rounded(z_min), rounded(z_max))


# _GRID < _STRAIGHT < _JOG: corners moved by a grid step must still count as straight, and remains
# of nearly coinciding faces must be removed before joining straight edges.
_GRID: Final = 1e-6
"""Snapping distance [m]: faces closer than this are one face."""
_JOG: Final = 1e-4
"""Shorter edges [m] are remains of nearly coinciding faces and are removed."""
_STRAIGHT: Final = 2e-5
"""Corners this near [m] to the line between their neighbours are removed."""


def static_segments(
    scene: Scene, z: float
) -> tuple[Floats, npt.NDArray[np.int32], tuple[str, ...]]:
    """Return the boundary of the union of all solids that cross height ``z`` [m].

    Returns ``segments`` (n, 4) as x0, y0, x1, y1 [m], ``owner`` (n,) as an index into the third
    value, and the names of owners in scene order. The inside lies to the left of every segment;
    the union has no inner edges, and collinear edges of one owner are merged.
    """
    owners = tuple(dict.fromkeys(s.owner for s in scene.solids))
    standing = [s for s in scene.solids if is_cut(s, z)]
    if not standing:
        return np.zeros((0, 4)), np.zeros(0, np.int32), owners
    number = {name: i for i, name in enumerate(owners)}
    owner_of = np.array([number[s.owner] for s in standing], np.int32)
    shapes = shapely.polygons([shapely.linearrings(s.polygon) for s in standing])
    union = shapely.normalize(shapely.union_all(shapes, grid_size=_GRID))
    rings = [ring for polygon in polygons_of(union) for ring in _rings(polygon)]
    edges = np.concatenate([_edges(ring) for ring in rings])
    edge_owner = _owners(edges, shapes, owner_of)
    merged, merged_owner, start = [], [], 0
    for ring in rings:
        stop = start + len(ring)
        lines, names = _merge(edges[start:stop], edge_owner[start:stop])
        merged.append(lines)
        merged_owner.append(names)
        start = stop
    return np.concatenate(merged), np.concatenate(merged_owner), owners


def _rings(polygon: Any) -> list[Floats]:
    """Return the corners of the outer ring counter-clockwise and of the holes clockwise.

    So the inside lies to the left of every edge.
    """
    outer = _without_jogs(_directed(shapely.get_coordinates(polygon.exterior)[:-1], True))
    holes = [
        _without_jogs(_directed(shapely.get_coordinates(hole)[:-1], False))
        for hole in polygon.interiors
    ]
    return [ring for ring in (outer, *holes) if len(ring) >= 3]


def _directed(corners: Floats, counter_clockwise: bool) -> Floats:
    x, y = (corners - corners[0]).T
    area = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return corners if (area > 0.0) == counter_clockwise else corners[::-1].copy()


def _without_jogs(corners: Floats) -> Floats:
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    remaining: Floats = corners[lengths >= _JOG]
    return remaining


def _edges(corners: Floats) -> Floats:
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def _owners(
    edges: Floats, shapes: npt.NDArray[Any], owner_of: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """Return the owner of each edge: the first solid of the scene with the edge on its outline."""
    middles: Any = shapely.points((edges[:, 0:2] + edges[:, 2:4]) / 2)
    outlines = shapely.boundary(shapes)
    edge, shape = shapely.STRtree(outlines).query(middles, predicate="dwithin", distance=_STRAIGHT)
    # The tree returns touching outlines in any order.
    first = np.full(len(edges), len(shapes), np.int64)
    np.minimum.at(first, edge, shape)
    missing = np.flatnonzero(first == len(shapes))
    if len(missing):
        nearest = shapely.STRtree(outlines).query_nearest(middles[missing], all_matches=False)
        first[missing] = nearest[1]
    return owner_of[first]


def _merge(edges: Floats, owner: npt.NDArray[np.int32]) -> tuple[Floats, npt.NDArray[np.int32]]:
    """Join consecutive collinear edges of one ring with the same owner."""
    ahead = edges[:, 2:4] - edges[:, 0:2]
    behind = np.roll(ahead, 1, axis=0)
    chord = np.linalg.norm(ahead + behind, axis=1)
    offset = np.abs(ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0])
    bends = offset > _STRAIGHT * chord
    backwards = np.sum(ahead * behind, axis=1) <= 0.0
    first = np.flatnonzero(bends | backwards | (owner != np.roll(owner, 1)))
    if len(first) == 0:
        return edges, owner
    last = np.roll(first, -1) - 1
    return np.hstack([edges[first, 0:2], edges[last, 2:4]]), owner[first]
