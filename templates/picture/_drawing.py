"""Items of a picture in the order of painting, and the placement of texts.

Page units are pixels of the SVG, x to the right, y down.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Final, Literal, TypeAlias

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPoint

from grammars.model.geometry import Floats, Point2


class Colour(StrEnum):
    """Colours on light paper; the style sheet of a page may replace them for dark paper."""

    PAPER = "#faf8f4"
    FLOOR = "#ffffff"
    WALL = "#3b4048"
    LOW = "#cfc9bd"
    DOOR = "#c8553d"
    SWING = "#e9a178"
    POST = "#6d3023"
    ROUTE = "#22638f"
    ROBOT = "#2f9e6e"
    INK = "#2b2f36"
    SOFT = "#7b8089"
    FAINT = "#b9b5ab"
    MOVER = "#7d4f9e"
    DRIVEN = "#1d7f58"
    CLOSE = "#e08a1e"
    TOUCHED = "#d01219"
    BELIEVED = "#7d4f9e"
    APPARENT = "#2b6fd4"


@dataclass(frozen=True, slots=True)
class Shape:
    """Lines or areas: ``rings`` are closed (even-odd filled) or, if ``open``, lines."""

    rings: tuple[tuple[Point2, ...], ...]
    fill: Colour | None = None
    line: Colour | None = None
    width: float = 1.0
    opacity: float = 1.0
    dash: tuple[float, float] | None = None
    open: bool = False


@dataclass(frozen=True, slots=True)
class Disc:
    """Circle with a fill, an outline, or both."""

    centre: Point2
    radius: float
    fill: Colour | None = None
    line: Colour | None = None
    width: float = 1.0


@dataclass(frozen=True, slots=True)
class TextLabel:
    """Text around or beside ``at``; ``turn`` is counter-clockwise on the page [degrees].

    ``centred`` texts have their middle at ``at``, others their base line. A ``halo`` colour keeps
    the text readable on any background.
    """

    at: Point2
    text: str
    size: float
    colour: Colour
    anchor: Literal["start", "middle", "end"] = "middle"
    turn: float = 0.0
    bold: bool = False
    halo: Colour | None = None
    centred: bool = False


DrawingItem: TypeAlias = Shape | Disc | TextLabel


@dataclass(slots=True)
class Drawing:
    """Page of ``width`` by ``height``; screen readers read its ``title``.

    ``ways`` are the paths of the runs as JSON, for scripts. ``groups`` are items by name, in the
    order of painting.
    """

    width: float
    height: float
    title: str
    about: str
    ways: str = ""
    groups: dict[str, list[DrawingItem]] = field(default_factory=dict)

    def add(self, name: str, items: list[DrawingItem]) -> None:
        """Paint ``items`` over all earlier ones."""
        if items:
            self.groups[name] = items


LETTER: Final = 0.56
"""Mean width of a letter, in sizes of the letter."""
_PAD: Final = 2.0


class Labels:
    """Placement of texts on a page, away from each other and from earlier items."""

    def __init__(self) -> None:
        self._places: list[Any] = []
        self._weights: list[float] = []
        self._widths: list[float] = []

    def avoid(self, items: Iterable[DrawingItem], weight: float) -> None:
        """Keep texts away from ``items``: full coverage of an item costs ``weight``."""
        for item in items:
            for place in _places(item):
                # The area of a line is its length times its width plus padding.
                width = item.width + 2 * _PAD if isinstance(item, Shape) and item.open else 0.0
                self._occupy(place, weight, width)

    def _occupy(self, place: Any, weight: float, width: float = 0.0) -> None:
        self._places.append(place)
        self._weights.append(weight)
        self._widths.append(width)

    def place(self, words: TextLabel, spots: Iterable[Point2]) -> TextLabel:
        """Return ``words`` at the best of ``spots``; earlier spots win ties."""
        places = list(spots) or [words.at]
        areas = _extents(words, places)
        # Later spots cost slightly more, so that texts stay near their objects if possible.
        best = int(np.argmin(0.02 * np.arange(len(places)) + self._covered(areas)))
        self._occupy(areas[best], 4.0)
        return replace(words, at=places[best])

    def _covered(self, texts: Any) -> Floats:
        """Return the cost of each area of a text, from the items that it covers."""
        places, widths = np.array(self._places, dtype=object), np.array(self._widths)
        text, other = shapely.STRtree(places).query(texts, predicate="intersects")
        both, width = shapely.intersection(texts[text], places[other]), widths[other]
        shared = np.where(width > 0.0, shapely.length(both) * width, shapely.area(both))
        shares: Floats = shared / shapely.area(texts)[text] * np.array(self._weights)[other]
        return np.bincount(text, shares, minlength=len(texts)).astype(np.float64)


def _extents(words: TextLabel, places: Sequence[Point2]) -> Any:
    """Return the padded areas of a centred text at each of ``places``."""
    wide = LETTER * words.size * max(len(words.text), 1) / 2.0 + _PAD
    high = words.size * 0.6 + _PAD
    at_x, at_y = np.array(places, dtype=np.float64).T[:, :, None]
    x = at_x + np.array((wide, wide, -wide, -wide))
    y = at_y + np.array((-high, high, high, -high))
    if words.turn:
        # The y axis of the page points down, so a left turn there is a right turn here.
        angle = math.radians(-words.turn)
        along, across = math.cos(angle), math.sin(angle)
        x, y = (
            along * x - across * y + (at_x - at_x * along + at_y * across),
            across * x + along * y + (at_y - at_x * across - at_y * along),
        )
    return shapely.polygons(np.stack([x, y], axis=2))


def _places(item: DrawingItem) -> list[Any]:
    match item:
        case TextLabel():
            return list(_extents(item, [item.at]))
        case Disc():
            return [shapely.Point(item.centre).buffer(item.radius + _PAD, quad_segs=4)]
        case Shape(open=True):
            return [LineString(ring) for ring in item.rings if len(ring) > 1]
        case Shape():
            rings = [ring for ring in item.rings if len(ring) > 2]
            return [MultiPoint(ring).convex_hull for ring in rings]
    return []
