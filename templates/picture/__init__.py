"""A picture of a world for people: plan, doors at their angles, waypoints, the robot at its start.

One drawing, two files: SVG through a template, PNG for where no SVG goes.
"""

from __future__ import annotations

from pathlib import Path

from templates.picture._compose import compose
from templates.picture._driven import Driven
from templates.picture._figure import Figure
from templates.picture._png import write_png
from templates.world import Job

__all__ = ["Driven", "Figure", "compose", "write_picture", "write_png"]


def write_picture(job: Job) -> tuple[Path, ...]:
    """Write ``<world>.svg`` and ``<world>.png``."""
    figure = compose(job.world)
    svg = job.templates.render("picture.svg.j2", figure=figure)
    path = job.write(job.path(f"{job.name}.svg"), svg)
    return path, write_png(figure, job.path(f"{job.name}.png"))
