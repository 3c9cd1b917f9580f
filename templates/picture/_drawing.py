"""What a picture is made of, in the order it is painted, and where its texts find room.

Page units are pixels of the SVG, x to the right, y down. Colours are ``#rrggbb``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, TypeAlias

import shapely
from shapely import affinity
from shapely.geometry import LineString, MultiPoint, box

from grammars.model.geometry import Point2


@dataclass(frozen=True, slots=True)
class Shape:
    """Lines and areas: ``rings`` are closed (even-odd filled) or, when ``open``, lines."""

    rings: tuple[tuple[Point2, ...], ...]
    fill: str = ""
    line: str = ""
    width: float = 1.0
    opacity: float = 1.0
    dash: tuple[float, float] | None = None
    open: bool = False


@dataclass(frozen=True, slots=True)
class Disc:
    """A filled circle with an outline."""

    centre: Point2
    radius: float
    fill: str
    line: str = ""
    width: float = 1.0


@dataclass(frozen=True, slots=True)
class TextLabel:
    """A text around or beside ``at``; ``turn`` is counter-clockwise on the page [degrees].

    ``centred`` texts have their middle at ``at``, others their base line. With a ``halo`` colour
    a text stays readable on whatever lies below.
    """

    at: Point2
    text: str
    size: float
    colour: str
    anchor: Literal["start", "middle", "end"] = "middle"
    turn: float = 0.0
    bold: bool = False
    halo: str = ""
    centred: bool = False


DrawingItem: TypeAlias = Shape | Disc | TextLabel


@dataclass(frozen=True, slots=True)
class DrawingGroup:
    """Items that belong together, by name."""

    name: str
    items: tuple[DrawingItem, ...]


@dataclass(slots=True)
class Drawing:
    """A page of ``width`` by ``height``; ``title`` is read out where pictures are not seen."""

    width: float
    height: float
    background: str
    title: str
    about: str
    groups: list[DrawingGroup] = field(default_factory=list)

    def add(self, name: str, items: list[DrawingItem]) -> None:
        """Paint ``items`` over what is already there."""
        if items:
            self.groups.append(DrawingGroup(name, tuple(items)))


LETTER: Final = 0.56
"""Mean width of a letter, in sizes of the letter."""
_PAD: Final = 2.0


class Labels:
    """Texts on a page that keep clear of each other and of what is painted already."""

    def __init__(self) -> None:
        self._taken: list[Any] = []
        self._weights: list[float] = []

    def avoid(self, items: Iterable[DrawingItem], weight: float) -> None:
        """Keep texts off ``items``: an area fully covered costs ``weight``."""
        for item in items:
            for area in _areas(item):
                self._taken.append(area)
                self._weights.append(weight)

    def place(self, words: TextLabel, spots: Iterable[Point2]) -> TextLabel:
        """Return ``words`` at the best of ``spots``; earlier ones win where all is equal."""
        tree = shapely.STRtree(self._taken)
        best, least = words, math.inf
        for rank, spot in enumerate(spots):
            tried = replace(words, at=spot)
            # A little for every later spot: texts stay near what they name unless much is in the
            # way.
            cost = 0.02 * rank + self._cost(extent(tried), tree)
            if cost < least:
                best, least = tried, cost
        self._taken.append(extent(best))
        self._weights.append(4.0)
        return best

    def _cost(self, area: Any, tree: shapely.STRtree) -> float:
        near = tree.query(area, predicate="intersects").tolist()
        shares = (
            area.intersection(self._taken[i]).area / area.area * self._weights[i] for i in near
        )
        return float(sum(shares))


def extent(words: TextLabel) -> Any:
    """Return the area a centred text takes on the page, with a little room around it."""
    wide = LETTER * words.size * max(len(words.text), 1) / 2.0 + _PAD
    high = words.size * 0.6 + _PAD
    (x, y) = words.at
    area = box(x - wide, y - high, x + wide, y + high)
    # The page's y looks down, so a turn to the left there is one to the right here.
    return affinity.rotate(area, -words.turn, origin=(x, y)) if words.turn else area


def _share(text: Any, other: Any) -> float:
    """Return how much of the smaller of two areas lies in the other."""
    smaller = min(text.area, other.area)
    return float(text.intersection(other).area / smaller) if smaller > 0.0 else 0.0


def _areas(item: DrawingItem) -> list[Any]:
    match item:
        case TextLabel():
            return [extent(item)]
        case Disc():
            return [shapely.Point(item.centre).buffer(item.radius + _PAD, quad_segs=4)]
        case Shape(open=True):
            lines = [LineString(ring) for ring in item.rings if len(ring) > 1]
            return [line.buffer(item.width + _PAD, quad_segs=1) for line in lines]
        case Shape():
            rings = [ring for ring in item.rings if len(ring) > 2]
            return [MultiPoint(ring).convex_hull for ring in rings]
    return []
