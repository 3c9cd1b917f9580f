"""What other programs printed, fit for a terminal: whole lines without control sequences."""

from __future__ import annotations

from typing import Final

from grammars.text.terminal_text import printable, without_escapes

SHOWN_LINES: Final = 40
"""Lines of an output that are shown unless more is asked for: the last ones."""


def printed_lines(text: str) -> list[str]:
    """Return the lines of an output as a terminal would have left them, without colours.

    A line that was written over, as progress bars do, is what it was last.
    """
    plain = without_escapes(text).replace("\r\n", "\n")
    lines = [line.rstrip("\r").rpartition("\r")[2] for line in plain.split("\n")]
    while lines and not lines[-1].strip():
        lines.pop()
    return [printable(line.expandtabs()) for line in lines]


def last_lines(text: str, most: int | None = SHOWN_LINES) -> tuple[list[str], int]:
    """Return the last lines of an output, all without ``most``, and how many there are before."""
    lines = printed_lines(text)
    hidden = 0 if most is None else max(0, len(lines) - most)
    return lines[hidden:], hidden
