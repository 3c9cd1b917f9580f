"""A picture of a single run: the map, the way driven, what was believed, contacts, violations."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from daemon.analysis.report._page_drawing import DrawingWindow, drawing_svg
from daemon.analysis.report._recorded import sampled_trace
from daemon.analysis.report._safety_buffer import buffer_of_run
from daemon.analysis.report._tracks import RunTracks, extract_tracks, unbroken_runs
from daemon.judging import oracles
from daemon.judging.oracles import SignalSampler
from daemon.trace import MotionTrack, PoseTrack, Trace, TraceError, read_trace
from grammars.model.geometry import Point2, Pose2
from grammars.text.words import count_noun, format_quantity
from templates.picture import FOOT, HEAD, MARGIN, Drawing, RunOverlay, draw_world, write_png
from templates.rendering import render
from templates.world import ArtefactWorld, BehaviourDraw

_POINTS: Final = 2000
_APART: Final = 1.5
_FOOTPRINTS: Final = 24
"""Seconds from one footprint to the next, where that are not more of them."""
_BEFORE: Final = 7.0
"""Seconds of a run that lead to a moment."""
_AFTER: Final = 0.2
"""What decides may be recorded so long [s] after the sample that is judged."""
_AT_LEAST: Final = 1.0
"""Seconds that are shown of a moment at the very start."""
_MOMENT_WIDTH: Final = 620.0
"""Width of a moment's page, on which words are as large as those around it."""
_ON_PAPER: Final = frozenset({"margins", "heading", "legend", "key", "scale", "axes"})
"""Groups of a drawing that are about, or beyond, the part of the map that it shows."""


def draw_run(
    trace_path: Path, picture: Path, *, since: float | None = None, until: float | None = None
) -> None:
    """Draw the run of a trace as ``.svg`` or ``.png``, by the ending of ``picture``.

    With ``since`` or ``until`` [s] only that part of the run, with its surroundings closely.
    Raises :class:`daemon.trace.TraceError` for what is no usable trace, and ``ValueError`` for a
    part that lies outside of the run.
    """
    trace = read_trace(trace_path)
    part = None if since is None and until is None else _part(trace, since, until)
    figure = draw_world(_world(trace), _run(trace, part))
    if picture.suffix == ".png":
        write_png(figure, picture)
        return
    svg = render("picture.svg.j2", figure=figure)
    picture.write_text(svg, encoding="utf-8")


def draw_moment(trace_path: Path, time: float) -> MomentPicture | None:
    """Return the seconds of a run before ``time`` [s], doors and robot as they are at that moment.

    ``None`` if the trace cannot be read any more, or not be trusted.
    """
    try:
        sampler = sampled_trace(trace_path)
    except TraceError:
        return None
    trace, stamps = sampler.trace, sampler.trace.ground_truth.time
    if len(stamps) < 2 or oracles.trace_problems(trace):
        return None
    first, last = float(stamps[0]), float(stamps[-1])
    until = min(max(time + _AFTER, first + _AT_LEAST), last)
    part = _part(trace, max(min(time, last) - _BEFORE, first), until)
    overlay = _overlay(sampler, _tracks(sampler, part), part)
    return MomentPicture(draw_world(_world(trace), overlay, width=_MOMENT_WIDTH))


@dataclass(frozen=True, slots=True)
class MomentPicture:
    """The surroundings of a robot at a moment, to stand inside of a page."""

    drawing: Drawing

    def svg(self, name: str, label: str) -> str:
        """Return an ``<svg>`` element; it has no identifiers that ``name`` would keep apart."""
        wide, high = self.drawing.width - 2 * MARGIN, self.drawing.height - HEAD - FOOT
        window = DrawingWindow(MARGIN, HEAD, wide, high)
        return drawing_svg(self.drawing, window, label, omitted=_ON_PAPER)


def _world(trace: Trace) -> ArtefactWorld:
    spec = trace.spec
    return ArtefactWorld(
        name=spec.label,
        scene=trace.scene,
        mission=spec.mission,
        robot=spec.robot,
        draws=(BehaviourDraw("", spec.behaviours),),
        resolution=spec.map.resolution,
    )


