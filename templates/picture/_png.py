"""The figure as PNG, for where no SVG goes: rendered by resvg from the same SVG template."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Final

from templates.picture._drawing import Drawing, DrawingGroup, TextLabel
from templates.rendering import Templates

PNG_SCALE: Final = 1.5
"""Pixels of the PNG in a unit of the page."""
_BOLD: Final = 0.7
"""Width of the line around letters that stands in for a bold face [page units]."""


def write_png(figure: Drawing, path: Path) -> Path:
    """Write the figure, :data:`PNG_SCALE` times as large as its page, and return the path."""
    import resvg_py
    from PIL import ImageFont

    font = ImageFont.load_default(16)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise RuntimeError("Pillow was built without FreeType, it brings no font")
    with tempfile.TemporaryDirectory() as folder:
        # The one face Pillow carries, and no other: resvg leaves out every text without a word
        # when it finds no font, and with those of the machine no two would draw the same picture.
        face = Path(folder) / "face.ttf"
        face.write_bytes(font.font_bytes)
        image = resvg_py.svg_to_bytes(
            Templates().render("picture.svg.j2", figure=_emboldened(figure)),
            zoom=PNG_SCALE,
            style_sheet=_style(figure),
            skip_system_fonts=True,
            font_files=[str(face)],
            sans_serif_family=font.getname()[0],
        )
    path.write_bytes(image)
    return path


def _emboldened(figure: Drawing) -> Drawing:
    """Return the figure with every bold text twice, the second in an outline of its colour.

    The face has no bold letters, and resvg makes up none. A copy lies over the halo, which a text
    can have only one of.
    """
    groups = []
    for group in figure.groups:
        items = [
            part
            for item in group.items
            for part in (
                (item, replace(item, halo=item.colour))
                if isinstance(item, TextLabel) and item.bold
                else (item,)
            )
        ]
        groups.append(DrawingGroup(group.name, tuple(items)))
    return replace(figure, groups=groups)


def _style(figure: Drawing) -> str:
    """Return the rule that makes the outlines of :func:`_emboldened` thinner than halos."""
    labels = [i for group in figure.groups for i in group.items if isinstance(i, TextLabel)]
    colours = dict.fromkeys(label.colour for label in labels if label.bold)
    return "".join(f'text[fill="{c}"][stroke="{c}"]{{stroke-width:{_BOLD}}}' for c in colours)
