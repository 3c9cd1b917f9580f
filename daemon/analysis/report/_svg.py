"""The small SVG of figures: colours by the names the page gives them, paths, words.

A figure names colours (``ink``, ``line``, …); the page gives each a value in light and dark, so
figures follow the theme of the reader. Lengths are points, 1/72 inch.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Final, Protocol
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Floats
from templates.naming import xml_text

INK: Final = "ink"
SOFT: Final = "soft"
RULE: Final = "rule"
WALL: Final = "wall"
LINE: Final = "line"
SECOND: Final = "second"
BAD: Final = "bad"
NEAR: Final = "near"
GOOD: Final = "good"
BODY: Final = "body"
SERIES: Final = tuple(f"s{number}" for number in range(8))
"""Colours of scenarios or systems under test side by side, in this order."""

_DEVIATION: Final = 0.06
"""Points a line may pass beside what it is drawn from, in each of the passes that thin it."""
_PASSES: Final = 6
_FAR: Final = 1e4
"""What lies further outside [points] is drawn there: beyond any page, within any renderer."""
_QUOTE: Final = {'"': "&quot;"}


class PagePicture(Protocol):
    """What can be drawn on a page."""

    def svg(self, name: str, label: str) -> str:
        """Return an ``<svg>`` element; ``name`` keeps its identifiers apart from those of others,
        ``label`` is read out where pictures are not seen.
        """
        ...


def colour_value(name: str) -> str:
    """Return the CSS value of a colour: a name of the page, or ``#rrggbb`` as it is."""
    return name if name.startswith("#") or name == "none" else f"var(--{name})"


def number(value: float) -> str:
    """Return a coordinate with one decimal at most."""
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


def attribute(text: str) -> str:
    """Return ``text`` to stand between the double quotes of an attribute."""
    return escape(xml_text(text), _QUOTE)


def style(**values: str | float) -> str:
    """Return a ``style`` attribute; underscores of names become hyphens, empty values are left
    out.
    """
    parts = (f"{name.replace('_', '-')}:{value}" for name, value in values.items() if value != "")
    return f' style="{";".join(parts)}"'


def stroke(colour: str, width: float, *, dashes: str = "", alpha: float = 1.0) -> str:
    """Return the style of a line: width [points], ``dashes`` as in SVG, opacity."""
    return style(
        fill="none",
        stroke=colour_value(colour),
        stroke_width=f"{width:g}",
        stroke_dasharray=dashes,
        stroke_opacity="" if alpha == 1.0 else f"{alpha:g}",
    )


def text_element(
    x: float,
    y: float,
    words: str,
    size: float,
    colour: str,
    *,
    anchor: str = "",
    turn: float = 0.0,
    halo: bool = False,
) -> str:
    """Return words whose baseline begins (or by ``anchor`` ends, has its middle) at a point.

    ``turn`` is in degrees, against the clock. A ``halo`` of the page keeps them readable on lines.
    """
    around = {"stroke": "var(--paper)", "stroke_width": "2", "paint_order": "stroke"}
    look = style(
        font_size=f"{size:g}px",
        fill=colour_value(colour),
        text_anchor=anchor,
        **(around if halo else {}),
    )
    place = f'x="{number(x)}" y="{number(y)}"'
    if turn:
        place += f' transform="rotate({-turn:g} {number(x)} {number(y)})"'
    return f"<text {place}{look}>{escape(xml_text(words))}</text>"


def path_data(points: Floats, *, closed: bool = False) -> str:
    """Return the path through ``points`` (n, 2), with gaps where one of them is not a number.

    Points that make no difference to be seen are left out; a single point between gaps is no line.
    """
    ending = "z" if closed else ""
    return "".join(
        _subpath(piece, ending) for piece in _pieces(np.asarray(points, dtype=np.float64))
    )


def rings_data(rings: Iterable[Floats]) -> str:
    """Return several closed outlines as one path."""
    outlines = [np.asarray(ring, dtype=np.float64) for ring in rings]
    found = [""] * len(outlines)
    # A building has hundreds of outlines of four corners: those of one length are looked at at
    # once, and only the few of which a part is left out one by one.
    for length in {len(outline) for outline in outlines}:
        places = [i for i, outline in enumerate(outlines) if len(outline) == length]
        stack = np.stack([outlines[i] for i in places])
        shown: Floats = np.clip(stack, -_FAR, _FAR).round(1)
        plain: npt.NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(stack), axis=(1, 2))
        plain &= ~np.logical_or.reduce(_idle(shown), axis=1)
        for i, as_it_is, points in zip(places, plain.tolist(), shown.tolist(), strict=True):
            if as_it_is and length > 1:
                found[i] = _subpath(points, "z")
            else:
                found[i] = path_data(outlines[i], closed=True)
    return "".join(found)


def path_element(data: str, look: str) -> str:
    """Return a path, nothing where there is none; ``look`` is its style."""
    return f'<path d="{data}"{look}/>' if data else ""


def cross_data(u: float, v: float, half: float) -> str:
    """Return the path of a lying cross around a point, ``half`` to every side."""
    west, east, above, below = map(number, (u - half, u + half, v - half, v + half))
    return f"M{west} {above} {east} {below}M{west} {below} {east} {above}"


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Floats:
    """Return the corners (4, 2) of a rectangle between two points."""
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _subpath(points: list[list[float]], ending: str) -> str:
    # What :func:`number` does, of all at once: figures of a campaign have 100 000 points.
    written = "%.1f " * (2 * len(points)) % tuple(chain.from_iterable(points))
    return "M" + written.replace(".0 ", " ").replace("-0 ", "0 ")[:-1] + ending


def _pieces(points: Floats) -> Iterator[list[list[float]]]:
    known = np.isfinite(points).all(axis=1)
    edges = np.flatnonzero(np.diff(known)) + 1
    for piece in np.split(np.clip(points, -_FAR, _FAR), edges):
        if len(piece) > 1 and np.isfinite(piece).all():
            yield _thinned(np.round(piece, 1)).tolist()


def _thinned(points: Floats) -> Floats:
    """Return ``points`` without those that lie on the way between their neighbours."""
    for turn in range(_PASSES):
        idle = _idle(points)
        if not idle.any():
            break
        # Never two neighbours at once: each was measured with the other in place.
        idle[turn % 2 :: 2] = False
        points = points[np.concatenate(([True], ~idle, [True]))]
    return points


def _idle(points: Floats) -> npt.NDArray[np.bool_]:
    """Return which of ``points`` (..., n, 2) lie on the way between their neighbours.

    The shape is (..., n - 2): the first and the last are none of them.
    """
    along, to = points[..., 2:, :] - points[..., :-2, :], points[..., 1:-1, :] - points[..., :-2, :]
    length = np.hypot(along[..., 0], along[..., 1])
    beside = np.abs(along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0])
    share = (along * to).sum(axis=-1)
    # Between them, not behind one of them: a line that turns back has its tip there.
    between = (share >= 0.0) & (share <= length * length)
    idle: npt.NDArray[np.bool_] = between & (beside <= _DEVIATION * length)
    return idle & ((length > 0.0) | ~to.any(axis=-1))
