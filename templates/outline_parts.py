"""What published maps draw as polygons: walls as a whole, and doorways through them.

The published tool (scenery_builder, OccupancyGrid) knows walls without their openings: it draws
each by its four corners, and frees the doorways then, widened by a cell on both sides of the wall.
Scenes have walls in pieces, whose corners would be put into other cells.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from grammars.model.geometry import Ring, turn
from grammars.model.scene import Doorway, Solid

_Polygons: TypeAlias = npt.NDArray[np.object_]
_OVERLAP: Final = 1e-6
"""Polygons overlap when they share more than this [m²]: less is rounding."""
_OFF_LINE: Final = 1e-6
"""A corner is one when it lies further than this from the line between its neighbours [m]."""


def whole_solids(solids: Iterable[Solid], doorways: Sequence[Doorway], height: float) -> list[Ring]:
    """Return the outlines of what stands at ``height`` [m], walls as if they had no doorways.

    A wall with another hole at that height, a window, stays in pieces: only doorways are freed.
    """
    passages = _polygons([doorway.footprint for doorway in doorways])
    rings: list[Ring] = []
    for _, pieces in itertools.groupby(solids, key=lambda solid: solid.owner):
        rings += _whole(list(pieces), passages, height)
    return rings


def _whole(pieces: list[Solid], passages: _Polygons, height: float) -> list[Ring]:
    standing = [s.polygon for s in pieces if s.z_min <= height <= s.z_max]
    if not standing or pieces[0].kind != "wall":
        return standing
    hull = shapely.MultiPoint([corner for s in pieces for corner in s.polygon]).convex_hull
    near = passages[shapely.intersects(passages, hull)]
    filled = shapely.union_all(np.concatenate([_polygons(standing), near]))
    if shapely.area(shapely.difference(hull, filled)) > _OVERLAP:
        return standing
    return [_true_corners(shapely.get_coordinates(hull)[:-1].tolist())]


def _true_corners(ring: Sequence[tuple[float, float]]) -> Ring:
    """Return a ring without corners that are there twice, or in the middle of an edge."""
    apart = [b for a, b in _pairs(ring) if math.dist(a, b) > _OFF_LINE]
    return tuple(
        b
        for (a, b), (_, c) in zip(_pairs(apart), _pairs([*apart[1:], apart[0]]), strict=True)
        if abs(turn(a, b, c)) > _OFF_LINE * math.dist(a, c)
    )


def _pairs(ring: Sequence[tuple[float, float]]) -> list[tuple[tuple[float, float], ...]]:
    """Return every corner with the one before it."""
    return [(ring[k - 1], ring[k]) for k in range(len(ring))]


def widened(doorway: Doorway, by: float) -> Ring:
    """Return a doorway's footprint, longer by ``by`` [m] on both sides of its wall."""
    to_local = doorway.frame.inverse()
    local = np.array([to_local.apply(corner) for corner in doorway.footprint])
    local[:, 1] += by * np.sign(local[:, 1] - local[:, 1].mean())
    return tuple(doorway.frame.apply((float(x), float(y))) for x, y in local)


def standing_in(doorways: Sequence[Doorway], solids: Sequence[Ring]) -> list[Ring]:
    """Return the solids that truly stand in a doorway: a column, a wall that was not cut."""
    passages = _polygons([doorway.footprint for doorway in doorways])
    return [
        ring
        for ring, solid in zip(solids, _polygons(solids), strict=True)
        if (shapely.area(shapely.intersection(passages, solid)) > _OVERLAP).any()
    ]


def _polygons(rings: Sequence[Ring]) -> _Polygons:
    # An array also of none, which shapely would take for an array of numbers.
    polygons = np.empty(len(rings), dtype=object)
    polygons[:] = [shapely.Polygon(ring) for ring in rings]
    return polygons
