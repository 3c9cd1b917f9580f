"""A picture of a single run: the map, the way driven, what was believed, contacts, violations."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.analysis.report._formatting import count_noun, format_quantity
from daemon.analysis.report._safety_buffer import safety_buffer
from daemon.analysis.report._tracks import extract_tracks, unbroken_runs
from daemon.judging import oracles
from daemon.judging.oracles import SignalSampler
from daemon.trace import PoseTrack, Trace, read_trace
from grammars.model.geometry import Point2
from templates.picture import RunOverlay, draw_world, write_png
from templates.rendering import Templates
from templates.world import ArtefactWorld, BehaviourDraw

_POINTS: Final = 2000


def draw_run(trace_path: Path, picture: Path) -> None:
    """Draw the run of a trace as ``.svg`` or ``.png``, by the ending of ``picture``.

    Raises :class:`daemon.trace.TraceError` for what is no usable trace.
    """
    trace = read_trace(trace_path)
    spec = trace.spec
    world = ArtefactWorld(
        name=spec.label,
        scene=trace.scene,
        mission=spec.mission,
        robot=spec.robot,
        draws=(BehaviourDraw("", spec.behaviours),),
        resolution=spec.map.resolution,
    )
    figure = draw_world(world, _run(trace))
    if picture.suffix == ".png":
        write_png(figure, picture)
        return
    svg = Templates().render("picture.svg.j2", figure=figure)
    picture.write_text(svg, encoding="utf-8")


def _run(trace: Trace) -> RunOverlay:
    # Signals of a trace with leaps or NaNs would be judged and drawn as if they were true.
    problems = oracles.trace_problems(trace)
    if problems:
        way = _line(trace.ground_truth.x, trace.ground_truth.y)
        return RunOverlay(way, about=f"not to be trusted: {'; '.join(problems)}")
    sampler = SignalSampler(trace)
    oracles.warm_up()
    buffer = safety_buffer(oracle.text for oracle in trace.spec.oracles)
    found = extract_tracks(trace.spec.label, trace, sampler, buffer, (), _POINTS)
    verdicts = oracles.judge(trace, trace.spec.oracles, sampler=sampler)
    outcome = oracles.overall_outcome(trace, verdicts)
    parts = [
        f"{outcome}",
        f"campaign {trace.spec.campaign}",
        f"ended after {format_quantity(found.measures.get('duration'), 's')}",
        f"nearest {format_quantity(found.measures.get('min clearance'), 'm')}",
        f"{format_quantity(found.measures.get('time in buffer'), 's')} in the buffer",
        count_noun(len(found.contacts), "contact"),
    ]
    return RunOverlay(
        way=_line(found.x, found.y),
        believed=_believed(trace.estimate),
        close=_pieces(found.x, found.y, found.clearance < found.limit),
        contacts=tuple((x, y) for _, _, x, y in found.contacts),
        about="  ·  ".join(parts),
    )


def _believed(estimate: PoseTrack) -> tuple[Point2, ...]:
    step = max(1, len(estimate.time) // _POINTS)
    return _line(estimate.x[::step], estimate.y[::step])


def _line(x: npt.NDArray[np.floating], y: npt.NDArray[np.floating]) -> tuple[Point2, ...]:
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def _pieces(
    x: npt.NDArray[np.floating], y: npt.NDArray[np.floating], held: npt.NDArray[np.bool_]
) -> tuple[tuple[Point2, ...], ...]:
    """Return the unbroken pieces of a way where ``held``."""
    ends = zip(*unbroken_runs(held), strict=True)
    return tuple(_line(x[a : b + 1], y[a : b + 1]) for a, b in ends)
