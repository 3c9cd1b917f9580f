"""The building of a campaign as a drawing that fits on a page, small and with all names."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from markupsafe import Markup

from daemon.analysis.report._data import ReportData
from daemon.analysis.report._page_drawing import DrawingWindow, drawing_svg
from daemon.trace import TraceError, read_scene, read_spec
from grammars.model.mission import Mission
from templates.picture import draw_world
from templates.world import ArtefactWorld, BehaviourDraw

_NAMES: Final = frozenset({"space names", "names", "start", "legend", "scale", "axes"})
"""Groups of a drawing that are too small to be read where it is small."""
_HEADING: Final = "heading"
_ROOM_ABOVE: Final = 80.0
"""What the heading takes, which stands on the page already."""


@dataclass(frozen=True, slots=True)
class BuildingPicture:
    """A building twice: ``small`` without words, ``large`` with them; ``about`` says what it is."""

    small: Markup
    large: Markup
    about: str


def draw_building(data: ReportData) -> BuildingPicture | None:
    """Return the building that most runs were in, as they found it; ``None`` without a trace.

    With the mission, where all runs in it have the same one.
    """
    scenes = Counter(run.tracks.scene for run in data.runs if run.tracks.scene)
    for digest, _ in scenes.most_common(1):
        traces: dict[str, Path] = {}
        for run in data.runs:
            if run.tracks.scene == digest and run.record.trace:
                traces.setdefault(run.record.scenario, Path(run.record.trace))
        try:
            return _draw(tuple(traces.values()), len(scenes))
        except TraceError:
            # Read a moment ago and gone now.
            return None
    return None


def _draw(traces: tuple[Path, ...], scenes: int) -> BuildingPicture | None:
    if not traces:
        return None
    specs = [read_spec(trace) for trace in traces]
    first, scene = specs[0], read_scene(traces[0])
    missions: set[Mission] = {spec.mission for spec in specs}
    mission = first.mission if len(missions) == 1 else None
    drawing = draw_world(
        ArtefactWorld(
            name=scene.name,
            scene=scene,
            mission=mission,
            robot=first.robot if mission else None,
            draws=(BehaviourDraw("", first.behaviours),),
        )
    )
    about = f"{scene.name}, as {first.scenario} begins"
    if mission:
        about = f"{scene.name} with the mission {mission.name}, as {first.scenario} begins"
    if scenes > 1:
        about += f"; the campaign has {scenes} such scenes"
    window = DrawingWindow(0.0, _ROOM_ABOVE, drawing.width, drawing.height - _ROOM_ABOVE)
    # Drawn here from numbers and escaped names, never taken from a file. Twice, and not the one by
    # ``use`` of the other: what makes PDF of pages does not find it there.
    small, large = (
        Markup(drawing_svg(drawing, window, about, omitted=omitted, css="plan"))
        for omitted in ({*_NAMES, _HEADING}, {_HEADING})
    )
    return BuildingPicture(small, large, about)
