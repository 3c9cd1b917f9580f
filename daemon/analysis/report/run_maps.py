"""Maps of runs: a whole run, a part of it, the deciding moment, the ways of repeats.

Also the building of a campaign. :mod:`templates.picture` draws all of them.
"""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from daemon.analysis.deciding import (
    current_waypoint,
    deciding_mark,
    deciding_time,
    joint_positions,
    metres_text,
    pose_at,
)
from daemon.analysis.report._data import ReportData
from daemon.analysis.report._measures import SafetyBuffer, safety_buffer
from daemon.analysis.report._tracks import RunTracks, extract_tracks
from daemon.judging import oracles
from daemon.judging.oracles import SignalSampler
from daemon.model.spec import RunSpec
from daemon.model.verdicts import Outcome, Verdict
from daemon.trace import Trace, TraceError, read_scene, read_spec, read_trace
from grammars.model.geometry import Point2, Pose2
from grammars.model.mission import Mission
from grammars.text.words import count_noun, format_quantity
from templates.picture import (
    LARGE,
    MOMENT,
    SMALL,
    Drawing,
    DrivenWay,
    RunOverlay,
    draw_world,
    page_svg,
    write_drawing,
)
from templates.plan_shapes import MeasuredMark
from templates.world import ArtefactWorld, BehaviourDraw

_POINTS: Final = 2000
_APART: Final = 1.5
_FOOTPRINTS: Final = 24
"""Time between footprints [s], and their largest number."""
_BEFORE: Final = 7.0
"""Time shown before a moment [s]."""
_AFTER: Final = 0.2
"""Time [s] after the judged sample in which the deciding event may be recorded."""
_AT_LEAST: Final = 1.0
"""Time shown for a moment at the very start [s]."""


def draw_run(
    trace_path: Path, picture: Path, *, since: float | None = None, until: float | None = None
) -> None:
    """Draw the run of a trace as ``.svg``, ``.png`` or ``.pdf``, by the ending of ``picture``.

    ``since`` and ``until`` [s] limit it to a part of the run, seen closely. Raises
    :class:`daemon.trace.TraceError` for an unusable trace, and ``ValueError`` for a part outside
    the run.
    """
    write_drawing(run_drawing(read_trace(trace_path), since=since, until=until), picture)


def run_drawing(trace: Trace, *, since: float | None = None, until: float | None = None) -> Drawing:
    """Return the drawing of a run, or of a part of it, for :func:`draw_run`."""
    part = _part(trace, since, until)
    # Do not judge and draw signals of a trace with leaps or NaNs as if they were true.
    problems = oracles.trace_problems(trace)
    if problems:
        way = np.column_stack((trace.ground_truth.x, trace.ground_truth.y))
        way = way[np.isfinite(way).all(axis=1)]
        run = RunOverlay((DrivenWay(way),), about=f"not to be trusted: {'; '.join(problems)}")
    else:
        run = _judged_run(SignalSampler(trace), part)
    return draw_world(_world(trace), run)


def draw_moment(trace_path: Path, verdict: Verdict, label: str) -> Markup | None:
    """Return the seconds before the deciding moment of a verdict, as an element of a page.

    Doors and robot have their places at that moment, the deciding object is red. ``label`` is for
    screen readers. ``None`` if the trace is missing, empty or untrustworthy.
    """
    sampler = _usable_sampler(trace_path)
    if sampler is None:
        return None
    trace, stamps = sampler.trace, sampler.time_base.time
    first, last = float(stamps[0]), float(stamps[-1])
    time = deciding_time(sampler, verdict)
    until = min(max(time + _AFTER, first + _AT_LEAST), last)
    part = _RunPart(max(min(time, last) - _BEFORE, first), until, closely=True)
    overlay = _overlay(trace, _tracks(sampler, closely=True), part)
    overlay = replace(overlay, mark=deciding_mark(sampler, verdict))
    figure = draw_world(_world(trace), overlay, MOMENT)
    return page_svg(figure, label)


def draw_ways(
    runs: Mapping[int, RunTracks], trace_path: Path, label: str, verdict: Verdict | None = None
) -> Markup | None:
    """Return the ways of runs, by repeat, as an element of a page.

    The colour of ways is the distance to obstacles. The building has its initial state, and the
    nearest place has its measure. With a ``verdict`` on the trace, the deciding object is red and
    doors have their places at that moment. Scripts find the places of each repeat in ``data-way``,
    in units of the ``viewBox``; the ways themselves are the group ``driven``. ``None`` if the trace
    is missing.
    """
    sampler = _usable_sampler(trace_path) if verdict else None
    mark, positions = None, {}
    if verdict and sampler:
        mark = deciding_mark(sampler, verdict)
        positions = joint_positions(sampler.trace, deciding_time(sampler, verdict))
    try:
        scene = sampler.trace.scene if sampler else read_scene(trace_path)
    except TraceError:
        return None
    ways = tuple(
        DrivenWay(np.column_stack((run.x, run.y)), run.clearance, run.limit, repeat, run.time)
        for repeat, run in runs.items()
    )
    overlay = RunOverlay(
        ways,
        contacts=tuple((x, y) for run in runs.values() for _, _, x, y in run.contacts),
        positions=positions,
        mark=mark or _nearest_mark(runs.values()),
        closely=True,
    )
    world = ArtefactWorld(name=scene.name, scene=scene)
    figure = draw_world(world, overlay, SMALL)
    return page_svg(figure, label)


