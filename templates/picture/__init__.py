"""A picture of a world for people: plan, doors at their angles, waypoints, the robot at its start.

One drawing, two files: SVG through a template, PNG for where no SVG goes.
"""

from __future__ import annotations

from pathlib import Path

from grammars.text.plugins import MissingExtraError
from templates.picture._compose import draw_world
from templates.picture._drawing import Disc, Drawing, DrawingItem, Shape
from templates.picture._mission import RunOverlay
from templates.picture._page import FOOT, HEAD, MARGIN
from templates.picture._png import PNG_SCALE, write_png
from templates.rendering import render
from templates.world import ExportJob

__all__ = [
    "FOOT",
    "HEAD",
    "MARGIN",
    "PNG_SCALE",
    "Disc",
    "Drawing",
    "DrawingItem",
    "RunOverlay",
    "Shape",
    "draw_world",
    "write_picture",
    "write_png",
]


def write_picture(job: ExportJob) -> tuple[Path, ...]:
    """Write ``<world>.svg`` and, where its libraries are, ``<world>.png``."""
    figure = draw_world(job.world)
    svg = render("picture.svg.j2", figure=figure)
    path = job.write(job.path(f"{job.name}.svg"), svg)
    try:
        return path, write_png(figure, job.path(f"{job.name}.png"))
    except MissingExtraError as error:
        job.notes += (f"{d.message}; {d.hint}" for d in error.diagnostics)
        return (path,)
