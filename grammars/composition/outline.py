"""The outline of everything that stands still, at a given height: what a laser plane can hit."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt
import shapely

from grammars.composition.rings import polygons_of
from grammars.scene import Scene
from grammars.values import Floats

_GRID: Final = 1e-6
"""Snapping distance [m]: faces closer than this are one face."""
_JOG: Final = 1e-4
"""Shorter edges [m] are left over from faces that nearly coincide."""
_STRAIGHT: Final = 2e-5
"""A corner this near [m] to the line between its neighbours is none."""


def static_segments(
    scene: Scene, z: float
) -> tuple[Floats, npt.NDArray[np.int32], tuple[str, ...]]:
    """Return the boundary of the union of all solids that cross height ``z`` [m].

    Returns ``segments`` (n, 4) as x0, y0, x1, y1 [m], ``owner`` (n,) as an index into the third
    value, the owners' names in scene order. The inside lies to the left of every segment; there
    are no edges inside the union, and edges in line with each other are merged per owner.
    """
    owners = tuple(dict.fromkeys(s.owner for s in scene.solids))
    standing = [s for s in scene.solids if s.z_min <= z < s.z_max]
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
    """Return the corners of the outer ring counter-clockwise and of the holes clockwise."""
    outer = _without_jogs(_turned(shapely.get_coordinates(polygon.exterior)[:-1], True))
    holes = [
        _without_jogs(_turned(shapely.get_coordinates(hole)[:-1], False))
        for hole in polygon.interiors
    ]
    return [ring for ring in (outer, *holes) if len(ring) >= 3]


def _turned(corners: Floats, counter_clockwise: bool) -> Floats:
    x, y = (corners - corners[0]).T
    area = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return corners if (area > 0.0) == counter_clockwise else corners[::-1].copy()


def _without_jogs(corners: Floats) -> Floats:
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    kept: Floats = corners[lengths >= _JOG]
    return kept


def _edges(corners: Floats) -> Floats:
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def _owners(
    edges: Floats, shapes: npt.NDArray[Any], owner_of: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """Return whose edge each is: of the solids whose outline it lies on, the first in the scene."""
    middles: Any = shapely.points((edges[:, 0:2] + edges[:, 2:4]) / 2)
    outlines = shapely.boundary(shapes)
    edge, shape = shapely.STRtree(outlines).query(middles, predicate="dwithin", distance=_STRAIGHT)
    first = np.full(len(edges), len(shapes), np.int64)
    np.minimum.at(first, edge, shape)
    missing = np.flatnonzero(first == len(shapes))
    if len(missing):
        nearest = shapely.STRtree(outlines).query_nearest(middles[missing], all_matches=False)
        first[missing] = nearest[1]
    return owner_of[first]


def _merge(edges: Floats, owner: npt.NDArray[np.int32]) -> tuple[Floats, npt.NDArray[np.int32]]:
    """Join consecutive edges of one ring that are in line and have the same owner."""
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
