"""The scene on the page: floors, cut walls, objects and the floor that they sweep."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import Polygon

from grammars.model.behaviour import Behaviour
from grammars.model.geometry import Point2
from grammars.model.scene import Scene
from templates import plan_shapes
from templates.picture._drawing import LETTER, Colour, Disc, DrawingItem, Labels, Shape, TextLabel
from templates.picture._page import CUT, Page
from templates.plan_shapes import PlanShape, ShapeRole

_GRID: Final = 1e-6
_ALONG: Final = (0.0, -0.12, 0.12, -0.24, 0.24, -0.34, 0.34)
_ACROSS: Final = (0.0, -0.2, 0.2, -0.35, 0.35)
"""Offsets of a name from the middle of its space, in sides of the space."""
_BODIES: Final = {
    ShapeRole.DOOR: Colour.DOOR,
    ShapeRole.MOVER: Colour.DOOR,
    ShapeRole.POST: Colour.POST,
}


def part_on_page(scene: Scene, page: Page) -> Scene:
    """Return the scene without the regions, doorways and solids outside of a page."""
    return replace(
        scene,
        regions=tuple(r for r in scene.regions if page.shows(page.ring(r.outline))),
        doorways=tuple(d for d in scene.doorways if page.shows(page.ring(d.footprint))),
        solids=tuple(s for s in scene.solids if page.shows(page.ring(s.polygon))),
    )


def floors(scene: Scene, page: Page) -> list[DrawingItem]:
    """Return the free floor: spaces and the passages between them."""
    areas = tuple(map(_polygon, plan_shapes.floor_shapes(scene)))
    return [Shape(_rings(_union(areas), page), fill=Colour.FLOOR)] if areas else []


def walls(scene: Scene, page: Page) -> list[DrawingItem]:
    """Return the solids: low things and sills light, walls at the cut dark."""
    solids = list(plan_shapes.solid_shapes(scene, CUT))
    low, cut = (
        tuple(_polygon(shape) for shape in solids if shape.role is role)
        for role in (ShapeRole.LOW, ShapeRole.WALL)
    )
    items: list[DrawingItem] = []
    if low:
        items.append(Shape(_rings(_union(low), page), fill=Colour.LOW, line=Colour.SOFT, width=0.6))
    if cut:
        items.append(Shape(_rings(_union(cut), page), fill=Colour.WALL))
    return items


def outlines(scene: Scene, page: Page) -> list[DrawingItem]:
    """Return every solid of the plan separately, for texts to avoid."""
    return [Shape(_on_page(shape, page)) for shape in plan_shapes.solid_shapes(scene, CUT)]


def space_names(scene: Scene, page: Page, labels: Labels) -> list[DrawingItem]:
    """Return the name of every space, along its longer side, at the place with most room."""
    shapes = plan_shapes.space_names(scene)
    return [words for shape in shapes if (words := _name(shape, page, labels))]


def _polygon(shape: PlanShape) -> Polygon:
    return Polygon(shape.parts[0], shape.parts[1:])


def _on_page(shape: PlanShape, page: Page) -> tuple[tuple[Point2, ...], ...]:
    """Return the rings or lines of a shape that reach into the page."""
    rings = (page.ring(part) for part in shape.parts)
    return tuple(ring for ring in rings if page.shows(ring))


def _name(space: PlanShape, page: Page, labels: Labels) -> TextLabel | None:
    parts = shapely.get_parts(shapely.clip_by_rect(_polygon(space), *page.bounds))
    floor = max(parts, key=shapely.area, default=None)
    if floor is None:
        return None
    corners = shapely.get_coordinates(shapely.oriented_envelope(floor))
    if floor.area <= 0.0 or len(corners) < 4:
        return None
    sides = [corners[1] - corners[0], corners[2] - corners[1]]
    long, short = sorted(sides, key=lambda side: -math.hypot(*side))
    length, breadth = math.hypot(*long), math.hypot(*short)
    # Names of nearly square rooms stay horizontal, which is easier to read.
    turn = math.atan2(long[1], long[0]) if length > 1.15 * breadth else 0.0
    turn = math.remainder(turn, math.pi)
    text = space.text.replace("_", " ")
    room = (0.86 * length * page.scale, 0.7 * breadth * page.scale)
    size = max(min(15.0, room[0] / (LETTER * max(len(text), 1)), room[1]), 6.5)
    middle = corners[:4].mean(axis=0)
    spots = np.array([middle + long * a + short * b for a in _ALONG for b in _ACROSS])
    inside = spots[shapely.contains_xy(floor, spots)].tolist()
    at = shapely.get_point(shapely.maximum_inscribed_circle(floor, tolerance=0.01), 0)
    words = TextLabel(
        page.point((at.x, at.y)),
        text,
        size,
        Colour.SOFT,
        turn=math.degrees(turn),
        halo=Colour.FLOOR,
        centred=True,
    )
    return labels.place(words, map(page.point, inside or [(at.x, at.y)]))


# Cached, because many pictures of runs and scenarios show the same building.
@functools.lru_cache(maxsize=8)
def _union(areas: tuple[Polygon, ...]) -> Any:
    # Snap to a grid: rounding errors between pieces of walls would show as hairlines.
    return shapely.union_all(areas, grid_size=_GRID)


def _rings(area: Any, page: Page) -> tuple[tuple[tuple[float, float], ...], ...]:
    rings = []
    for part in shapely.get_parts(shapely.clip_by_rect(area, *page.bounds)):
        if part.geom_type == "Polygon":
            for ring in (part.exterior, *part.interiors):
                corners = shapely.get_coordinates(ring)[:-1].tolist()
                rings.append(page.ring(tuple((x, y) for x, y in corners)))
    return tuple(rings)


def swings(scene: Scene, page: Page, start: Mapping[str, float]) -> list[DrawingItem]:
    """Return the floor that each moving link can sweep: sectors of hinges, tracks of sliders."""
    items: list[DrawingItem] = []
    for shape in plan_shapes.swing_shapes(scene, start):
        rings = _on_page(shape, page)
        if not rings:
            continue
        if shape.form == "area":
            items.append(Shape(rings, fill=Colour.SWING, opacity=0.28))
        elif shape.form == "line":
            items.append(Shape(rings, line=Colour.SWING, width=1.1, dash=(4.0, 3.0), open=True))
        else:
            items.append(Shape(rings, line=Colour.SWING, width=1.0, dash=(4.0, 3.0)))
    return items


def walks(behaviours: Sequence[Behaviour], page: Page) -> list[DrawingItem]:
    """Return the routes of walks, dotted, with their turning points."""
    items: list[DrawingItem] = []
    for behaviour in behaviours:
        if behaviour.kind == "walk":
            line = page.ring(behaviour.route)
            items.append(Shape((line,), line=Colour.MOVER, width=1.8, dash=(1.5, 4.0), open=True))
            items += [Disc(point, 2.6, Colour.MOVER) for point in line]
    return items


def bodies(scene: Scene, page: Page, start: Mapping[str, float]) -> list[DrawingItem]:
    """Return every link of every object at its start."""
    items: list[DrawingItem] = []
    for shape in plan_shapes.body_shapes(scene, start):
        colour = _BODIES[shape.role]
        if rings := _on_page(shape, page):
            items.append(Shape(rings, fill=colour, line=colour, width=1.2))
    return items


def object_names(
    scene: Scene, page: Page, start: Mapping[str, float], labels: Labels
) -> list[DrawingItem]:
    """Return the name of every object, placed beside it."""
    size = min(12.5, max(9.5, 0.38 * page.scale))
    items: list[DrawingItem] = []
    for shape in plan_shapes.object_names(scene, start):
        corners = [corner for ring in _on_page(shape, page) for corner in ring]
        if not corners:
            continue
        text = shape.text.replace("_", " ")
        words = TextLabel(corners[0], text, size, Colour.DOOR, halo=Colour.PAPER, centred=True)
        items.append(labels.place(words, spots_around(corners, words, page)))
    return items


def spots_around(corners: Sequence[Point2], words: TextLabel, page: Page) -> list[Point2]:
    """Return spots for a text around the box of ``corners`` on the page, nearer spots first."""
    xs, ys = [c[0] for c in corners], [c[1] for c in corners]
    x, y = (min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0
    half, up = LETTER * words.size * len(words.text) / 2.0, words.size * 0.6
    wide, high = (max(xs) - min(xs)) / 2.0 + half + 6.0, (max(ys) - min(ys)) / 2.0 + up + 5.0
    ways = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, 1), (1, 1), (-1, -1))
    spots = [(x + far * a * wide, y + far * b * high) for far in (1.0, 1.4) for a, b in ways]
    return [
        spot
        for spot in spots
        if half <= spot[0] <= page.width - half and up <= spot[1] <= page.height - up
    ] or spots
