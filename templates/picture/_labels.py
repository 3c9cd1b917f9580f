"""Where texts go: each to the spot, out of some, where it covers least of what matters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final

import shapely
from shapely import affinity
from shapely.geometry import LineString, MultiPoint, box

from grammars.values import Point2
from templates.picture._figure import Disc, Item, Shape, Words

LETTER: Final = 0.56
"""Mean width of a letter, in sizes of the letter."""
_PAD: Final = 2.0


class Labels:
    """Texts on a page that keep clear of each other and of what is painted already."""

    def __init__(self) -> None:
        self._taken: list[Any] = []
        self._weights: list[float] = []

    def avoid(self, items: Iterable[Item], weight: float) -> None:
        """Keep texts off ``items``: an area fully covered costs ``weight``."""
        for item in items:
            for area in _areas(item):
                self._taken.append(area)
                self._weights.append(weight)

    def place(self, words: Words, spots: Iterable[Point2]) -> Words:
        """Return ``words`` at the best of ``spots``; earlier ones win where all is equal."""
        tree = shapely.STRtree(self._taken)
        best, least = words, math.inf
        for rank, spot in enumerate(spots):
            tried = replace(words, at=spot)
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


def extent(words: Words) -> Any:
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


def _areas(item: Item) -> list[Any]:
    match item:
        case Words():
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
