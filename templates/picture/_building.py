"""The building on the page: floors, walls as they are cut, low things, names of spaces."""

from __future__ import annotations

import math
from typing import Any, Final

import shapely
from shapely.geometry import Point, Polygon

from grammars.scene import Region, Scene
from templates.picture._figure import Item, Shape, Words
from templates.picture._labels import LETTER, Labels
from templates.picture._page import FLOOR, LOW, SOFT, WALL, Page, is_below, is_cut

_GRID: Final = 1e-6
_ALONG: Final = (0.0, -0.12, 0.12, -0.24, 0.24, -0.34, 0.34)
_ACROSS: Final = (0.0, -0.2, 0.2, -0.35, 0.35)
"""Where a name may stand, in sides of the space from its middle."""


def floors(scene: Scene, page: Page) -> list[Item]:
    """Return the free floor: spaces and the passages between them."""
    areas = [Polygon(r.outline) for r in scene.regions]
    areas += [Polygon(d.footprint) for d in scene.doorways]
    return [Shape(_rings(_union(areas), page), fill=FLOOR)] if areas else []


def walls(scene: Scene, page: Page) -> list[Item]:
    """Return what stands still: low things and sills in light, what is cut in dark."""
    low = [Polygon(s.polygon) for s in scene.solids if is_below(s.z_min, s.z_max)]
    cut = [Polygon(s.polygon) for s in scene.solids if is_cut(s.z_min, s.z_max)]
    items: list[Item] = []
    if low:
        items.append(Shape(_rings(_union(low), page), fill=LOW, line=SOFT, width=0.6))
    if cut:
        items.append(Shape(_rings(_union(cut), page), fill=WALL))
    return items


def outlines(scene: Scene, page: Page) -> list[Item]:
    """Return every solid the plan shows by itself, for texts to keep off."""
    shown = (s for s in scene.solids if is_cut(s.z_min, s.z_max) or is_below(s.z_min, s.z_max))
    return [Shape((page.ring(s.polygon),)) for s in shown]


def names(scene: Scene, page: Page, labels: Labels) -> list[Item]:
    """Return the name of every space, along its longer side, where it has most room."""
    return [words for region in scene.regions if (words := _name(region, page, labels))]


def _name(region: Region, page: Page, labels: Labels) -> Words | None:
    floor = Polygon(region.outline)
    corners = shapely.get_coordinates(shapely.oriented_envelope(floor))
    if floor.area <= 0.0 or len(corners) < 4:
        return None
    sides = [corners[1] - corners[0], corners[2] - corners[1]]
    long, short = sorted(sides, key=lambda side: -math.hypot(*side))
    length, breadth = math.hypot(*long), math.hypot(*short)
    turn = math.atan2(long[1], long[0]) if length > 1.15 * breadth else 0.0
    turn = math.remainder(turn, math.pi)
    text = region.name.replace("_", " ")
    room = (0.86 * length * page.scale, 0.7 * breadth * page.scale)
    size = max(min(15.0, room[0] / (LETTER * max(len(text), 1)), room[1]), 6.5)
    middle = corners[:4].mean(axis=0)
    spots = [middle + long * a + short * b for a in _ALONG for b in _ACROSS]
    inside = [(float(x), float(y)) for x, y in spots if floor.contains(Point(x, y))]
    at = shapely.get_point(shapely.maximum_inscribed_circle(floor, tolerance=0.01), 0)
    words = Words(
        page.point((at.x, at.y)),
        text,
        size,
        SOFT,
        turn=math.degrees(turn),
        halo=FLOOR,
        centred=True,
    )
    return labels.place(words, map(page.point, inside or [(at.x, at.y)]))


def _union(areas: list[Polygon]) -> Any:
    return shapely.union_all(areas, grid_size=_GRID)


def _rings(area: Any, page: Page) -> tuple[tuple[tuple[float, float], ...], ...]:
    found = []
    for part in shapely.get_parts(area):
        if part.geom_type == "Polygon":
            for ring in (part.exterior, *part.interiors):
                corners = shapely.get_coordinates(ring)[:-1].tolist()
                found.append(page.ring(tuple((x, y) for x, y in corners)))
    return tuple(found)
