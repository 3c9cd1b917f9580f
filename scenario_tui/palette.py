"""Colours of the dashboard: bright enough to be read as greys where there is no colour.

The command line uses the terminal's own colours (:data:`scenario_tui.wording.STYLES`) because it
does not know the background; the dashboard brings its own dark one.
"""

from __future__ import annotations

from typing import Final

GOOD: Final = "#7fd88f"
BAD: Final = "#ff7b7b"
UNSURE: Final = "#f5c76a"
BROKEN: Final = "#e29bff"
BUSY: Final = "#8ab8ff"
FACT: Final = "#7fd5e0"
QUIET: Final = "#a0a4ad"

WORDS: Final = {
    "pass": GOOD,
    "fail": f"bold {BAD}",
    "inconclusive": UNSURE,
    "error": f"bold {BROKEN}",
    "measure": FACT,
    "lost": f"bold {BROKEN}",
    "cancelled": QUIET,
    "queued": QUIET,
    "running": BUSY,
}
"""A style for each word of :data:`scenario_tui.wording.GLYPHS`."""
