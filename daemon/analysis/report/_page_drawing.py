"""Drawings of worlds to stand inside of a page, without the parts that the page says itself."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace

from daemon.analysis.report._svg import attribute, number
from grammars.model.geometry import Point2
from templates.picture import Disc, Drawing, DrawingItem, Shape
from templates.rendering import render


@dataclass(frozen=True, slots=True)
class DrawingWindow:
    """The part of a drawing that is shown, in its own units."""

    left: float
    top: float
    width: float
    height: float

    def shows(self, ring: Iterable[Point2]) -> bool:
        """Whether the box around a ring and this window have something in common."""
        xs, ys = zip(*ring, strict=True)
        beside = max(xs) < self.left or min(xs) > self.left + self.width
        return not beside and max(ys) >= self.top and min(ys) <= self.top + self.height


def drawing_svg(
    drawing: Drawing, window: DrawingWindow, label: str, *, omitted: Collection[str], css: str = ""
) -> str:
    """Return the part of a drawing in ``window`` as ``<svg>``, without the groups ``omitted``.

    ``label`` is read out where pictures are not seen, ``css`` is the class of the element.
    """
    groups = [
        replace(group, items=tuple(_visible(group.items, window)))
        for group in drawing.groups
        if group.name not in omitted
    ]
    whole = render("picture.svg.j2", figure=replace(drawing, groups=groups))
    body = whole[whole.index("<g ") : whole.rindex("</svg>")] if groups else ""
    # Identifiers of the groups would stand on the page beside those of its sections.
    body = re.sub(r'<g id="[^"]*">', "<g>", body)
    box = " ".join(map(number, (window.left, window.top, window.width, window.height)))
    named = f' class="{css}"' if css else ""
    opening = f'<svg viewBox="{box}" role="img" aria-label="{attribute(label)}"{named}>'
    return f"{opening}{body}</svg>"


def _visible(items: Iterable[DrawingItem], window: DrawingWindow) -> Iterator[DrawingItem]:
    """Return items without the rings outside of ``window``: most of a building is far away."""
    for item in items:
        if isinstance(item, Shape):
            rings = tuple(ring for ring in item.rings if window.shows(ring))
            if rings:
                yield replace(item, rings=rings)
        elif window.shows([item.centre if isinstance(item, Disc) else item.at]):
            yield item
