"""Filter for untrusted text on its way to a terminal: control characters are shown, not obeyed.

Names, logs, traces and answers of daemons may hold escape sequences that rename windows, move the
cursor or type answers. They may also hold characters that reverse the direction of text and so
mislead readers (CVE-2021-42574). Streams, consoles and the dashboard filter all their output here.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TextIO, cast

# Category Cc without tab and line ends, Cs, Zl, Zp, noncharacters, and those invisible characters
# (Default_Ignorable_Code_Point) that steer: marks of direction, tags, invisible operators. Allowed:
# joiners (emoji, Persian), variation selectors, soft hyphens.
_STEERING: Final = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f"
    "\ud800-\udfff\ufdd0-\ufdef\ufeff\ufff0-\ufffb\ufffe\uffff\U0001bca0-\U0001bca3"
    "\U0001d173-\U0001d17a\U000e0000-\U000e00ff\U000e01f0-\U000e0fff]"
    "|\r(?!\n)"
)
# ECMA-48: control sequences, operating system commands, and other escapes.
_ESCAPES: Final = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]"
    r"|(?:\x1b[\]PX^_]|[\x90\x98\x9d-\x9f])[^\x07\x1b\x9c]*(?:\x07|\x1b\\|\x9c)"
    r"|\x1b[ -~]"
)
_REPLACEMENT: Final = "\N{REPLACEMENT CHARACTER}"


def printable(text: str) -> str:
    """Return ``text`` in its length, with U+FFFD for each character that steers a terminal.

    Tabs and line ends (``\\n``, ``\\r\\n``) stay.
    """
    return text if text.isprintable() else _STEERING.sub(_REPLACEMENT, text)


def spell_out(text: str) -> str:
    """Return ``text`` with an escape such as ``\\x1b`` for each character that steers a terminal.

    Messages about files name the character this way; text in columns uses :func:`printable`.
    """
    return text if text.isprintable() else _STEERING.sub(_spelling, text)


def _spelling(match: re.Match[str]) -> str:
    return ascii(match[0])[1:-1]


def without_escapes(text: str) -> str:
    """Return output of a program without escape sequences for colours, titles and the like.

    It removes complete sequences only: the result still has to be made :func:`printable`.
    """
    return _ESCAPES.sub("", text)


def escape_json(document: str) -> str:
    """Return a JSON document with ``\\uXXXX`` for each character that steers a terminal."""
    # Outside of strings, JSON has none of them except tabs and line ends, which stay.
    return _STEERING.sub(_json_escape, document)


def _json_escape(match: re.Match[str]) -> str:
    units = match[0].encode("utf-16-be", "surrogatepass")
    pairs = (units[at : at + 2] for at in range(0, len(units), 2))
    return "".join(f"\\u{int.from_bytes(pair, 'big'):04x}" for pair in pairs)


class PrintableStream:
    """A wrapper of a text stream that writes :func:`printable` text.

    ``unfiltered`` is the stream itself, for code that writes its own escape sequences.
    """

    def __init__(self, stream: TextIO) -> None:
        self.unfiltered = stream

    def write(self, text: str) -> int:
        """Write text; return its number of characters."""
        self.unfiltered.write(printable(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write the texts in order."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unfiltered, name)


def unfiltered(stream: TextIO) -> TextIO:
    """Return the stream behind a :class:`PrintableStream`, and any other stream unchanged."""
    return stream.unfiltered if isinstance(stream, PrintableStream) else stream


@contextmanager
def printable_streams() -> Iterator[None]:
    """Filter standard output and error of this process during the block."""
    previous = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = ours = _filtered(previous[0]), _filtered(previous[1])
    try:
        yield
    finally:
        # A generator may end late: keep streams that other code has set since.
        if sys.stdout is ours[0]:
            sys.stdout = previous[0]
        if sys.stderr is ours[1]:
            sys.stderr = previous[1]


def _filtered(stream: TextIO) -> TextIO:
    return cast(TextIO, PrintableStream(unfiltered(stream)))
