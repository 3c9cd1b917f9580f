"""What other programs printed, fit for a terminal: whole lines without control sequences."""

from __future__ import annotations

import re
from typing import Final

SHOWN_LINES: Final = 40
"""Lines of an output that are shown unless more is asked for: the last ones."""

# ECMA-48: control sequences, strings of the operating system's commands, and other escapes.
_ESCAPES: Final = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\)|[ -~])")


def printed_lines(text: str) -> list[str]:
    """Return the lines of an output as a terminal would have left them, without colours.

    A line that was written over, as progress bars do, is what it was last.
    """
    plain = _ESCAPES.sub("", text).replace("\r\n", "\n")
    lines = [line.rstrip("\r").rpartition("\r")[2] for line in plain.split("\n")]
    while lines and not lines[-1].strip():
        lines.pop()
    return [printable_line(line.expandtabs()) for line in lines]


def last_lines(text: str, most: int | None = SHOWN_LINES) -> tuple[list[str], int]:
    """Return the last lines of an output, all without ``most``, and how many there are before."""
    lines = printed_lines(text)
    hidden = 0 if most is None else max(0, len(lines) - most)
    return lines[hidden:], hidden


def printable_line(line: str) -> str:
    """Return a line with a replacement character for each sign that is not printed."""
    # What is left of control characters would move the cursor or ring; some turn text around.
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in line)
