"""What surrounds the plan: title, legend, scale bar, the axes of the map."""

from __future__ import annotations

import math

from grammars.values import Point2
from templates.picture._figure import Disc, Figure, Item, Shape, Words
from templates.picture._page import (
    DOOR,
    FAINT,
    FLOOR,
    FOOT,
    INK,
    LOW,
    MARGIN,
    ROBOT,
    ROUTE,
    SOFT,
    SWING,
    WALL,
    Page,
)


def heading(figure: Figure) -> list[Item]:
    """Return title and subtitle."""
    return [
        Words((MARGIN, 44.0), figure.title, 26.0, INK, "start", bold=True),
        Words((MARGIN, 70.0), figure.about, 14.0, SOFT, "start"),
    ]


def scale_bar(page: Page) -> list[Item]:
    """Return a bar of a round length, about a fifth of the page, in the lower right corner."""
    length = _round_length(page.width / 5.0 / page.scale)
    width = length * page.scale
    x1, y = page.width - MARGIN, page.height - FOOT / 2.0
    x0 = x1 - width
    half = (x0 + x1) / 2.0
    bar = ((x0, y - 3.0), (x1, y - 3.0), (x1, y + 3.0), (x0, y + 3.0))
    dark = ((x0, y - 3.0), (half, y - 3.0), (half, y + 3.0), (x0, y + 3.0))
    return [
        Shape((_settled(bar),), fill=FLOOR, line=INK, width=1.0),
        Shape((_settled(dark),), fill=INK),
        Words((round(x0, 2), y - 9.0), "0", 11.0, INK),
        Words((round(half, 2), y - 9.0), f"{length / 2:g}", 11.0, INK),
        Words((round(x1, 2), y - 9.0), f"{length:g} m", 11.0, INK),
    ]


def axes(page: Page, start: Point2 | None) -> list[Item]:
    """Return the axes of the map at its origin, when that lies on the page.

    They are left out where a robot that starts at ``start`` would stand on them.
    """
    x, y = page.point((0.0, 0.0))
    if start is not None and math.dist(page.point(start), (x, y)) < 60.0:
        return []
    if not (0.0 < x < page.width and 0.0 < y < page.height - FOOT):
        return []
    length = 26.0
    return [
        Shape(((((x + length), y), (x, y), (x, y - length)),), line=FAINT, width=1.6, open=True),
        Words((x + length + 7.0, y + 4.0), "x", 11.0, SOFT),
        Words((x, y - length - 4.0), "y", 11.0, SOFT),
    ]


def legend(page: Page, *, doors: bool, low: bool, mission: bool) -> list[Item]:
    """Return what the colours mean, in one row at the foot of the page."""
    y = page.height - FOOT / 2.0
    x = MARGIN
    items: list[Item] = []
    entries: list[tuple[str, str]] = [("wall", WALL)]
    entries += [("low or sill", LOW)] if low else []
    entries += [("door at the start", DOOR), ("where it can go", SWING)] if doors else []
    entries += [("waypoint", ROUTE), ("robot", ROBOT)] if mission else []
    for text, colour in entries:
        if colour == ROUTE:
            items.append(Disc((x + 8.0, y), 8.0, colour))
        else:
            ring = ((x, y - 6.0), (x + 16.0, y - 6.0), (x + 16.0, y + 6.0), (x, y + 6.0))
            faded = 0.45 if colour == SWING else 1.0
            items.append(Shape((ring,), fill=colour, opacity=faded))
        items.append(Words((x + 23.0, y + 4.5), text, 12.5, INK, "start"))
        x = round(x + 23.0 + 7.2 * len(text) + 22.0, 2)
    return items


def _round_length(about: float) -> float:
    """Return the largest of 1, 2 or 5 times a power of ten that is not above ``about``."""
    power: float = 10.0 ** math.floor(math.log10(about))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= about * 1.000001)


def _settled(ring: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    return tuple((round(x, 2), round(y, 2)) for x, y in ring)
