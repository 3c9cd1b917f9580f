"""Text of others on its way to a terminal: what would steer it is shown, not obeyed.

Names, logs, traces and answers of daemons may hold escape sequences, which rename windows, move the
cursor and answer in our name, and signs that turn text around, so that a line reads as something
else (CVE-2021-42574). One function says what is replaced; streams, consoles and the dashboard use
it on all they write, whatever it comes from.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TextIO, cast

# Category Cc without tab and line ends, Cs, Zl, Zp, noncharacters, and what Unicode lets programs
# draw as nothing (Default_Ignorable_Code_Point) as far as it steers: marks of direction, tags,
# invisible operators. Stay: joiners (emoji, Persian), variation selectors, soft hyphens.
_STEERING: Final = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f"
    "\ud800-\udfff\ufdd0-\ufdef\ufeff\ufff0-\ufffb\ufffe\uffff\U0001bca0-\U0001bca3"
    "\U0001d173-\U0001d17a\U000e0000-\U000e00ff\U000e01f0-\U000e0fff]"
    "|\r(?!\n)"
)
# ECMA-48: control sequences, strings of the operating system's commands, and other escapes.
_ESCAPES: Final = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]"
    r"|(?:\x1b[\]PX^_]|[\x90\x98\x9d-\x9f])[^\x07\x1b\x9c]*(?:\x07|\x1b\\|\x9c)"
    r"|\x1b[ -~]"
)
_REPLACEMENT: Final = "\N{REPLACEMENT CHARACTER}"


def printable(text: str) -> str:
    """Return ``text``, as long as before, with U+FFFD for each sign that would steer a terminal.

    Tabs and line ends (``\\n``, ``\\r\\n``) stay.
    """
    return text if text.isprintable() else _STEERING.sub(_REPLACEMENT, text)


def spell_out(text: str) -> str:
    """Return ``text`` with ``\\x1b`` for each sign that would steer a terminal.

    It says which sign that is, for messages about a place in a file; what is laid out in columns
    is made :func:`printable`.
    """
    return text if text.isprintable() else _STEERING.sub(_spelling, text)


def _spelling(found: re.Match[str]) -> str:
    return ascii(found[0])[1:-1]


def without_escapes(text: str) -> str:
    """Return what a program printed without the colours and titles it meant for a terminal.

    Only whole sequences go: what remains is still to be made :func:`printable`.
    """
    return _ESCAPES.sub("", text)


def escape_json(document: str) -> str:
    """Return a JSON document with ``\\uXXXX`` for each sign that would steer a terminal."""
    # Outside of strings JSON has none of them, save tabs and line ends, which stay.
    return _STEERING.sub(_json_escape, document)


def _json_escape(found: re.Match[str]) -> str:
    units = found[0].encode("utf-16-be", "surrogatepass")
    pairs = (units[at : at + 2] for at in range(0, len(units), 2))
    return "".join(f"\\u{int.from_bytes(pair, 'big'):04x}" for pair in pairs)


class PrintableStream:
    """A text stream that passes on what is :func:`printable`; all else is that of the stream.

    ``unfiltered`` is the stream itself, for those who make escape sequences of their own.
    """

    def __init__(self, stream: TextIO) -> None:
        self.unfiltered = stream

    def write(self, text: str) -> int:
        """Write text; return how many characters were taken."""
        self.unfiltered.write(printable(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write one text after the other."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unfiltered, name)


def unfiltered(stream: TextIO) -> TextIO:
    """Return the stream behind a :class:`PrintableStream`, any other as it is."""
    return stream.unfiltered if isinstance(stream, PrintableStream) else stream


@contextmanager
def printable_streams() -> Iterator[None]:
    """Let nothing but printable text through standard output and error of this process."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = map(_filtered, before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _filtered(stream: TextIO) -> TextIO:
    return cast(TextIO, PrintableStream(unfiltered(stream)))