def _nearest_mark(runs: Iterable[RunTracks]) -> MeasuredMark | None:
    """Return the place of the least clearance; ``None`` if no clearance is known."""
    measured = [run for run in runs if not np.isnan(run.clearance).all()]
    if not measured:
        return None
    run = min(measured, key=lambda run: float(np.nanmin(run.clearance)))
    index = int(np.nanargmin(run.clearance))
    place, clearance = (float(run.x[index]), float(run.y[index])), float(run.clearance[index])
    return MeasuredMark("", (place, place), metres_text(clearance), fails=clearance <= 0.0)


def draw_recorded_way(trace_path: Path, label: str, verdict: Verdict | None) -> Markup | None:
    """Return :func:`draw_ways` of a single run; ``None`` for an unusable trace."""
    sampler = _usable_sampler(trace_path)
    if sampler is None:
        return None
    runs = {sampler.trace.spec.repeat: _tracks(sampler)}
    return draw_ways(runs, trace_path, label, verdict)


def draw_building(data: ReportData) -> tuple[Markup, Markup, str] | None:
    """Return the building of most runs in its initial state; ``None`` without a trace.

    The values are a small drawing without words, a large one with words, and a caption. They
    include the mission, if all runs in the building have the same one.
    """
    recorded = [run for run in data.runs if run.tracks.scene and run.record.trace]
    scenes = Counter(run.tracks.scene for run in recorded)
    if not scenes:
        return None
    ((digest, _),) = scenes.most_common(1)
    traces: dict[str, Path] = {}
    for run in recorded:
        if run.tracks.scene == digest:
            traces.setdefault(run.record.scenario, Path(str(run.record.trace)))
    try:
        specs = [read_spec(trace) for trace in traces.values()]
        scene = read_scene(next(iter(traces.values())))
    except TraceError:
        # The trace has disappeared since it was read.
        return None
    first = specs[0]
    missions: set[Mission] = {spec.mission for spec in specs}
    mission = first.mission if len(missions) == 1 else None
    world = ArtefactWorld(
        name=scene.name,
        scene=scene,
        mission=mission,
        robot=first.robot if mission else None,
        draws=(BehaviourDraw("", first.behaviours),),
    )
    about = f"{scene.name}, as {first.scenario} begins"
    if mission:
        about = f"{scene.name} with the mission {mission.name}, as {first.scenario} begins"
    if len(scenes) > 1:
        about += f"; the campaign has {len(scenes)} such scenes"
    small, large = (page_svg(draw_world(world, style=style), about) for style in (SMALL, LARGE))
    return small, large, about


def _world(trace: Trace) -> ArtefactWorld:
    spec = trace.spec
    return ArtefactWorld(
        name=spec.label,
        scene=trace.scene,
        mission=spec.mission,
        robot=spec.robot,
        draws=(BehaviourDraw("", spec.behaviours),),
    )


# Pictures of one cell follow each other, mostly of the same trace.
@functools.lru_cache(maxsize=1)
def _usable_sampler(trace_path: Path) -> SignalSampler | None:
    """Return the signals of a trace; ``None`` if it is missing, empty or untrustworthy."""
    try:
        trace = read_trace(trace_path)
    except TraceError:
        return None
    sampler = SignalSampler(trace)
    usable = len(sampler.time_base.time) > 1 and not oracles.trace_problems(trace)
    return sampler if usable else None


