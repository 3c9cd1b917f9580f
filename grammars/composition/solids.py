"""Walls, columns and dividers as convex solids, with the openings cut out.

Walls and features are prisms on the floor, openings are prisms through the walls they name
(FloorPlan language). A wall is cut only by openings that list it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from grammars.composition.rings import convex_rings, polygons_of, settled
from grammars.floorplan.model import FloorPlan, Opening, Point3, Wall
from grammars.scene import Solid

MARGIN: Final = 0.05
"""How far a cut goes beyond the faces of the walls [m], so that no skin is left standing."""
_STEP: Final = 0.05
"""Height of the steps that stand for a sloped edge of an opening [m]."""


@dataclass(frozen=True, slots=True)
class _Cut:
    """A vertical prism to take away."""

    area: Polygon
    z_min: float
    z_max: float


def solids_of(plan: FloorPlan) -> tuple[Solid, ...]:
    """Return the convex solids of ``plan``: walls in source order, then features."""
    cuts: dict[str, list[_Cut]] = {}
    for opening in plan.openings:
        for wall in dict.fromkeys(opening.walls):
            cuts.setdefault(wall, []).extend(_cuts(opening))
    solids = [s for wall in plan.walls for s in _wall_solids(wall, cuts.get(wall.id, []))]
    for feature in plan.features:
        solids.extend(
            Solid(feature.id, feature.kind, ring, 0.0, settled(feature.height))
            for ring in convex_rings(_valid(feature.footprint))
            if feature.height > 0.0
        )
    return tuple(solids)


def _valid(ring: tuple[tuple[float, float], ...]) -> BaseGeometry:
    polygon = Polygon(ring)
    return polygon if polygon.is_valid else polygon.buffer(0)


def _wall_solids(wall: Wall, cuts: list[_Cut]) -> list[Solid]:
    height = settled(wall.height)
    if height <= 0.0:
        return []
    pieces: list[tuple[BaseGeometry, tuple[_Cut, ...]]] = [(_valid(wall.footprint), ())]
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
    """Split a piece seen from above into what is outside and what is inside of a cut."""
    area, cuts = piece
    inside = area.intersection(cut.area)
    if not polygons_of(inside):
        return [piece]
    outside = area.difference(cut.area)
    kept = [(outside, cuts)] if polygons_of(outside) else []
    return [*kept, (inside, (*cuts, cut))]


def _standing(height: float, cuts: tuple[_Cut, ...]) -> list[tuple[float, float]]:
    """Return the heights at which wall is left: below, between and above the cuts."""
    left: list[tuple[float, float]] = []
    floor = 0.0
    for cut in sorted(cuts, key=lambda c: (c.z_min, c.z_max)):
        if cut.z_min > floor:
            left.append((floor, min(cut.z_min, height)))
        floor = max(floor, cut.z_max)
    if floor < height:
        left.append((floor, height))
    return left


def _cuts(opening: Opening) -> list[_Cut]:
    """Return the prisms of an opening; a sloped or curved outline becomes steps."""
    to_local = opening.frame.inverse()
    outline = Polygon([(to_local.apply((x, y))[0], z) for x, y, z in opening.near])
    if not outline.is_valid or outline.area <= 0.0:
        return []
    depth = _depth(opening)
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
    """Return whether a ring of four has only level and plumb edges."""
    edges = zip(ring, (*ring[1:], ring[0]), strict=True)
    return len(ring) == 4 and all(
        abs(a[2] - b[2]) < 1e-9 or abs(a[0] - b[0]) + abs(a[1] - b[1]) < 1e-9 for a, b in edges
    )


def _levels(heights: list[float]) -> list[float]:
    levels: list[float] = []
    for low, high in itertools.pairwise(sorted({settled(z) for z in heights})):
        count = max(1, round((high - low) / _STEP))
        levels.extend(low + (high - low) * i / count for i in range(count))
    return [*levels, settled(max(heights))]


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
    return _Cut(Polygon(ring), settled(z_min), settled(z_max))
