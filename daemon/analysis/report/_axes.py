"""Axes with lines, areas and points on them, put above each other on a sheet, written as SVG."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final, Literal

import numpy as np

from daemon.analysis.report._axes_frame import AxesFrame
from daemon.analysis.report._scale import AxesTransform
from daemon.analysis.report._svg import (
    INK,
    SOFT,
    attribute,
    colour_value,
    cross_data,
    number,
    path_data,
    path_element,
    rectangle,
    rings_data,
    stroke,
    style,
    text_element,
)

_INCH: Final = 72.0
_SIDES: Final = (26.0, 8.6, 14.4, 24.5)
"""Room around axes for their words, left, right, above and below [points]."""
_BARE_SIDES: Final = (1.5, 1.5, 1.5, 1.5)
_BETWEEN: Final = 19.0
"""Room between axes that stand on each other [points]."""


class Axes(AxesFrame):
    """Axes in which values are drawn; lengths of marks are in points."""

    def line(
        self,
        x: Any,
        y: Any,
        colour: str,
        width: float,
        *,
        dashes: str = "",
        alpha: float = 1.0,
        label: str = "",
        flat: bool = False,
    ) -> None:
        """Draw a line, with gaps where a value is not a number; ``flat`` ends are not round."""
        self._extend(x, y)
        ends = "" if flat else ' stroke-linecap="round" stroke-linejoin="round"'
        look = stroke(colour, width, dashes=dashes, alpha=alpha) + ends
        self._drawings.append(lambda at: path_element(path_data(at.points(x, y)), look))
        self._note(label, colour, "line", dashes, alpha)

    def area(
        self, x: Any, low: Any, high: Any, colour: str, alpha: float, *, label: str = ""
    ) -> None:
        """Fill what is between two lines over the same ``x``."""
        xs = np.asarray(x, float)
        lower, upper = (np.broadcast_to(np.asarray(side, float), xs.shape) for side in (low, high))
        self._extend(xs, lower)
        self._extend(xs, upper)
        around = np.concatenate((xs, xs[::-1])), np.concatenate((upper, lower[::-1]))
        look = style(fill=colour_value(colour), fill_opacity=f"{alpha:g}")
        self._drawings.append(
            lambda at: path_element(path_data(at.points(*around), closed=True), look)
        )
        self._note(label, colour, "area", "", alpha)

    def dots(
        self, x: Any, y: Any, colour: str, size: float, *, alpha: float = 1.0, label: str = ""
    ) -> None:
        """Draw discs, ``size`` wide."""
        self._extend(x, y)
        look = style(fill=colour_value(colour), fill_opacity="" if alpha == 1.0 else f"{alpha:g}")
        self._drawings.append(
            lambda at: "".join(
                f'<circle cx="{number(u)}" cy="{number(v)}" r="{size / 2:g}"{look}/>'
                for u, v in at.points(x, y).tolist()
            )
        )
        self._note(label, colour, "dot", "", alpha)

    def diamonds(self, x: Any, y: Any, colour: str, size: float, *, about: str = "") -> None:
        """Draw standing squares, ``size`` wide, with the page showing between them and the rest.

        ``about`` is shown to whoever points at them.
        """
        self._extend(x, y)
        h = size / 2
        look = style(
            fill=colour_value(colour),
            stroke="var(--paper)",
            stroke_width="0.8",
            paint_order="stroke",
        )

        def draw(at: AxesTransform) -> str:
            rings = [
                np.array([(u, v - h), (u + h, v), (u, v + h), (u - h, v)])
                for u, v in at.points(x, y).tolist()
            ]
            title = f"<title>{attribute(about)}</title>" if about else ""
            return f"<g>{title}{path_element(rings_data(rings), look)}</g>"

        self._drawings.append(draw)

    def crosses(self, x: Any, y: Any, colour: str, size: float, *, label: str = "") -> None:
        """Draw lying crosses, ``size`` wide."""
        self._extend(x, y)
        h = size / 2

        def draw(at: AxesTransform) -> str:
            data = "".join(cross_data(u, v, h) for u, v in at.points(x, y).tolist())
            return path_element(data, stroke(colour, 1.1))

        self._drawings.append(draw)
        self._note(label, colour, "cross")

    def across(
        self, y: float, colour: str, width: float, *, dashes: str = "", label: str = ""
    ) -> None:
        """Draw a line from side to side at a value along y."""
        self._extend([], [y])
        look = stroke(colour, width, dashes=dashes)

        def draw(at: AxesTransform) -> str:
            left, _, wide, _ = self._box
            return path_element(
                path_data(np.array([(left, at.y(y)), (left + wide, at.y(y))])), look
            )

        self._drawings.append(draw)
        self._note(label, colour, "line", dashes)

    def upright(
        self, x: float, colour: str, width: float, *, dashes: str = "", alpha: float = 1.0
    ) -> None:
        """Draw a line from bottom to top at a value along x."""
        self._extend([x], [])
        look = stroke(colour, width, dashes=dashes, alpha=alpha)

        def draw(at: AxesTransform) -> str:
            _, top, _, high = self._box
            return path_element(path_data(np.array([(at.x(x), top), (at.x(x), top + high)])), look)

        self._drawings.append(draw)

    def band(self, low: float, high: float, colour: str, alpha: float) -> None:
        """Fill from side to side between two values along y."""
        look = style(fill=colour_value(colour), fill_opacity=f"{alpha:g}")

        def draw(at: AxesTransform) -> str:
            left, _, wide, _ = self._box
            return path_element(
                rings_data([rectangle(left, at.y(low), left + wide, at.y(high))]), look
            )

        self._drawings.append(draw)

    def column(self, low: float, high: float, colour: str, alpha: float) -> None:
        """Fill from bottom to top between two values along x."""
        look = style(fill=colour_value(colour), fill_opacity=f"{alpha:g}")

        def draw(at: AxesTransform) -> str:
            _, top, _, high_side = self._box
            ring = rectangle(at.x(low), top, at.x(high), top + high_side)
            return path_element(rings_data([ring]), look)

        self._drawings.append(draw)

    def shapes(
        self,
        rings: Iterable[Any],
        *,
        fill: str = "none",
        edge: str = "none",
        width: float = 0.0,
        dashes: str = "",
        alpha: float = 1.0,
    ) -> None:
        """Draw closed outlines (n, 2) as one shape."""
        outlines = [np.asarray(ring, float) for ring in rings]
        for ring in outlines:
            self._extend(ring[:, 0], ring[:, 1])
        look = style(
            fill=colour_value(fill),
            fill_opacity="" if alpha == 1.0 or fill == "none" else f"{alpha:g}",
            stroke=colour_value(edge),
            stroke_width=f"{width:g}",
            stroke_dasharray=dashes,
            stroke_opacity="" if alpha == 1.0 else f"{alpha:g}",
        )
        self._drawings.append(
            lambda at: path_element(
                rings_data(at.points(ring[:, 0], ring[:, 1]) for ring in outlines), look
            )
        )

    def cells(self, levels: Any, half: float, colours: Sequence[str]) -> None:
        """Fill the cells of a square that reaches ``half`` around the origin.

        ``levels`` (n, n) are indices of ``colours`` by x and y, negative where nothing is.
        """
        grid = np.asarray(levels)
        side = 2.0 * half / len(grid)

        def draw(at: AxesTransform) -> str:
            parts = []
            for level, colour in enumerate(colours):
                squares = [
                    rectangle(
                        at.x(i * side - half),
                        at.y(j * side - half),
                        at.x((i + 1) * side - half),
                        at.y((j + 1) * side - half),
                    )
                    for i, j in np.argwhere(grid == level).tolist()
                ]
                # Half a hair over its edge: else the page shines through between neighbours.
                look = style(
                    fill=colour_value(colour), stroke=colour_value(colour), stroke_width="0.1"
                )
                parts.append(path_element(rings_data(squares), look))
            return "".join(parts)

        self._drawings.append(draw)

    def arrow(self, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
        """Draw an arrow between two points."""

        def draw(at: AxesTransform) -> str:
            (x0, y0), (x1, y1) = at.points(*zip(start, end, strict=True)).tolist()
            way = math.atan2(y1 - y0, x1 - x0)
            tips = [
                (x1 - 4.0 * math.cos(way + turn), y1 - 4.0 * math.sin(way + turn))
                for turn in (0.45, -0.45)
            ]
            lines = (np.array([(x0, y0), (x1, y1)]), np.array([tips[0], (x1, y1), tips[1]]))
            return path_element("".join(path_data(points) for points in lines), stroke(colour, 1.0))

        self._drawings.append(draw)

    def words(
        self,
        x: float,
        y: float,
        text: str,
        size: float = 6.5,
        *,
        colour: str = SOFT,
        anchor: Literal["start", "end"] = "start",
        shift: tuple[float, float] = (0.0, 0.0),
        halo: bool = False,
    ) -> None:
        """Write from a point on, or up to it, ``shift`` (right, up) [points] away from it."""
        side = "" if anchor == "start" else anchor
        self._drawings.append(
            lambda at: text_element(
                at.x(x) + shift[0], at.y(y) - shift[1], text, size, colour, anchor=side, halo=halo
            )
        )


class Sheet:
    """Axes above each other, of a size in inches; ``bare`` ones have no words around them."""

    def __init__(self, width: float, height: float, rows: int = 1, *, bare: bool = False) -> None:
        self._size = (width * _INCH, height * _INCH)
        left, right, above, below = _BARE_SIDES if bare else _SIDES
        wide, high = self._size[0] - left - right, self._size[1] - above - below
        each = (high - _BETWEEN * (rows - 1)) / rows
        self.axes = tuple(
            Axes(left, above + row * (each + _BETWEEN), wide, each) for row in range(rows)
        )
        # The same axis below each other: numbers once, at the bottom.
        for axes in self.axes[:-1]:
            axes.x_numbers = False
        if bare:
            self.axes[0].bare = True

    def svg(self, name: str, label: str) -> str:
        """Return an ``<svg>`` element to stand inside of a page.

        ``name`` keeps its identifiers apart from those of other figures; ``label`` is read out
        where pictures are not seen.
        """
        size = " ".join(number(length) for length in self._size)
        drawn = "".join(axes.svg(f"{name}-{row}") for row, axes in enumerate(self.axes))
        return (
            f'<svg viewBox="0 0 {size}" role="img" aria-label="{attribute(label)}" '
            f'xmlns="http://www.w3.org/2000/svg" color="var(--{INK})">{drawn}</svg>'
        )