@dataclass(frozen=True, slots=True)
class _RunPart:
    """From ``since`` to ``until`` [s] of a run."""

    since: float
    until: float

    def of(self, time: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
        return (time >= self.since) & (time <= self.until)


def _part(trace: Trace, since: float | None, until: float | None) -> _RunPart:
    time = trace.ground_truth.time
    if not len(time):
        raise ValueError("nothing was recorded")
    first, last = float(time[0]), float(time[-1])
    part = _RunPart(first if since is None else since, last if until is None else until)
    if np.count_nonzero(part.of(time)) < 2:
        raise ValueError(
            f"{part.since:g} s to {part.until:g} s is no part of a run that goes from {first:g} s "
            f"to {last:g} s"
        )
    return part


def _run(trace: Trace, part: _RunPart | None) -> RunOverlay:
    # Signals of a trace with leaps or NaNs would be judged and drawn as if they were true.
    problems = oracles.trace_problems(trace)
    if problems:
        way = _line(trace.ground_truth.x, trace.ground_truth.y)
        return RunOverlay(way, about=f"not to be trusted: {'; '.join(problems)}")
    sampler = SignalSampler(trace)
    oracles.warm_up()
    found = _tracks(sampler, part)
    overlay = _overlay(sampler, found, part)
    return replace(overlay, about=_about(sampler, found, part, len(overlay.contacts)))


def _tracks(sampler: SignalSampler, part: _RunPart | None) -> RunTracks:
    trace = sampler.trace
    # Of a part every sample counts: what is looked at may be a few centimetres.
    points = _POINTS if part is None else 3 * len(sampler.time_base.time)
    return extract_tracks(trace.spec.label, trace, sampler, buffer_of_run(trace.spec), (), points)


def _about(sampler: SignalSampler, found: RunTracks, part: _RunPart | None, contacts: int) -> str:
    """Return what the heading of a picture says of a run, or of a part of it."""
    trace, buffer = sampler.trace, buffer_of_run(sampler.trace.spec)
    verdicts = oracles.judge(trace, trace.spec.oracles, sampler=sampler)
    outcome = str(oracles.overall_outcome(trace, verdicts))
    touched = count_noun(contacts, "contact")
    if part is None:
        parts = [
            outcome,
            f"campaign {trace.spec.campaign}",
            f"ended after {format_quantity(found.measures.get('duration'), 's')}",
            f"nearest {format_quantity(found.measures.get('min clearance'), 'm')}",
            f"{format_quantity(found.measures.get('time in buffer'), 's')} in the buffer of "
            f"{buffer.size}",
            touched,
        ]
    else:
        nearest = float(np.nanmin(found.clearance[part.of(found.time)]))
        parts = [
            outcome,
            f"{part.since:.1f} s to {part.until:.1f} s of {found.measures['duration']:.1f} s",
            f"nearest {format_quantity(nearest, 'm')}",
            touched,
        ]
    return "  ·  ".join(parts)


def _overlay(sampler: SignalSampler, found: RunTracks, part: _RunPart | None) -> RunOverlay:
    trace = sampler.trace
    shown = np.ones(len(found.time), np.bool_) if part is None else part.of(found.time)
    contacts = [c for c in found.contacts if part is None or part.since <= c[0] <= part.until]
    overlay = RunOverlay(
        way=_line(found.x[shown], found.y[shown]),
        believed=_believed(trace.estimate, part),
        close=_pieces(found.x, found.y, (found.clearance < found.limit) & shown),
        contacts=tuple((x, y) for _, _, x, y in contacts),
        footprints=(_pose(trace.ground_truth, math.inf).apply_ring(trace.spec.robot.footprint),),
    )
    return overlay if part is None else replace(overlay, **_closely(trace, part))


def _closely(trace: Trace, part: _RunPart) -> dict[str, Any]:
    """Return what a picture of a part of a run shows besides."""
    truth = trace.ground_truth
    steps = min(_FOOTPRINTS, max(2, round((part.until - part.since) / _APART)))
    moments = np.linspace(part.since, min(part.until, float(truth.time[-1])), steps)
    footprint = trace.spec.robot.footprint
    poses = [_pose(truth, moment) for moment in moments.tolist()]
    joints = trace.joints
    at_end = {
        name: float(np.interp(part.until, joints.time, joints.position[:, index]))
        for index, name in enumerate(joints.names)
        if len(joints.time)
    }
    return {
        "footprints": tuple(pose.apply_ring(footprint) for pose in poses),
        "apparent_goals": _apparent_goals(trace, part),
        "positions": at_end,
        "closely": True,
    }


def _apparent_goals(trace: Trace, part: _RunPart) -> tuple[Point2, ...]:
    """Return where the waypoint of the part's end lies for the robot, at each of its estimates.

    It knows the waypoint in the map, and where it believes to be itself: what it drives to is the
    waypoint as seen from there, which is off by the error of its localisation, turned by that of
    its heading.
    """
    current = [record.current for record in trace.progress if record.time <= part.until]
    waypoints = trace.spec.mission.waypoints
    if not current or not 0 <= current[-1] < len(waypoints):
        return ()
    goal = waypoints[current[-1]]
    estimate = trace.estimate
    chosen = np.flatnonzero(part.of(estimate.time))
    step = max(1, len(chosen) // _POINTS)
    goals = []
    for index in chosen[::step].tolist():
        believed = Pose2(*(float(v[index]) for v in (estimate.x, estimate.y, estimate.yaw)))
        seen = believed.inverse().apply((goal.x, goal.y))
        goals.append(_pose(trace.ground_truth, float(estimate.time[index])).apply(seen))
    return tuple(goals)


def _pose(track: MotionTrack, time: float) -> Pose2:
    """Return the last recorded true pose at or before a moment."""
    index = max(int(np.searchsorted(track.time, time, side="right")) - 1, 0)
    return Pose2(float(track.x[index]), float(track.y[index]), float(track.yaw[index]))


def _believed(estimate: PoseTrack, part: _RunPart | None) -> tuple[Point2, ...]:
    time = estimate.time
    chosen = np.arange(len(time)) if part is None else np.flatnonzero(part.of(time))
    kept = chosen[:: max(1, len(chosen) // _POINTS)]
    return _line(estimate.x[kept], estimate.y[kept])


def _line(x: npt.NDArray[np.floating], y: npt.NDArray[np.floating]) -> tuple[Point2, ...]:
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def _pieces(
    x: npt.NDArray[np.floating], y: npt.NDArray[np.floating], held: npt.NDArray[np.bool_]
) -> tuple[tuple[Point2, ...], ...]:
    """Return the unbroken pieces of a way where ``held``."""
    ends = zip(*unbroken_runs(held), strict=True)
    return tuple(_line(x[a : b + 1], y[a : b + 1]) for a, b in ends)
