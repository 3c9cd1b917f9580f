"""Bright themes: the colours of :mod:`scenario_tui.palette`, darkened to stand out from them."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

from rich.color import Color as TerminalColor
from rich.color_triplet import ColorTriplet
from rich.segment import Segment
from rich.style import Style
from textual.color import Color
from textual.filter import LineFilter

from scenario_tui.palette import BAD, BROKEN, BUSY, FACT, GOOD, QUIET, UNSURE

_DARK: Final = 0.27
"""Lightness that gives each of them a contrast of 4.5 to 1 to a bright grey at least."""
_PALE: Final = frozenset(
    Color.parse(colour).rich_color.get_truecolor()
    for colour in (GOOD, BAD, UNSURE, BROKEN, BUSY, FACT, QUIET)
)


class Daylight(LineFilter):
    """Darkens the words that have a colour of ours."""

    def apply(self, segments: Sequence[Segment], background: Color) -> list[Segment]:
        """Return the segments as they can be read over a bright background."""
        return [
            Segment(text, style and _darkened(style), control) for text, style, control in segments
        ]


@lru_cache(maxsize=1024)
def _darkened(style: Style) -> Style:
    if style.color is None or style.color.get_truecolor() not in _PALE:
        return style
    return style + Style(color=TerminalColor.from_triplet(darker(style.color.get_truecolor())))


def darker(colour: ColorTriplet) -> ColorTriplet:
    """Return a colour of the same hue that stands out from white."""
    hue, _, saturation = colorsys.rgb_to_hls(*colour.normalized)
    red, green, blue = colorsys.hls_to_rgb(hue, _DARK, saturation)
    return ColorTriplet(round(255 * red), round(255 * green), round(255 * blue))
