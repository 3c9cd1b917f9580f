"""Axes with lines, areas and points on them, put side by side on a sheet, written as SVG.

What is drawn is kept as it was given and turned into paths once the limits are known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from daemon.analysis.report._scale import AxesTransform, tick_names
from daemon.analysis.report._svg import (
    INK,
    RULE,
    SOFT,
    attribute,
    colour_value,
    number,
    path_data,
    rings_data,
    stroke,
    style,
    text_element,
)
from grammars.model.geometry import Floats

_INCH: Final = 72.0
_SIDES: Final = (26.0, 8.6, 14.4, 24.5)
"""Room around axes for their words, left, right, above and below [points]."""
_BARE_SIDES: Final = (1.5, 1.5, 1.5, 1.5)
_BETWEEN: Final = 19.0
"""Room between axes that stand on each other [points]."""
_SMALL: Final = 7.0
_PLAIN: Final = 7.5
"""Sizes of the words at ticks and legends, and of others [points]."""
_LETTER: Final = 0.48
"""Width of a letter, as a share of its size: whose fonts show it is not known here."""
_DIGIT: Final = 0.6
"""Width of a digit in a wide font, as a share of its size."""
_TICK_ROOM: Final = (25.0, 14.0)
"""Points from one tick to the next at least, along x and y."""
_MARGIN: Final = 0.05
"""What is left free on both sides of values, as a share of their range."""

Limits = tuple[float | None, float | None]
"""Lower and upper end of an axis; ``None`` is what the values need."""


_SampleKind: TypeAlias = Literal["line", "area", "dot", "cross"]


@dataclass(frozen=True, slots=True)
class _LegendEntry:
    words: str
    colour: str
    kind: _SampleKind
    dashes: str = ""
    alpha: float = 1.0


_Drawing = Callable[[AxesTransform], str]


class Axes:
    """A rectangle of a sheet in which values are drawn; lengths of marks are in points."""

    def __init__(self, left: float, top: float, width: float, height: float) -> None:
        self._box = (left, top, width, height)
        self._drawings: list[_Drawing] = []
        self._legend: list[_LegendEntry] = []
        self._low = [math.inf, math.inf]
        self._high = [-math.inf, -math.inf]
        self.x_limits: Limits = (None, None)
        self.y_limits: Limits = (None, None)
        self.title = ""
        self.x_label = ""
        self.x_names: Sequence[str] | None = None
        """Words in place of numbers at 0, 1, 2 … along x."""
        self.turned_names = False
        self.y_names: Sequence[str] | None = None
        """Words in place of numbers at 0, 1, 2 … along y."""
        self.x_numbers = True
        self.equal = False
        """Whether a metre is as long along x as along y."""
        self.bare = False
        """Whether there is nothing around what is drawn: neither lines nor ticks."""

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
        self._drawings.append(lambda at: _path(path_data(at.points(x, y)), look))
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
        self._drawings.append(lambda at: _path(path_data(at.points(*around), closed=True), look))
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
            return f"<g>{title}{_path(rings_data(rings), look)}</g>"

        self._drawings.append(draw)

    def crosses(self, x: Any, y: Any, colour: str, size: float, *, label: str = "") -> None:
        """Draw lying crosses, ``size`` wide."""
        self._extend(x, y)
        h = size / 2

        def draw(at: AxesTransform) -> str:
            data = "".join(_cross(u, v, h) for u, v in at.points(x, y).tolist())
            return _path(data, stroke(colour, 1.1))

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
            return _path(path_data(np.array([(left, at.y(y)), (left + wide, at.y(y))])), look)

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
            return _path(path_data(np.array([(at.x(x), top), (at.x(x), top + high)])), look)

        self._drawings.append(draw)

    def band(self, low: float, high: float, colour: str, alpha: float) -> None:
        """Fill from side to side between two values along y."""
        look = style(fill=colour_value(colour), fill_opacity=f"{alpha:g}")

        def draw(at: AxesTransform) -> str:
            left, _, wide, _ = self._box
            return _path(rings_data([_rectangle(left, at.y(low), left + wide, at.y(high))]), look)

        self._drawings.append(draw)

    def column(self, low: float, high: float, colour: str, alpha: float) -> None:
        """Fill from bottom to top between two values along x."""
        look = style(fill=colour_value(colour), fill_opacity=f"{alpha:g}")

        def draw(at: AxesTransform) -> str:
            _, top, _, high_side = self._box
            ring = _rectangle(at.x(low), top, at.x(high), top + high_side)
            return _path(rings_data([ring]), look)

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
            lambda at: _path(
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
                    _rectangle(
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
                parts.append(_path(rings_data(squares), look))
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
            return _path("".join(path_data(points) for points in lines), stroke(colour, 1.0))

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

    def legend_only(self, label: str, colour: str) -> None:
        """Have a line in the legend that stands for several that are drawn."""
        self._note(label, colour, "line")

    def _note(
        self,
        words: str,
        colour: str,
        kind: _SampleKind,
        dashes: str = "",
        alpha: float = 1.0,
    ) -> None:
        if words:
            self._legend.append(_LegendEntry(words, colour, kind, dashes, alpha))

    def _extend(self, x: Any, y: Any) -> None:
        for axis, given in enumerate((x, y)):
            values = np.asarray(given, float)
            values = values[np.isfinite(values)]
            if len(values):
                self._low[axis] = min(self._low[axis], float(values.min()))
                self._high[axis] = max(self._high[axis], float(values.max()))

    def _limits(self, axis: int, asked: Limits) -> tuple[float, float]:
        low, high = self._low[axis], self._high[axis]
        if low > high:
            low, high = 0.0, 1.0
        margin = _MARGIN * (high - low) or _MARGIN * abs(high) or _MARGIN
        lower = low - margin if asked[0] is None else asked[0]
        upper = high + margin if asked[1] is None else asked[1]
        return lower, upper if upper > lower else lower + 1.0

    def svg(self, clip: str) -> str:
        """Return what is drawn; ``clip`` is an identifier of the page that nothing else has."""
        x_limits, y_limits = self._limits(0, self.x_limits), self._limits(1, self.y_limits)
        if self.equal:
            self._shrink((x_limits[1] - x_limits[0]) / (y_limits[1] - y_limits[0]))
        left, top, width, height = self._box
        sx = width / (x_limits[1] - x_limits[0])
        sy = -height / (y_limits[1] - y_limits[0])
        at = AxesTransform(sx, left - x_limits[0] * sx, sy, top - y_limits[1] * sy)
        sides = zip(("x", "y", "width", "height"), self._box, strict=True)
        rectangle = " ".join(f'{name}="{number(length)}"' for name, length in sides)
        return (
            f'<clipPath id="{clip}"><rect {rectangle}/></clipPath>'
            + ("" if self.bare else self._frame(at, x_limits, y_limits))
            + f'<g clip-path="url(#{clip})">{"".join(draw(at) for draw in self._drawings)}</g>'
            + self._around()
        )

    def _shrink(self, ratio: float) -> None:
        """Make the box ``ratio`` times as wide as high, in the middle of what it was."""
        left, top, width, height = self._box
        wide, high = min(width, height * ratio), min(height, width / ratio)
        self._box = (left + (width - wide) / 2, top + (height - high) / 2, wide, high)

    def _frame(
        self, at: AxesTransform, x_limits: tuple[float, float], y_limits: tuple[float, float]
    ) -> str:
        """Return grid, axis lines and the numbers beside them."""
        left, top, width, height = self._box
        right, bottom = left + width, top + height
        grid: list[Floats] = []
        words: list[str] = []
        named = _fitting_ticks(*y_limits, height / _TICK_ROOM[1], left - 3.5)
        if self.y_names is not None:
            named = [(float(k), name) for k, name in enumerate(self.y_names)]
        for value, name in named:
            y = at.y(value)
            grid.append(np.array([(left, y), (right, y)]))
            words.append(text_element(left - 3.5, y + 2.5, name, _SMALL, SOFT, anchor="end"))
        if self.x_names is not None:
            words += self._name_words(at, bottom)
        elif x_limits:
            for value, name in tick_names(*x_limits, width / _TICK_ROOM[0]):
                x = at.x(value)
                grid.append(np.array([(x, top), (x, bottom)]))
                if self.x_numbers:
                    words.append(text_element(x, bottom + 9.0, name, _SMALL, SOFT, anchor="middle"))
        lines = "".join(path_data(line) for line in grid)
        spines = path_data(np.array([(left, top), (left, bottom), (right, bottom)]))
        return _path(lines, stroke(RULE, 0.5)) + _path(spines, stroke(RULE, 0.8)) + "".join(words)

    def _name_words(self, at: AxesTransform, bottom: float) -> list[str]:
        names = self.x_names or ()
        if self.turned_names:
            return [
                text_element(at.x(k) + 3.0, bottom + 8.0, name, _SMALL, SOFT, anchor="end", turn=25)
                for k, name in enumerate(names)
            ]
        return [
            text_element(at.x(k), bottom + 9.0, name, _SMALL, SOFT, anchor="middle")
            for k, name in enumerate(names)
        ]

    def _around(self) -> str:
        left, top, width, height = self._box
        parts = []
        if self.title:
            parts.append(text_element(left, top - 4.0, self.title, _PLAIN, SOFT))
        if self.x_label:
            x, y = left + width / 2, top + height + 19.5
            parts.append(text_element(x, y, self.x_label, _PLAIN, SOFT, anchor="middle"))
        x = left + width
        # From the right, so that the last one ends where the axes do.
        for entry in reversed(self._legend):
            parts.append(text_element(x, top - 4.0, entry.words, _SMALL, SOFT, anchor="end"))
            x -= _SMALL * _LETTER * len(entry.words) + 3.5
            parts.append(_legend_sample(entry, x, top - 6.5))
            x -= 8.4 + 6.3
        return "".join(parts)


def _fitting_ticks(low: float, high: float, most: float, room: float) -> list[tuple[float, str]]:
    """Return ticks whose names are no wider than ``room`` [points].

    Of fewer ticks the names are shorter: 0.005 is written where 0.0025 would be cut.
    """
    named = tick_names(low, high, most)
    while len(named) > 3 and max(_SMALL * _DIGIT * len(name) for _, name in named) > room:
        most = 0.6 * most
        named = tick_names(low, high, most)
    return named


def _cross(u: float, v: float, half: float) -> str:
    west, east, above, below = map(number, (u - half, u + half, v - half, v + half))
    return f"M{west} {above} {east} {below}M{west} {below} {east} {above}"


def _legend_sample(entry: _LegendEntry, right: float, y: float) -> str:
    if entry.kind == "dot":
        look = style(fill=colour_value(entry.colour))
        return f'<circle cx="{number(right - 4.2)}" cy="{number(y)}" r="2"{look}/>'
    if entry.kind == "cross":
        return _path(_cross(right - 4.2, y, 2.0), stroke(entry.colour, 1.1))
    if entry.kind == "area":
        look = style(fill=colour_value(entry.colour), fill_opacity=f"{entry.alpha:g}")
        return _path(rings_data([_rectangle(right - 8.4, y - 2.4, right, y + 2.4)]), look)
    points = np.array([(right - 8.4, y), (right, y)])
    return _path(path_data(points), stroke(entry.colour, 1.2, dashes=entry.dashes))


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> Floats:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _path(data: str, look: str) -> str:
    return f'<path d="{data}"{look}/>' if data else ""


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
