"""A layout for Foxglove that shows the traces of a world: file > import layout, open a trace."""

from __future__ import annotations

import json
from pathlib import Path

from grammars.diagnostics import Diagnostic, InputError, Where
from templates.world import Job


def write_layout(job: Job) -> tuple[Path, ...]:
    """Write ``<world>.foxglove.json``: top view, localisation, speed, joints, events."""
    scene = job.world.scene
    corners = [corner for region in scene.regions for corner in region.outline]
    corners = corners or [corner for solid in scene.solids for corner in solid.polygon]
    xs, ys = [c[0] for c in corners] or [0.0], [c[1] for c in corners] or [0.0]
    text = job.templates.render(
        "foxglove.json.j2",
        centre=((min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0),
        extent=max(max(xs) - min(xs), max(ys) - min(ys), 1.0),
        joints=list(scene.joint_names),
        colours=_COLOURS,
    )
    try:
        layout = json.loads(text)
    except ValueError as error:
        message = f"the layout is no JSON: {error}"
        raise InputError(Diagnostic(Where("foxglove.json.j2"), message)) from error
    path = job.path(f"{job.name}.foxglove.json")
    return (job.write(path, json.dumps(layout, ensure_ascii=False, indent=1) + "\n"),)


_COLOURS = (
    "#4e79a7", "#f28e2b", "#e15759", "#76b7b2", "#59a14f", "#edc948", "#b07aa1", "#ff9da7",
    "#9c755f", "#bab0ac",
)  # fmt: skip
