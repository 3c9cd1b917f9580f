"""Abilities of the terminal, by its environment: colours, UTF-8, background, clipboard."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

# Names of terminfo: DEC's terminals, and monochrome variants of others.
_COLOURLESS: Final = re.compile(r"vt\d|.*-m(ono)?$")
_UNDRAWABLE: Final = ("", "dumb", "unknown")
_LIGHT_COLOURS: Final = frozenset({"7", *map(str, range(9, 16))})
"""Numbers in COLORFGBG of a terminal's bright colours."""
_TMUX_PATIENCE: Final = 2.0
"""Seconds to wait for tmux, in a separate thread."""


@dataclass(frozen=True, slots=True)
class TerminalLimits:
    """Limits of a terminal: its colours, and signs beyond ASCII."""

    colours: Literal["all", "few", "none"] = "all"
    ascii_only: bool = False


def why_undrawable(environ: Mapping[str, str] = os.environ) -> str:
    """Return why this terminal cannot show drawings; empty if it can."""
    name = environ.get("TERM", "")
    if name not in _UNDRAWABLE:
        return ""
    return (
        f"this terminal cannot show drawings (TERM={name or 'unset'}): "
        "set TERM to its kind, such as xterm or linux, or use `scenario status`"
    )


def why_no_screen() -> str:
    """Return why no screen can be opened here; empty if one can.

    Screens draw on standard error and read keys from standard input; standard output is for words.
    """
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return "standard input and standard error are not one"
    return why_undrawable()


def terminal_limits(
    colour_system: str | None, environ: Mapping[str, str] = os.environ
) -> TerminalLimits:
    """Return the limits of the terminal of this process; ``colour_system`` is the one of rich."""
    return TerminalLimits(_colours(colour_system, environ), ascii_only(environ))


def light_background(environ: Mapping[str, str] = os.environ) -> bool:
    """Return True if the terminal reports by ``COLORFGBG`` that its background is light."""
    return environ.get("COLORFGBG", "").rpartition(";")[2] in _LIGHT_COLOURS


def _colours(system: str | None, environ: Mapping[str, str]) -> Literal["all", "few", "none"]:
    if environ.get("NO_COLOR"):
        return "none"
    if system in ("256", "truecolor", "windows"):
        return "all"
    return "none" if _COLOURLESS.match(environ.get("TERM", "")) else "few"


def ascii_only(environ: Mapping[str, str] = os.environ) -> bool:
    """Return True if the terminal shows ASCII only.

    ``SCENARIO_GLYPHS=ascii`` or ``unicode`` decides. The console of Linux lacks our signs.
    Elsewhere the encoding of the stream decides.
    """
    choice = environ.get("SCENARIO_GLYPHS", "")
    if choice in ("ascii", "unicode"):
        return choice == "ascii"
    # Textual draws on standard error, not on standard output.
    encoding = (sys.stderr.encoding or "").lower().replace("-", "")
    return environ.get("TERM") == "linux" or encoding != "utf8"


def copy_to_tmux(text: str, environ: Mapping[str, str] = os.environ) -> bool:
    """Put ``text`` into the buffer of the surrounding tmux, which passes it to its terminal.

    By default tmux ignores the clipboard sequence of programs inside of it. Returns True if a tmux
    took the text.
    """
    if not environ.get("TMUX") or shutil.which("tmux") is None:
        return False
    try:
        done = subprocess.run(
            ["tmux", "load-buffer", "-w", "-"],
            input=text.encode(),
            capture_output=True,
            check=False,
            timeout=_TMUX_PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0
