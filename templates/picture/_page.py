"""The page: place of the world on it, title, legend, scale bar, axes of the map."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from grammars.model.geometry import Point2
from grammars.model.kinematics import placed_links
from grammars.model.scene import Scene
from templates.picture._drawing import Colour, Disc, Drawing, DrawingItem, Shape, TextLabel
from templates.plan_shapes import Points

_NARROWEST: Final = 720.0
_LARGEST_SCALE: Final = 120.0
CUT: Final = 1.2
"""Height of the horizontal cut of a plan [m], as in architecture."""


@dataclass(frozen=True, slots=True)
class PageStyle:
    """Room beside, above and below a map, for heading, legend and scale.

    ``width`` is that of a page with a part of the map, and the longer side of a whole map. A page
    with a part is at least ``aspect`` times as wide as high. Without ``names``, the names of
    spaces, objects and the start are omitted.
    """

    side: float
    head: float
    foot: float
    width: float
    aspect: float
    names: bool = True


FILE: Final = PageStyle(48.0, 92.0, 76.0, 1400.0, 1.35)
"""Separate page in landscape format, with heading, legend, key and scale."""
LARGE: Final = PageStyle(48.0, 16.0, 76.0, 1400.0, 1.35)
"""Picture in a page whose text has the heading."""
MOMENT: Final = PageStyle(0.0, 0.0, 0.0, 620.0, 1.35)
"""Map only, with words as large as the surrounding text."""
SMALL: Final = PageStyle(0.0, 0.0, 0.0, 480.0, 0.85, names=False)
"""One of several pictures in a row."""


@dataclass(frozen=True, slots=True)
class Page:
    """Page: ``scale`` [px/m] and the world point (``west``, ``north``) at (``left``, ``top``)."""

    scale: float
    west: float
    north: float
    left: float
    top: float
    width: float
    height: float
    style: PageStyle

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Bounds of the map on the page [m]: west, south, east, north."""
        west = self.west - self.left / self.scale
        north = self.north + self.top / self.scale
        return west, north - self.height / self.scale, west + self.width / self.scale, north

    def point(self, at: Point2) -> Point2:
        """Return a point of the map on the page."""
        x = self.left + (at[0] - self.west) * self.scale
        y = self.top + (self.north - at[1]) * self.scale
        return (round(x, 2), round(y, 2))

    def shows(self, ring: Iterable[Point2]) -> bool:
        """Return whether the box around a ring of the page overlaps the page."""
        xs, ys = zip(*ring, strict=True)
        inside = (max(xs) >= 0.0, min(xs) <= self.width, max(ys) >= 0.0, min(ys) <= self.height)
        return all(inside)

    def ring(self, ring: Points) -> tuple[Point2, ...]:
        """Return a ring of the map on the page."""
        return tuple(self.point((float(x), float(y))) for x, y in ring)


def page_for(
    scene: Scene, start: Mapping[str, float], more: tuple[Point2, ...], style: PageStyle
) -> Page:
    """Return a page with room for the whole scene at its start and the points ``more``."""
    corners = [c for region in scene.regions for c in region.outline]
    corners += [c for solid in scene.solids for c in solid.polygon]
    corners += [
        c
        for thing in scene.objects
        for _, rings in placed_links(thing, start)
        for ring in rings
        for c in ring
    ]
    corners += more
    xs, ys = [c[0] for c in corners] or [0.0, 1.0], [c[1] for c in corners] or [0.0, 1.0]
    wide, high = max(max(xs) - min(xs), 1.0), max(max(ys) - min(ys), 1.0)
    # The limit keeps a single room from filling a poster.
    scale = min(style.width / max(wide, high), _LARGEST_SCALE)
    # The legend needs this width.
    width = max(wide * scale + 2 * style.side, _NARROWEST if style.foot else 0.0)
    left = (width - wide * scale) / 2.0
    height = high * scale + style.head + style.foot
    return Page(scale, min(xs), max(ys), left, style.head, round(width), round(height), style)


def page_around(points: tuple[Point2, ...], beside: float, style: PageStyle) -> Page:
    """Return a page for ``points`` with ``beside`` [m] on every side."""
    xs, ys = [p[0] for p in points], [p[1] for p in points]
    west, north = min(xs) - beside, max(ys) + beside
    wide, high = max(xs) + beside - west, north - (min(ys) - beside)
    # Landscape format, even if the robot drives straight up.
    west -= max(style.aspect * high - wide, 0.0) / 2.0
    scale = (style.width - 2 * style.side) / max(wide, style.aspect * high)
    height = round(high * scale + style.head + style.foot)
    return Page(scale, west, north, style.side, style.head, style.width, height, style)


