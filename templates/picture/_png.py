"""A drawing as PNG: painted here, or by another process while this one goes on."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from grammars.text.extras import load_extra
from templates.picture import _painter
from templates.picture._drawing import Drawing, DrawingGroup, TextLabel
from templates.rendering import Templates

PNG_SCALE: Final = 1.5
"""Pixels of the PNG in a unit of the page."""
_BOLD: Final = 0.7
"""Width of the line around letters that stands in for a bold face [page units]."""


def write_png(figure: Drawing, path: Path) -> Path:
    """Write the figure, :data:`PNG_SCALE` times as large as its page, and return the path.

    Raises :class:`grammars.text.extras.MissingExtraError` without the extra ``png``.
    """
    with tempfile.TemporaryDirectory() as folder:
        _painter.paint(_written_order(figure, Path(folder), path))
    return path


def begin_png(figure: Drawing, path: Path) -> Callable[[], object]:
    """Begin to write the figure in another process; what is returned waits until it is there.

    It must be called, and raises :class:`RuntimeError` when nothing could be painted. Raises
    :class:`grammars.text.extras.MissingExtraError` without the extra ``png``.
    """
    # Painting takes longer than all the rest of an export, and resvg lets no thread run meanwhile.
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        order, said = _written_order(figure, folder, path), folder / "errors.txt"
        with said.open("wb") as errors:
            child = subprocess.Popen(
                [sys.executable, "-P", _painter.__file__, str(order)],
                stdin=subprocess.DEVNULL,
                stdout=errors,
                stderr=errors,
            )
        kept = stack.pop_all()

    def finish() -> None:
        with kept:
            if child.wait() != 0:
                told = said.read_text(encoding="utf-8", errors="replace").strip()
                raise RuntimeError(f"{path} could not be painted: {told}")

    return finish


def _written_order(figure: Drawing, folder: Path, path: Path) -> Path:
    """Write down in ``folder`` what resvg is told to paint; return the file that says it."""
    _, fonts = (
        load_extra(module, "png", "a PNG picture", "picture")
        for module in ("resvg_py", "PIL.ImageFont")
    )
    font = fonts.load_default(16)
    if not isinstance(font, fonts.FreeTypeFont):
        raise RuntimeError("Pillow was built without FreeType, it brings no font")
    # The one face Pillow carries, and no other: resvg leaves out every text without a word
    # when it finds no font, and with those of the machine no two would draw the same picture.
    face = folder / "face.ttf"
    face.write_bytes(font.font_bytes)
    arguments: dict[str, Any] = {
        "svg_string": Templates().render("picture.svg.j2", figure=_emboldened(figure)),
        "zoom": PNG_SCALE,
        "style_sheet": _style(figure),
        "skip_system_fonts": True,
        "font_files": [str(face)],
        "sans_serif_family": font.getname()[0],
    }
    order = folder / "order.json"
    order.write_text(json.dumps({"path": str(path), "arguments": arguments}), encoding="utf-8")
    return order


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
