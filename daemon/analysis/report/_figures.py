"""Which figures a report has, drawn in parallel, and the moment that decided a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from daemon.analysis.parallel_map import parallel_map
from daemon.analysis.report import _plots
from daemon.analysis.report._axes import Axes, Sheet
from daemon.analysis.report._data import ReportData
from daemon.analysis.report._safety_buffer import oracle_limit, outlines_near, transform_points
from daemon.analysis.report._svg import BAD, BODY, LINE, SECOND, SOFT, WALL
from daemon.analysis.report._tracks import RunTracks, TriggerEncounter
from daemon.judging.oracles import SignalSampler
from daemon.model.assessments import CellVerdict
from daemon.model.verdicts import Outcome
from daemon.trace import TraceError, read_scene, read_trace
from grammars.model.geometry import Floats, Point2
from grammars.model.scene import Scene

FigureKind: TypeAlias = Literal[
    "moment", "localisation", "distance", "way", "inside", "worst-localisation", "boxes", "trigger"
]
MOST_CELLS: Final = 60
"""Cells that get figures of their own; in larger campaigns the first ones, and it is said so."""
MOST_MOMENTS: Final = 24
"""Findings whose deciding moment is drawn: each reads a trace once more."""
_WIDE, _HIGH = 3.2, 2.0
"""Half of what is shown [m]."""
_WAY_SHOWN: Final = 10.0
"""Seconds of the way there that are shown."""


def plot_moment(trace: Path, time: float, involved: str, buffer: Point2) -> Sheet | None:
    """Return the place at ``time`` [s] of a run, the object ``involved`` in red.

    ``None`` if the trace cannot be read any more.
    """
    try:
        recorded = read_trace(trace)
    except TraceError:
        return None
    sampler = SignalSampler(recorded)
    stamps = sampler.time_base.time
    index = min(int(np.searchsorted(stamps, time)), len(stamps) - 1)
    pose = sampler.poses[index]
    sheet = Sheet(3.5, 3.5 * _HIGH / _WIDE, bare=True)
    (axes,) = sheet.axes
    for owner, moves, ring in outlines_near(sampler, index, float(np.hypot(_WIDE, _HIGH))):
        colour = BAD if owner == involved else SECOND if moves else WALL
        axes.shapes([ring], fill=colour, edge=colour, width=0.5)
    first = int(np.searchsorted(stamps, time - _WAY_SHOWN))
    axes.line(sampler.x[first : index + 1], sampler.y[first : index + 1], LINE, 1.2)
    _draw_robot(axes, np.array(recorded.spec.robot.footprint), pose, buffer)
    axes.x_limits = (float(pose[0]) - _WIDE, float(pose[0]) + _WIDE)
    axes.y_limits = (float(pose[1]) - _HIGH, float(pose[1]) + _HIGH)
    axes.equal = True
    return sheet


def _draw_robot(axes: Axes, footprint: Floats, pose: Floats, buffer: Point2) -> None:
    hx, hy = buffer
    box = np.array([(hx, hy), (-hx, hy), (-hx, -hy), (hx, -hy), (hx, hy)])
    ahead = np.array([(0.0, 0.0), (0.7 * float(footprint[:, 0].max()), 0.0)])
    around, body, nose = (
        transform_points(points, pose[None]) for points in (box, footprint, ahead)
    )
    axes.line(around[:, 0], around[:, 1], SOFT, 0.9, dashes="4 3")
    axes.shapes([body], fill=BODY, edge=BODY, width=1.0, alpha=0.55)
    axes.line(nose[:, 0], nose[:, 1], BODY, 2.0)


@dataclass(frozen=True, slots=True)
class ReportFigure:
    """A figure: what it shows of which cell, of ``subject`` (an oracle) if so, and its ``svg``."""

    kind: FigureKind
    scenario: str
    sut: str
    caption: str
    svg: str = ""
    subject: str = ""


@dataclass(frozen=True, slots=True)
class _FigureTask:
    """A figure to draw; ``label`` says what it shows where pictures are not seen."""

    figure: ReportFigure
    label: str
    draw: Callable[[], Sheet | None]


def draw_figures(data: ReportData, *, processes: int | None = None) -> tuple[ReportFigure, ...]:
    """Draw every figure of a report."""
    drawn = (*_moments(data), *_of_cells(data), *_of_campaign(data))
    tasks = tuple(enumerate(drawn))
    return tuple(parallel_map(_draw_task, tasks, doing="that draws figures", processes=processes))


def _draw_task(numbered: tuple[int, _FigureTask]) -> ReportFigure:
    number, task = numbered
    drawn = task.draw()
    svg = "" if drawn is None else drawn.svg(f"f{number}", task.label)
    return replace(task.figure, svg=svg)


def notable_verdicts(data: ReportData) -> tuple[CellVerdict, ...]:
    """Return the verdicts to look at: what contradicts, is open or fails, unexpected ones first."""
    wanted = [
        oracle
        for cell in data.assessment.cells
        for oracle in cell.oracles
        if not oracle.met or oracle.verdict is not Outcome.PASS
    ]
    return tuple(sorted(wanted, key=lambda oracle: oracle.met))


def _moments(data: ReportData) -> Iterator[_FigureTask]:
    """Draw the deciding moments of the first findings."""
    runs = {run.record.id: run for run in data.runs}
    for oracle in notable_verdicts(data)[:MOST_MOMENTS]:
        worst = oracle.worst
        time = None if worst is None else worst.verdict.evidence.time
        if worst is None or time is None:
            continue
        run, involved = runs[worst.run], worst.verdict.evidence.object
        if run.record.trace is None or not len(run.tracks.time):
            continue
        caption = f"repeat {worst.repeat} at {time:.1f} s"
        yield _FigureTask(
            ReportFigure(
                "moment", oracle.scenario, oracle.sut, caption, subject=oracle.oracle
            ),
            f"The moment that decides {oracle.oracle}, {oracle.scenario} with {oracle.sut}",
            partial(
                plot_moment, trace=Path(run.record.trace), time=time, involved=involved,
                buffer=run.tracks.buffer,
            ),
        )  # fmt: skip


def _cells(data: ReportData) -> dict[tuple[str, str], list[RunTracks]]:
    found: dict[tuple[str, str], list[RunTracks]] = {}
    for run in data.runs:
        if len(run.tracks.time) > 1:
            found.setdefault((run.record.scenario, run.record.sut), []).append(run.tracks)
    # The first ones: those with surprises have their moment drawn whatever their place.
    return dict(list(found.items())[:MOST_CELLS])


def _of_cells(data: ReportData) -> Iterator[_FigureTask]:
    cells, scenes = _cells(data), _scenes(data)
    limit = oracle_limit(data.input.oracles, "loc.error")
    for scenario in dict.fromkeys(scenario for scenario, _ in cells):
        here = {sut: runs for (name, sut), runs in cells.items() if name == scenario}
        # Systems under test of a scenario side by side: the same axes, or the eye compares wrongly.
        frame = _plots.plot_limits([run for runs in here.values() for run in runs])
        for sut, runs in here.items():
            of = f"{scenario} with {sut}"
            if any(not np.isnan(run.error).all() for run in runs):
                yield _FigureTask(
                    ReportFigure("localisation", scenario, sut, sut),
                    f"Localisation error and spread over time, {of}",
                    partial(_plots.plot_localisation, runs=runs, frame=frame, limit=limit),
                )  # fmt: skip
            if any(np.isnan(run.clearance).all() for run in runs):
                continue
            yield _FigureTask(
                ReportFigure("distance", scenario, sut, sut), f"Clearance over time, {of}",
                partial(_plots.plot_clearance, runs=runs, frame=frame),
            )  # fmt: skip
            scene = scenes.get(runs[0].scene)
            if scene is not None:
                yield _FigureTask(
                    ReportFigure("way", scenario, sut, sut),
                    f"Clearance along the way on the map, {of}",
                    partial(_plots.plot_way, runs=runs, frame=frame, scene=scene),
                )  # fmt: skip
            if any(len(run.inside) for run in runs):
                yield _FigureTask(
                    ReportFigure("inside", scenario, sut, f"{scenario}, {sut}"),
                    f"Obstacles inside the safety buffer as seen from the robot, {of}",
                    partial(_plots.plot_buffer, runs=runs),
                )  # fmt: skip


def _of_campaign(data: ReportData) -> Iterator[_FigureTask]:
    yield from _worst_localisation(data)
    yield from _boxes(data, "time in buffer", "time in buffer [s]")
    yield from _boxes(data, "error p95", "95 % of the error [m]")
    yield from _boxes(data, "duration", "duration [s]")
    yield from _triggers(data)


def _worst_localisation(data: ReportData) -> Iterator[_FigureTask]:
    known = [run for run in data.runs if "error max" in run.tracks.measures]
    if not known:
        return
    worst = max(known, key=lambda run: run.tracks.measures["error max"])
    scene = _scenes(data).get(worst.tracks.scene)
    if scene is None:
        return
    of = f"{worst.record.scenario} with {worst.record.sut}, repeat {worst.record.repeat}"
    limit = oracle_limit(data.input.oracles, "loc.error")
    yield _FigureTask(
        ReportFigure("worst-localisation", worst.record.scenario, of, "around the peak"),
        f"The largest localisation error over time, {of}",
        partial(_plots.plot_error_peak, run=worst.tracks, limit=limit),
    )  # fmt: skip
    yield _FigureTask(
        ReportFigure("worst-localisation", worst.record.scenario, of, "where it was"),
        f"The largest localisation error on the map, {of}",
        partial(_plots.plot_peak_map, run=worst.tracks, scene=scene),
    )  # fmt: skip


def _boxes(data: ReportData, measure: str, axis: str) -> Iterator[_FigureTask]:
    values: dict[str, dict[str, list[float]]] = {}
    for run in data.runs:
        if measure in run.tracks.measures:
            of = values.setdefault(run.record.scenario, {}).setdefault(run.record.sut, [])
            of.append(run.tracks.measures[measure])
    if not values or not any(v for cells in values.values() for vs in cells.values() for v in vs):
        return
    suts = tuple(dict.fromkeys(sut for cells in values.values() for sut in cells))
    table = tuple((scenario, tuple(cells.items())) for scenario, cells in values.items())
    yield _FigureTask(
        ReportFigure("boxes", "", "", measure), f"Boxplots of {measure} by scenario",
        partial(_plots.plot_boxes, values=table, suts=suts, axis=axis),
    )  # fmt: skip


def scenarios_with_triggers(data: ReportData) -> tuple[str, ...]:
    """Return the scenarios in the figures around triggers, in the order of their colours."""
    names = (run.record.scenario for run in data.runs if run.tracks.encounters)
    return tuple(dict.fromkeys(names))


def _triggers(data: ReportData) -> Iterator[_FigureTask]:
    colours = {name: number for number, name in enumerate(scenarios_with_triggers(data))}
    found: dict[tuple[str, str], dict[int, list[TriggerEncounter]]] = {}
    for run in data.runs:
        for encounter in run.tracks.encounters:
            if len(encounter.since) > 1:
                by_scenario = found.setdefault((encounter.joint, run.record.sut), {})
                by_scenario.setdefault(colours[run.record.scenario], []).append(encounter)
    for (joint, sut), by_scenario in sorted(found.items()):
        door = joint.rpartition(".")[0] or joint
        yield _FigureTask(
            ReportFigure("trigger", door, sut, sut),
            f"Speed and turning speed around the trigger of {door} with {sut}",
            partial(_plots.plot_triggers, scenarios=tuple(by_scenario.items())),
        )  # fmt: skip


def _scenes(data: ReportData) -> dict[str, Scene]:
    """Return the scenes of the runs by digest, each read from one of the traces."""
    found: dict[str, Scene] = {}
    for run in data.runs:
        digest, trace = run.tracks.scene, run.record.trace
        if digest and trace is not None and digest not in found:
            try:
                found[digest] = read_scene(Path(trace))
            except TraceError:
                # Read a moment ago and gone now: the figure has no walls then.
                continue
    return found
