"""A drawing as PNG: painted here, or by another process while this one goes on."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from grammars.text.extras import load_extra
from templates.picture import _painter
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
    load_extra("resvg_py", "png", "a PNG picture", "picture")
    svg = render("picture.svg.j2", figure=figure)
    arguments: dict[str, Any] = {
        "svg_string": _FAMILY.sub(f'font-family="{_FACE}"', svg, count=1),
        "zoom": PNG_SCALE,
        # Our own faces: resvg leaves out every text without a word when it finds no font, and with
        # those of the machine no two would draw the same picture. Only for letters that ours do
        # not have (a name in Chinese) whatever there is has to do.
        "skip_system_fonts": max(map(ord, svg)) < _BEYOND,
        "font_files": [str(face) for face in sorted(_FACES.glob("*.ttf"))],
        "font_family": _FACE,
        "sans_serif_family": _FACE,
    }
    order = folder / "order.json"
    order.write_text(json.dumps({"path": str(path), "arguments": arguments}), encoding="utf-8")
    return order
