"""What stands around values that are drawn: limits, grid, ticks with their words, a legend.

What is drawn is kept as it was given and turned into paths once the limits are known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from daemon.analysis.report._scale import AxesTransform, tick_names
from daemon.analysis.report._svg import (
    RULE,
    SOFT,
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
from grammars.model.geometry import Floats

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

Drawing: TypeAlias = Callable[[AxesTransform], str]
"""What is drawn, written once it is known where values are on the page."""

_SampleKind: TypeAlias = Literal["line", "area", "dot", "cross"]


@dataclass(frozen=True, slots=True)
class _LegendEntry:
    words: str
    colour: str
    kind: _SampleKind
    dashes: str = ""
    alpha: float = 1.0


class AxesFrame:
    """A rectangle of a sheet with an axis along x and one along y, and what is drawn in it."""

    def __init__(self, left: float, top: float, width: float, height: float) -> None:
        self._box = (left, top, width, height)
        self._drawings: list[Drawing] = []
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
        outline = " ".join(f'{name}="{number(length)}"' for name, length in sides)
        return (
            f'<clipPath id="{clip}"><rect {outline}/></clipPath>'
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
        return (
            path_element(lines, stroke(RULE, 0.5))
            + path_element(spines, stroke(RULE, 0.8))
            + "".join(words)
        )

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


def _legend_sample(entry: _LegendEntry, right: float, y: float) -> str:
    if entry.kind == "dot":
        look = style(fill=colour_value(entry.colour))
        return f'<circle cx="{number(right - 4.2)}" cy="{number(y)}" r="2"{look}/>'
    if entry.kind == "cross":
        return path_element(cross_data(right - 4.2, y, 2.0), stroke(entry.colour, 1.1))
    if entry.kind == "area":
        look = style(fill=colour_value(entry.colour), fill_opacity=f"{entry.alpha:g}")
        return path_element(rings_data([rectangle(right - 8.4, y - 2.4, right, y + 2.4)]), look)
    points = np.array([(right - 8.4, y), (right, y)])
    return path_element(path_data(points), stroke(entry.colour, 1.2, dashes=entry.dashes))


def _fitting_ticks(low: float, high: float, most: float, room: float) -> list[tuple[float, str]]:
    """Return ticks whose names are no wider than ``room`` [points].

    Of fewer ticks the names are shorter: 0.005 is written where 0.0025 would be cut.
    """
    named = tick_names(low, high, most)
    while len(named) > 3 and max(_SMALL * _DIGIT * len(name) for _, name in named) > room:
        most = 0.6 * most
        named = tick_names(low, high, most)
    return named
