"""A run on the page: the way driven, what was believed, where it was too close, contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from grammars.values import Point2
from templates.picture._figure import Disc, Item, Shape, Words
from templates.picture._page import FLOOR, FOOT, INK, MARGIN, Page

DRIVEN: Final = "#1d7f58"
BELIEVED: Final = "#7d4f9e"
CLOSE: Final = "#e08a1e"
TOUCHED: Final = "#c4161c"


@dataclass(frozen=True, slots=True)
class Driven:
    """What happened, in the map frame [m]: lines of points, and single points.

    ``close`` are the pieces of the way with something inside the safety buffer.
    """

    way: tuple[Point2, ...]
    believed: tuple[Point2, ...] = ()
    close: tuple[tuple[Point2, ...], ...] = ()
    contacts: tuple[Point2, ...] = ()
    about: str = ""


def driven(what: Driven, page: Page) -> list[Item]:
    """Return the lines of a run, what it was told to believe below the truth."""
    items: list[Item] = []
    if len(what.believed) > 1:
        line = page.ring(what.believed)
        items.append(Shape((line,), line=BELIEVED, width=1.6, dash=(6.0, 4.0), open=True))
    if len(what.way) > 1:
        items.append(Shape((page.ring(what.way),), line=DRIVEN, width=2.6, open=True))
        items.append(Disc(page.point(what.way[-1]), 5.0, DRIVEN, FLOOR, 1.5))
    items += [
        Shape((page.ring(piece),), line=CLOSE, width=4.5, open=True)
        for piece in what.close
        if len(piece) > 1
    ]
    for point in what.contacts:
        x, y = page.point(point)
        for way in (1.0, -1.0):
            cross = ((x - 6.0, y - 6.0 * way), (x + 6.0, y + 6.0 * way))
            items.append(Shape((cross,), line=TOUCHED, width=3.0, open=True))
    return items


def key(what: Driven, page: Page) -> list[Item]:
    """Return what the lines mean, in a row of its own at the foot of the page."""
    y, x = page.height - FOOT / 2.0 + 22.0, MARGIN
    items: list[Item] = []
    for text, colour, shown in (
        ("driven", DRIVEN, len(what.way) > 1),
        ("believed", BELIEVED, len(what.believed) > 1),
        ("inside the buffer", CLOSE, bool(what.close)),
        ("contact", TOUCHED, bool(what.contacts)),
    ):
        if shown:
            items.append(Shape((((x, y), (x + 16.0, y)),), line=colour, width=4.0, open=True))
            items.append(Words((x + 23.0, y + 4.5), text, 12.5, INK, "start"))
            x = round(x + 23.0 + 7.2 * len(text) + 22.0, 2)
    return items
