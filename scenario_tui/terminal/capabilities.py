"""What the terminal can do, found out before anything is drawn: colours, UTF-8, clipboard."""

from __future__ import annotations

import os
import re
import select
import shutil
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

_PATIENCE: Final = 0.5
"""Seconds a terminal or tmux gets to answer: some never do, and the first screen waits for it."""
_CURSOR_REPORT: Final = re.compile(rb"\x1b\[\d+;(\d+)R")
# As terminfo names them: DEC's terminals, and monochrome variants of others.
_COLOURLESS: Final = re.compile(r"vt\d|.*-m(ono)?$")
_UNDRAWABLE: Final = ("", "dumb", "unknown")
_TMUX_PATIENCE: Final = 2.0
"""Seconds; in a thread of its own, so that nobody waits."""
# Terminals that draw sextants themselves, whatever their font has: by TERM and by TERM_PROGRAM.
_DRAW_SEXTANTS: Final = re.compile(r"xterm-kitty|xterm-ghostty|foot(-.*)?|contour(-.*)?|wezterm")
_SEXTANT_PROGRAMS: Final = ("WezTerm", "ghostty")
_VTE_WITH_SEXTANTS: Final = 6200
"""Version of VTE (GNOME's terminals) that draws them, as it says itself: 0.62.0."""

Blocks: TypeAlias = Literal["cells", "quadrants", "sextants"]
"""What areas are filled with: whole cells, quarters of cells, or sixths."""


@dataclass(frozen=True, slots=True)
class TerminalLimits:
    """How few colours there are, whether only ASCII can be shown, what areas are filled with."""

    colours: Literal["all", "few", "none"] = "all"
    ascii_only: bool = False
    blocks: Blocks = "quadrants"


def why_undrawable(environ: Mapping[str, str] = os.environ) -> str:
    """Say why nothing can be drawn on this terminal, empty when it can."""
    name = environ.get("TERM", "")
    if name not in _UNDRAWABLE:
        return ""
    return (
        f"this terminal says that it cannot be drawn on (TERM={name or 'unset'}): "
        "set TERM to what it is, xterm or linux say, or read `scenario status`"
    )


def terminal_limits(
    colour_system: str | None, environ: Mapping[str, str] = os.environ
) -> TerminalLimits:
    """Find out about the terminal of this process; ``colour_system`` is what rich thinks of it."""
    colours = _colours(colour_system, environ)
    return TerminalLimits(colours, ascii_only(environ), area_blocks(environ))


def area_blocks(environ: Mapping[str, str]) -> Blocks:
    """Return what areas are filled with on a terminal that has more than ASCII.

    ``SCENARIO_GLYPHS=sextants`` or ``quadrants`` settles it. Sextants are of 2020, and most fonts
    have none: they are used only where the terminal is known to draw them by itself.
    """
    chosen = environ.get("SCENARIO_GLYPHS", "")
    if chosen == "sextants":
        return "sextants"
    if chosen == "quadrants":
        return "quadrants"
    # What is shown inside of tmux or screen goes to a terminal that may be another tomorrow.
    if environ.get("TMUX") or environ.get("STY"):
        return "quadrants"
    version = environ.get("VTE_VERSION", "")
    known = (
        _DRAW_SEXTANTS.fullmatch(environ.get("TERM", "")) is not None
        or environ.get("TERM_PROGRAM", "") in _SEXTANT_PROGRAMS
        or (version.isdecimal() and int(version) >= _VTE_WITH_SEXTANTS)
    )
    return "sextants" if known else "quadrants"


def _colours(system: str | None, environ: Mapping[str, str]) -> Literal["all", "few", "none"]:
    if environ.get("NO_COLOR"):
        return "none"
    if system in ("256", "truecolor", "windows"):
        return "all"
    return "none" if _COLOURLESS.match(environ.get("TERM", "")) else "few"


def ascii_only(
    environ: Mapping[str, str] = os.environ, ask: Callable[[], bool] | None = None
) -> bool:
    """Whether nothing but ASCII can be shown.

    ``SCENARIO_GLYPHS=ascii`` or ``unicode`` (or what :func:`area_blocks` takes) settles it, then
    the locale. A locale that says nothing of characters (``C``, as in many containers) settles
    nothing: the terminal is asked.
    """
    chosen = environ.get("SCENARIO_GLYPHS", "")
    if chosen in ("ascii", "unicode", "quadrants", "sextants"):
        return chosen == "ascii"
    # Textual draws on standard error, not on standard output.
    if (sys.stderr.encoding or "").lower().replace("-", "") != "utf8":
        return True
    if not sys.flags.utf8_mode or environ.get("PYTHONUTF8") == "1":
        return False
    # Python takes UTF-8 where the locale says nothing: only the names tell what people meant.
    _, dot, charset = (environ.get("LC_ALL") or environ.get("LANG") or "").partition(".")
    if dot:
        return charset.lower().replace("-", "") != "utf8"
    knows = ask or (_tmux_takes_utf8 if environ.get("TMUX") else terminal_takes_utf8)
    return not knows()


def _tmux_takes_utf8() -> bool:
    """Whether what tmux is shown on takes UTF-8; else it would draw underscores."""
    command = ["tmux", "display-message", "-p", "#{client_utf8}"]
    try:
        said = subprocess.run(command, capture_output=True, timeout=_PATIENCE, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return said.stdout.strip() == b"1"


def terminal_takes_utf8(reading: int = 0, writing: int = 2) -> bool:
    """Ask the terminal whether it takes UTF-8: write a sign of three bytes, ask how far it got."""
    before = termios.tcgetattr(reading)
    try:
        tty.setcbreak(reading)
        os.write(writing, "\r✓\x1b[6n".encode())
        said = _CURSOR_REPORT.search(_answer(reading))
        os.write(writing, b"\r   \r")
    finally:
        termios.tcsetattr(reading, termios.TCSANOW, before)
    # From the first column: one cell further in UTF-8, three where every byte is a character.
    return said is not None and int(said[1]) == 2


def _answer(reading: int) -> bytes:
    """Return what the terminal says until it has said where it is, or nothing more comes."""
    deadline, said = time.monotonic() + _PATIENCE, b""
    while not _CURSOR_REPORT.search(said):
        ready, _, _ = select.select([reading], [], [], max(0.0, deadline - time.monotonic()))
        if not ready:
            break
        said += os.read(reading, 256)
    return said


def copy_to_tmux(text: str, environ: Mapping[str, str] = os.environ) -> bool:
    """Put ``text`` into the buffer of the tmux around us, which passes it on to its terminal.

    As it comes, tmux ignores programs inside of it that ask for that themselves. Returns whether
    there was a tmux that took it.
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
