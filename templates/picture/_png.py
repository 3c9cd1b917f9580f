"""A drawing painted as PNG."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from grammars.text.plugins import load_extra
from templates.picture._drawing import Drawing
from templates.rendering import render

PNG_SCALE: Final = 1.5
"""Pixels of the PNG in a unit of the page."""
_FACES: Final = Path(__file__).parent / "face"
_FACE: Final = "Scenario Sans"
"""The family of the faces there, and of nobody else's."""
_FAMILY: Final = re.compile('font-family="[^"]*"')
_BEYOND: Final = 0x2E80
"""From this character on (the first of the Chinese ones) our faces have none."""


def write_png(figure: Drawing, path: Path) -> Path:
    """Write the figure, :data:`PNG_SCALE` times as large as its page, and return the path.

    Raises :class:`grammars.text.plugins.MissingExtraError` without the extra ``png``.
    """
    resvg = load_extra("resvg_py", "png", "a PNG picture", "picture")
    svg = render("picture.svg.j2", figure=figure)
    image = resvg.svg_to_bytes(
        svg_string=_FAMILY.sub(f'font-family="{_FACE}"', svg, count=1),
        zoom=PNG_SCALE,
        # Our own faces: resvg leaves out every text without a word when it finds no font, and with
        # those of the machine no two would draw the same picture. Only for letters that ours do
        # not have (a name in Chinese) whatever there is has to do.
        skip_system_fonts=max(map(ord, svg)) < _BEYOND,
        font_files=[str(face) for face in sorted(_FACES.glob("*.ttf"))],
        font_family=_FACE,
        sans_serif_family=_FACE,
    )
    path.write_bytes(image)
    return path