def margins(page: Page) -> list[DrawingItem]:
    """Return paper over the margins, and a frame around the map."""
    side, head = page.style.side, page.style.head
    right, low = page.width - side, page.height - page.style.foot
    sides = (
        ((0.0, 0.0), (page.width, head)),
        ((0.0, low), (page.width, page.height)),
        ((0.0, 0.0), (side, page.height)),
        ((right, 0.0), (page.width, page.height)),
    )
    rings = tuple(((x0, y0), (x1, y0), (x1, y1), (x0, y1)) for (x0, y0), (x1, y1) in sides)
    edge = ((side, head), (right, head), (right, low), (side, low))
    # Separate shapes: the overlap of two rings in one shape would be a hole.
    return [
        *(Shape((ring,), fill=Colour.PAPER) for ring in rings),
        Shape((edge,), line=Colour.FAINT),
    ]


def heading(figure: Drawing, page: Page) -> list[DrawingItem]:
    """Return title and subtitle."""
    side = page.style.side
    return [
        TextLabel((side, 44.0), figure.title, 26.0, Colour.INK, "start", bold=True),
        TextLabel((side, 70.0), figure.about, 14.0, Colour.SOFT, "start"),
    ]


def scale_bar(page: Page) -> list[DrawingItem]:
    """Return a scale bar of a round length, about a fifth of the page, at the lower right."""
    length = _round_length(page.width / 5.0 / page.scale)
    width = length * page.scale
    x1 = page.width - max(page.style.side, 18.0)
    y = page.height - max(page.style.foot / 2.0, 8.0)
    x0, half = x1 - width, x1 - width / 2.0
    bar = ((x0, y - 3.0), (x1, y - 3.0), (x1, y + 3.0), (x0, y + 3.0))
    dark = ((x0, y - 3.0), (half, y - 3.0), (half, y + 3.0), (x0, y + 3.0))
    marks = ((x0, "0"), (half, f"{length / 2:g}"), (x1, f"{length:g} m"))
    return [
        Shape((bar,), fill=Colour.FLOOR, line=Colour.INK, width=1.0),
        Shape((dark,), fill=Colour.INK),
        *(TextLabel((x, y - 9.0), text, 11.0, Colour.INK, halo=Colour.PAPER) for x, text in marks),
    ]


def axes(page: Page, start: Point2 | None) -> list[DrawingItem]:
    """Return the axes of the map, if its origin is on the page.

    They are omitted if a robot at ``start`` would cover them.
    """
    x, y = page.point((0.0, 0.0))
    if start is not None and math.dist(page.point(start), (x, y)) < 60.0:
        return []
    if not (0.0 < x < page.width and 0.0 < y < page.height - page.style.foot):
        return []
    length = 26.0
    return [
        Shape(
            ((((x + length), y), (x, y), (x, y - length)),), line=Colour.FAINT, width=1.6, open=True
        ),
        TextLabel((x + length + 7.0, y + 4.0), "x", 11.0, Colour.SOFT),
        TextLabel((x, y - length - 4.0), "y", 11.0, Colour.SOFT),
    ]


def legend(page: Page, *, doors: str, low: bool, mission: bool, robot: bool) -> list[DrawingItem]:
    """Return the meaning of the colours, in one row at the foot of the page.

    ``doors`` names the time at which doors are shown; it is empty without doors.
    """
    entries: list[tuple[str, Colour]] = [("wall", Colour.WALL)]
    entries += [("low or sill", Colour.LOW)] if low else []
    entries += (
        [(f"door at the {doors}", Colour.DOOR), ("where it can go", Colour.SWING)] if doors else []
    )
    entries += [("waypoint", Colour.ROUTE)] if mission else []
    entries += [("robot", Colour.ROBOT)] if robot else []

    def sample(colour: Colour, x: float, y: float) -> DrawingItem:
        if colour == Colour.ROUTE:
            return Disc((x + 8.0, y), 8.0, colour)
        ring = ((x, y - 6.0), (x + 16.0, y - 6.0), (x + 16.0, y + 6.0), (x, y + 6.0))
        return Shape((ring,), fill=colour, opacity=0.45 if colour == Colour.SWING else 1.0)

    return legend_row(page, entries, 0.0, sample)


def legend_row(
    page: Page,
    entries: Iterable[tuple[str, Colour]],
    below: float,
    sample: Callable[[Colour, float, float], DrawingItem],
) -> list[DrawingItem]:
    """Return a row of texts at the foot of the page, each after a sample of its colour."""
    x, y = page.style.side, page.height - page.style.foot / 2.0 + below
    items: list[DrawingItem] = []
    for text, colour in entries:
        items.append(sample(colour, x, y))
        items.append(TextLabel((x + 23.0, y + 4.5), text, 12.5, Colour.INK, "start"))
        x += 23.0 + 7.2 * len(text) + 22.0
    return items


def _round_length(about: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is at most ``about``."""
    power: float = 10.0 ** math.floor(math.log10(about))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= about * 1.000001)
