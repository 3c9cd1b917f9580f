"""Words for verdicts and states with their glyphs, and the styles of texts by name.

A verdict is always a glyph and a word, never a colour alone. Texts name their styles: every word
here is one, and so are :data:`QUIET`, :data:`NEWS` and :data:`KNOWN`. The theme of a console says
what they look like: :func:`terminal_theme` has the terminal's own colours, for the command line,
which does not know the background, and :func:`dashboard_theme` those for the dashboard.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.theme import Theme

# Pale, for dark backgrounds, and bright enough to be read as greys where there is no colour:
# terminal.filters.BrightThemeColours darkens them on bright backgrounds.
GOOD: Final = "#7fd88f"
BAD: Final = "#ff7b7b"
UNSURE: Final = "#f5c76a"
BROKEN: Final = "#e29bff"
BUSY: Final = "#8ab8ff"
FACT: Final = "#7fd5e0"
FAINT: Final = "#a0a4ad"
DOORS: Final = "#f0a070"
MARKED: Final = "#2b3a55"
"""The background of signs that are marked."""

_WORDS: Final = (
    ("fail", "✗", "bold red", f"bold {BAD}"),
    ("error", "‼", "bold magenta", f"bold {BROKEN}"),
    ("lost", "!", "bold magenta", f"bold {BROKEN}"),
    ("inconclusive", "?", "yellow", UNSURE),
    ("running", "▶", "blue", BUSY),
    ("queued", "…", "dim", FAINT),
    ("cancelled", "-", "dim", FAINT),
    ("pass", "✓", "green", GOOD),
    ("measure", "·", "cyan", FACT),
)
"""Every word for a verdict or a state: glyph, style on the terminal, style on the dashboard."""

SEVERITY: Final = tuple(word for word, *_ in _WORDS)
"""Words in the order in which people must look at them."""
GLYPHS: Final = {word: glyph for word, glyph, *_ in _WORDS}

QUIET: Final = "quiet"
"""The style of words that should not draw the eye."""
NEWS: Final = "news"
"""The style of what contradicts an expectation."""
KNOWN: Final = "known"
"""The style of failures that were expected."""
CHANGED: Final = "changed"
"""The style of values that are not as they were written."""

_OTHERS: Final = (
    (QUIET, "dim", FAINT),
    (NEWS, "bold red", f"bold {BAD}"),
    (KNOWN, "yellow", UNSURE),
    (CHANGED, "bold yellow", f"bold {UNSURE}"),
    ("fail.far", "bold red reverse", f"bold {BAD} reverse"),
    ("known.far", "yellow reverse", f"{UNSURE} reverse"),
)


def terminal_theme() -> Theme:
    """Return the styles on a terminal whose background is unknown: its own colours."""
    from rich.theme import Theme

    return Theme({name: terminal for name, *_, terminal, _ in (*_WORDS, *_OTHERS)})


def dashboard_theme() -> Theme:
    """Return the styles on the dashboard."""
    from rich.theme import Theme

    return Theme({name: dashboard for name, *_, dashboard in (*_WORDS, *_OTHERS)})