@dataclass(frozen=True, slots=True)
class _RunPart:
    """Part of a run from ``since`` to ``until`` [s], shown ``closely`` or as a whole."""

    since: float
    until: float
    closely: bool

    def of(self, time: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
        return (time >= self.since) & (time <= self.until)


def _part(trace: Trace, since: float | None, until: float | None) -> _RunPart:
    time = trace.ground_truth.time
    if not len(time):
        raise ValueError("nothing was recorded")
    first, last = float(time[0]), float(time[-1])
    part = _RunPart(
        first if since is None else since,
        last if until is None else until,
        closely=since is not None or until is not None,
    )
    if part.closely and np.count_nonzero(part.of(time)) < 2:
        raise ValueError(
            f"{part.since:g} s to {part.until:g} s is not a part of this run, "
            f"which goes from {first:g} s to {last:g} s"
        )
    return part


def _tracks(sampler: SignalSampler, *, closely: bool = False) -> RunTracks:
    # In a part every sample counts: it may show a few centimetres.
    points = 3 * len(sampler.time_base.time) if closely else _POINTS
    return extract_tracks(sampler, _buffer(sampler.trace.spec), (), points)


def _buffer(spec: RunSpec) -> SafetyBuffer:
    """Return the safety buffer of a run, by its oracles and its robot."""
    return safety_buffer((oracle.text for oracle in spec.oracles), (spec.robot.footprint,))


def _judged_run(sampler: SignalSampler, part: _RunPart) -> RunOverlay:
    """Return a run, or a part of it, with its outcome and its first failure."""
    oracles.warm_up()
    verdicts = oracles.judge(sampler.trace, sampler.trace.spec.oracles, sampler=sampler)
    marks = (
        deciding_mark(sampler, verdict)
        for verdict in verdicts
        if verdict.outcome is Outcome.FAIL
        and part.since <= deciding_time(sampler, verdict) <= part.until
    )
    tracks = _tracks(sampler, closely=part.closely)
    overlay = _overlay(sampler.trace, tracks, part)
    facts = (
        str(oracles.overall_outcome(sampler.trace, verdicts)),
        *_facts(sampler.trace, tracks, part),
        count_noun(len(overlay.contacts), "contact"),
    )
    return replace(overlay, mark=next(filter(None, marks), None), about="  ·  ".join(facts))


def _facts(trace: Trace, tracks: RunTracks, part: _RunPart) -> Iterator[str]:
    """Yield the facts in the heading of a picture of a run, or of a part of it."""
    lasted = tracks.measures.get("duration", math.nan)
    if part.closely:
        yield f"{part.since:.1f} s to {part.until:.1f} s of {lasted:.1f} s"
    else:
        yield f"campaign {trace.spec.campaign}"
        yield f"ended after {format_quantity(lasted, 's')}"
    nearest = np.nanmin(tracks.clearance[part.of(tracks.time)], initial=math.inf)
    if math.isfinite(nearest):
        yield f"nearest {format_quantity(float(nearest), 'm')}"
    if not part.closely:
        inside = format_quantity(tracks.measures.get("time in buffer"), "s")
        yield f"{inside} in the buffer of {_buffer(trace.spec).size}"


def _overlay(trace: Trace, tracks: RunTracks, part: _RunPart) -> RunOverlay:
    truth, estimate = trace.ground_truth, trace.estimate
    visible, indices = part.of(tracks.time), np.flatnonzero(part.of(estimate.time))
    indices = indices[:: max(1, len(indices) // _POINTS)]
    steps = min(_FOOTPRINTS, max(2, round((part.until - part.since) / _APART)))
    moments = np.linspace(part.since, min(part.until, float(truth.time[-1])), steps).tolist()
    places = np.column_stack((tracks.x, tracks.y))[visible]
    return RunOverlay(
        ways=(DrivenWay(places, tracks.clearance[visible], tracks.limit),),
        believed=tuple(
            zip(estimate.x[indices].tolist(), estimate.y[indices].tolist(), strict=True)
        ),
        contacts=tuple(
            (x, y) for time, _, x, y in tracks.contacts if part.since <= time <= part.until
        ),
        footprints=tuple(
            pose_at(truth, moment).apply_ring(trace.spec.robot.footprint)
            for moment in (moments if part.closely else moments[-1:])
        ),
        apparent_goals=_apparent_goals(trace, part.until, indices) if part.closely else (),
        positions=joint_positions(trace, part.until) if part.closely else {},
        closely=part.closely,
    )


def _apparent_goals(
    trace: Trace, until: float, indices: npt.NDArray[np.int64]
) -> tuple[Point2, ...]:
    """Return the places that the robot takes for its waypoint, for its estimates at ``indices``.

    The robot knows the waypoint in the map, and its own estimated pose. So it drives to a place
    that is off by the error of its localisation, turned by the error of its heading.
    """
    number = current_waypoint(trace, until)
    if number is None:
        return ()
    goal, estimate = trace.spec.mission.waypoints[number - 1], trace.estimate
    goals = []
    for index in indices.tolist():
        believed = Pose2(*(float(v[index]) for v in (estimate.x, estimate.y, estimate.yaw)))
        target = believed.inverse().apply((goal.x, goal.y))
        goals.append(pose_at(trace.ground_truth, float(estimate.time[index])).apply(target))
    return tuple(goals)
