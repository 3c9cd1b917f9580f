"""Signs for terminals that know ASCII only; every one takes as many cells as what it stands for."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

from rich.cells import cell_len
from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

_BRAILLE: Final = range(0x2800, 0x2900)
_DENSITY: Final = " ..::::##"
"""How the number of dots of a braille cell looks."""
_SIGNS: Final = str.maketrans(
    "✓✗‼…▶▸›»‖◆◇✱●○■□•·–—−∞×°±µσΔ≤≥≠’‘“”⌫⏎↵⇥←→↑↓↗↖↙↘▲▼△▽◀▪",
    "+xE~>>>>=*oX@o#o*.---Ixo+usD<>#''\"\"<&&><>^v/\\/\\^v^v<#",
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


class PlainGlyphs(LineFilter):
    """Shows everything in ASCII."""

    def apply(self, segments: Sequence[Segment], background: Color) -> list[Segment]:
        """Return the segments in ASCII, each as wide as before."""
        return [
            segment if segment.text.isascii() else segment._replace(text=plain(segment.text))
            for segment in segments
        ]


@lru_cache(maxsize=4096)
def plain(text: str) -> str:
    """Return a text in ASCII that takes as many cells: signs by their likes, ``?`` for the rest."""
    return "".join(map(_plain_character, text.translate(_TABLE)))


def _plain_character(character: str) -> str:
    if character.isascii():
        return character
    width = cell_len(character)
    letters = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return letters if len(letters) == width else "?" * width
