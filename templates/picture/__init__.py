"""Picture of a world for people: plan, doors at their angles, waypoints, the robot, its paths.

A drawing becomes a file (SVG, PNG, PDF) or an element of a page, whose style sheet colours it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from markupsafe import Markup

from templates.picture._compose import draw_world
from templates.picture._drawing import Colour, Drawing, Shape
from templates.picture._page import LARGE, MOMENT, SMALL
from templates.picture._run import DrivenWay, RunOverlay
from templates.rendering import number, render
from templates.world import ExportJob

PNG_SCALE: Final = 1.5
"""Pixels of the PNG per unit of the page."""
_FACES: Final = Path(__file__).parent / "face"
_PAINTED_FAMILY: Final = "'Scenario Sans', sans-serif"
"""Family of the faces in that folder: fonts of the machine would change the picture."""
_FAMILY: Final = "'Helvetica Neue', Helvetica, Arial, 'DejaVu Sans', sans-serif"


def write_drawing(figure: Drawing, path: Path) -> Path:
    """Write a drawing as ``.svg``, ``.png`` or ``.pdf``, by the ending of ``path``.

    A PNG is :data:`PNG_SCALE` times as large as the page. The order of parts in a PDF varies.
    """
    if path.suffix == ".svg":
        path.write_text(picture_svg(figure), encoding="utf-8", newline="\n")
        return path
    # Loading it takes a third of a second; commands without a picture save this time.
    import vl_convert

    vl_convert.register_font_directory(str(_FACES))
    svg = picture_svg(figure, _PAINTED_FAMILY)
    if path.suffix == ".png":
        path.write_bytes(vl_convert.svg_to_png(svg, scale=PNG_SCALE))
    else:
        path.write_bytes(vl_convert.svg_to_pdf(svg))
    return path


def picture_svg(figure: Drawing, family: str = _FAMILY) -> str:
    """Return the text of a drawing's SVG file, with texts in a font ``family``."""
    return render(
        "picture.svg.j2", figure=figure, family=family, paper=Colour.PAPER, colour=str, path=_path
    )


def write_picture(job: ExportJob) -> tuple[Path, ...]:
    """Write ``<world>.svg`` and ``<world>.png``."""
    figure = draw_world(job.world)
    endings = ("svg", "png")
    return tuple(write_drawing(figure, job.path(f"{job.name}.{ending}")) for ending in endings)


def page_svg(figure: Drawing, label: str) -> Markup:
    """Return a drawing as an element of a page, with the colours of its style sheet.

    Screen readers read ``label``.
    """
    svg = render("map.svg.j2", figure=figure, label=label, colour=_page_colour, path=_path)
    return Markup(svg)


def _page_colour(colour: Colour) -> str:
    return f"var(--map-{colour.name.lower()},{colour})"


def _path(shape: Shape) -> str:
    """Return the data of a path, in tenths of a unit."""
    end = "" if shape.open else "Z"
    return "".join(
        f"M{' '.join(number(value, 1) for point in ring for value in point)}{end}"
        for ring in shape.rings
    )
