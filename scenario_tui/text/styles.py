"""Words for verdicts and states with their glyphs, and the styles of texts by name.

A verdict is always a glyph and a word, never a colour alone. The words and the constants here are
names of styles, and the theme of a console defines their looks. :func:`terminal_theme` has the
terminal's own colours, because the command line does not know the background.
:func:`dashboard_theme` has :data:`COLOURS`, which also colour maps and signals.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.theme import Theme

GOOD: Final = "good"
BAD: Final = "bad"
UNSURE: Final = "unsure"
BROKEN: Final = "broken"
BUSY: Final = "busy"
FACT: Final = "fact"
DOORS: Final = "doors"
QUIET: Final = "quiet"
"""The style of words that should not draw the eye."""
NEWS: Final = "news"
"""The style of unexpected results."""
KNOWN: Final = "known"
"""The style of expected failures."""
CHANGED: Final = "changed"
"""The style of values that differ from the written ones."""

# Pale, for dark backgrounds, and bright enough to be read as greys without colours.
# terminal.filters.BrightThemeColours darkens them on bright backgrounds.
COLOURS: Final = {
    GOOD: "#7fd88f",
    BAD: "#ff7b7b",
    UNSURE: "#f5c76a",
    BROKEN: "#e29bff",
    BUSY: "#8ab8ff",
    FACT: "#7fd5e0",
    DOORS: "#f0a070",
    QUIET: "#a0a4ad",
}
"""The colours of the dashboard by the names of their styles."""
MARKED: Final = "#2b3a55"
"""The background of marked signs."""
_TERMINAL: Final = {
    GOOD: "green",
    BAD: "red",
    UNSURE: "yellow",
    BROKEN: "magenta",
    BUSY: "blue",
    FACT: "cyan",
    DOORS: "yellow",
    QUIET: "dim",
}
"""The colours of the command line, in the words of rich."""

_WORDS: Final = (
    ("fail", "✗", BAD, "bold"),
    ("error", "‼", BROKEN, "bold"),
    ("lost", "∅", BROKEN, "bold"),
    ("inconclusive", "?", UNSURE, ""),
    ("running", "▶", BUSY, ""),
    ("queued", "…", QUIET, ""),
    ("cancelled", "-", QUIET, ""),
    ("pass", "✓", GOOD, ""),
    ("measure", "·", FACT, ""),
)
"""Words for verdicts and states, each with glyph, name of its colour, attributes."""

SEVERITY: Final = tuple(word for word, *_ in _WORDS)
"""Words in the order in which people must look at them."""
GLYPHS: Final = {word: glyph for word, glyph, *_ in _WORDS}

_STYLES: Final = {
    **{name: (name, "") for name in COLOURS},
    **{word: (colour, attributes) for word, _, colour, attributes in _WORDS},
    NEWS: (BAD, "bold"),
    KNOWN: (UNSURE, ""),
    CHANGED: (UNSURE, "bold"),
    "fail.far": (BAD, "bold reverse"),
    "known.far": (UNSURE, "reverse"),
}
"""The name of the colour and the attributes of every style."""


def terminal_theme() -> Theme:
    """Return the styles on a terminal whose background is unknown: its own colours."""
    return _theme(_TERMINAL)


def dashboard_theme() -> Theme:
    """Return the styles on the dashboard."""
    return _theme(COLOURS)


def _theme(colours: Mapping[str, str]) -> Theme:
    from rich.theme import Theme

    return Theme(
        {name: f"{more} {colours[colour]}".strip() for name, (colour, more) in _STYLES.items()}
    )
