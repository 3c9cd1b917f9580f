"""ASCII for terminals and streams that lack our signs; a minus never becomes a question mark."""

from __future__ import annotations

import unicodedata
from functools import lru_cache
from typing import Final

from rich.cells import cell_len
from rich.text import Text

_BRAILLE: Final = range(0x2800, 0x2900)
_DENSITY: Final = " ..::::##"
"""A sign for each number of dots in a braille cell."""
# One character for each: more would shift the rest of the line.
_SIGNS: Final = str.maketrans(
    "✓✗‼∅…▶▸›»‖◆◇✱●○■□•·–—−∞×°±µσΔ≤≥≠’‘“”⌫⏎↵⇥←→↑↓↗↖↙↘▲▼△▽◀▪╱",
    "+xEL~>>>>=*oX@o#o*.---Ixo+usD<>#''\"\"<&&><>^v/\\/\\^v^v<#/",
)
_LINES: Final = {
    **dict.fromkeys(map(ord, "─━╌╍┄┅┈┉═╴╶╸╺"), "-"),
    **dict.fromkeys(map(ord, "│┃╎╏┆┇┊┋║╵╷╹╻"), "|"),
}
_BLOCKS: Final = {
    **dict.fromkeys(map(ord, "▁▂▃"), "_"),
    **dict.fromkeys(map(ord, "▀▔"), '"'),
    **dict.fromkeys(map(ord, "▏▎▍▕▐▌"), "|"),
}
_REST: Final = {
    **dict.fromkeys(range(0x2500, 0x2580), "+"),
    **dict.fromkeys(range(0x2580, 0x25A0), "#"),
    **{code: _DENSITY[(code - _BRAILLE.start).bit_count()] for code in _BRAILLE},
}
_TABLE: Final[dict[int, str | int]] = {**_REST, **_LINES, **_BLOCKS, **_SIGNS}
_WIDE: Final = {"‼": "!!", "∞": "inf", "→": "->", "°": " deg"}
"""Replacements that may take more room than one cell, because they read better."""


@lru_cache(maxsize=4096)
def to_ascii(text: str) -> str:
    """Return a text in ASCII that takes as many cells: similar signs, ``?`` for the rest."""
    return "".join(map(_ascii_character, text.translate(_TABLE)))


def text_in_ascii(text: Text) -> Text:
    """Return a text with its styles in ASCII, as :func:`to_ascii`."""
    copy = text.copy()
    copy.plain = to_ascii(text.plain)
    return copy


def _ascii_character(character: str) -> str:
    if character.isascii():
        return character
    # Letters lose their accents. A sign that would take more cells than before becomes "?".
    width = cell_len(character)
    letters = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return letters if len(letters) == width else "?" * width


def spell_in_ascii(text: str) -> str:
    """Return a text in ASCII that may be longer than it was."""
    return "".join(_WIDE.get(sign) or to_ascii(sign) for sign in text)
