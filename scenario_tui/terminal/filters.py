"""Line filters: they remove control characters, and adapt colours to the terminal and theme.

People choose the sixteen colours of their terminal. Therefore a poor terminal shows its own
foreground and background, and words keep their hue. Bright backgrounds (the selected row, the
banner of a lost connection) become reverse video.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style
from textual.color import Color
from textual.filter import LineFilter

from grammars.text.terminal_text import printable
from scenario_tui.text.ascii_signs import to_ascii
from scenario_tui.text.styles import COLOURS, MARKED

_LIT: Final = 0.35
"""Least brightness of a background that stands out from a dark one."""
_FAINT: Final = 0.19
"""Brightness below which words become dim: they should not draw the eye."""
_GREY: Final = 0.22
"""Saturation below which a colour counts as grey."""
_HUES: Final = (
    (20, "red"),
    (70, "yellow"),
    (165, "green"),
    (262, "cyan"),
    (330, "magenta"),
    (361, "red"),
)
"""The last angle [degree] of each colour of the terminal; its blue is too dark to be read."""
_PARTS: Final = re.compile("(?P<gap>  +)|(?P<other>[^ ]+| )")
_LINE_ENDS: Final = dict.fromkeys(map(ord, "\t\r\n"), "\N{REPLACEMENT CHARACTER}")


class PrintableText(LineFilter):
    """Makes control characters visible that would steer the terminal, in any widget."""

    def apply(self, segments: Sequence[Segment], background: Color) -> list[Segment]:
        """Return the segments, together as wide as before, with printable text.

        Most control characters have no width. Their replacement takes its cells from the next gap
        in the line, so that columns stay. Without a gap they are left out.
        """
        if all(segment.text.isprintable() for segment in segments):
            return list(segments)
        fitted, missing = _fitted(segments)
        return fitted if not missing else [_without_steering(segment) for segment in segments]


def _fitted(segments: Sequence[Segment]) -> tuple[list[Segment], int]:
    """Return printable segments, and the number of cells by which they are wider than before."""
    fitted, missing = [], 0
    for segment in segments:
        parts = []
        for part in _PARTS.finditer(segment.text):
            text = _one_line(part[0])
            if part.lastgroup == "gap":
                cells = min(missing, len(text) - 1)
                text, missing = text[cells:], missing - cells
            elif text != part[0]:
                missing += cell_len(text) - cell_len(part[0])
            parts.append(text)
        fitted.append(segment._replace(text="".join(parts)))
    return fitted, missing


def _without_steering(segment: Segment) -> Segment:
    pairs = zip(segment.text, _one_line(segment.text), strict=True)
    text = (new for old, new in pairs if new == old or cell_len(old))
    return segment._replace(text="".join(text))


def _one_line(text: str) -> str:
    # Tabs and line ends would move the rest of a line on the screen.
    return printable(text).translate(_LINE_ENDS)


class ReducedColours(LineFilter):
    """Replaces all colours by those of the terminal, or by attributes alone."""

    def __init__(self, *, colours: bool) -> None:
        super().__init__()
        self.colours = colours

    def apply(self, segments: Sequence[Segment], background: Color) -> list[Segment]:
        """Return the segments in styles that the terminal has, over ``background``."""
        dark = background.brightness < 0.5
        return [
            Segment(text, style and reduce_style(style, colours=self.colours, dark=dark), control)
            for text, style, control in segments
        ]


@lru_cache(maxsize=4096)
def reduce_style(style: Style, *, colours: bool, dark: bool = True) -> Style:
    """Return a style with the terminal's own colours; without ``colours`` attributes only."""
    over, colour = (one and Color.from_rich_color(one) for one in (style.bgcolor, style.color))
    lit = over is not None and (over.brightness > _LIT if dark else over.brightness < 0.73)
    # Text on a bright background becomes reverse video in the terminal's own two colours.
    colour = None if lit else colour
    faint = colour is not None and (colour.brightness < _FAINT if dark else colour.brightness > 0.9)
    return Style(
        color=_named(colour) if colour is not None and colours and not faint else None,
        # None and not False: unset attributes are not sent.
        bold=style.bold or None,
        dim=faint or style.dim or None,
        italic=style.italic or None,
        underline=style.underline or None,
        strike=style.strike or None,
        reverse=bool(style.reverse) != lit or None,
    )


def _named(colour: Color) -> str | None:
    """Return the colour of the terminal with that hue, its foreground for greys."""
    hue, saturation, _ = colour.hsl
    if saturation < _GREY:
        return None
    return next(name for last, name in _HUES if hue * 360 < last)


class AsciiGlyphs(LineFilter):
    """Replaces all text by ASCII."""

    def apply(self, segments: Sequence[Segment], background: Color) -> list[Segment]:
        """Return the segments in ASCII, each as wide as before."""
        return [
            segment if segment.text.isascii() else segment._replace(text=to_ascii(segment.text))
            for segment in segments
        ]


_DARK_LIGHTNESS: Final = 0.27
"""Lightness that gives each colour a contrast of at least 4.5 to 1 to a bright grey."""
_MARKED: Final = Style(bgcolor=MARKED).bgcolor
_BRIGHT_MARKED: Final = "#cfdff2"
_OUR_COLOURS: Final = frozenset(
    Color.parse(colour).rich_color.get_truecolor() for colour in COLOURS.values()
)


class BrightThemeColours(LineFilter):
    """Darkens words in our colours on bright backgrounds."""

    def apply(self, segments: Sequence[Segment], background: Color) -> list[Segment]:
        """Return the segments in colours that can be read over a bright background."""
        return [
            Segment(text, style and _darken_style(style), control)
            for text, style, control in segments
        ]


@lru_cache(maxsize=1024)
def _darken_style(style: Style) -> Style:
    if style.bgcolor == _MARKED:
        style += Style(bgcolor=_BRIGHT_MARKED)
    if style.color is None or style.color.get_truecolor() not in _OUR_COLOURS:
        return style
    return style + Style(color=darken(Color.from_rich_color(style.color)).rich_color)


def darken(colour: Color) -> Color:
    """Return a colour of the same hue that stands out from white."""
    return Color.from_hsl(colour.hsl.h, colour.hsl.s, _DARK_LIGHTNESS)
