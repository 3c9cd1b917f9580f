"""Which figures a report has, drawn in parallel, and the moment that decided a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from daemon.analysis.parallel_map import parallel_map
from daemon.analysis.report import _plots
from daemon.analysis.report._axes import Sheet
from daemon.analysis.report._data import ReportData, ReportRun
from daemon.analysis.report._measures import MEASURES, RunMeasure
from daemon.analysis.report._plot_campaign import (
    plot_boxes,
    plot_error_overview,
    plot_error_peak,
    plot_peak_map,
    plot_triggers,
)
from daemon.analysis.report._plot_comparisons import plot_comparisons, plot_run_pair
from daemon.analysis.report._recorded import forget_traces, sampled_trace
from daemon.analysis.report._references import (
    ReferenceMark,
    cell_marks,
    compared_references,
    comparison_marks,
)
from daemon.analysis.report._safety_buffer import SafetyBuffer, oracle_limit
from daemon.analysis.report._svg import PagePicture
from daemon.analysis.report._tracks import RunTracks, TriggerEncounter, extract_tracks
from daemon.analysis.report.run_maps import draw_moment
from daemon.judging.assessment import base_name
from daemon.model.assessments import DELAY, CellVerdict, ExpectationStatus
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome
from daemon.trace import TraceError, read_scene
from grammars.model.scene import Scene

_CellMarks: TypeAlias = dict[tuple[str, str], dict[str, list[ReferenceMark]]]
FigureKind: TypeAlias = Literal[
    "moment",
    "localisation",
    "distance",
    "way",
    "returns",
    "worst-localisation",
    "boxes",
    "comparison",
    "run-pair",
    "trigger",
]
MOST_CELLS: Final = 60
"""Cells that get figures of their own; in larger campaigns the first ones, and it is said so."""
MOST_WORST: Final = 4
"""Scenarios whose largest localisation error is drawn in detail."""
_DETAILED: Final = 4000
"""Samples of a run that is drawn by itself."""
MOST_MOMENTS: Final = 24
"""Findings whose deciding moment is drawn: their traces are read once more."""


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
    """A figure to draw; ``label`` says what it shows where pictures are not seen.

    ``trace`` is read for it.
    """

    figure: ReportFigure
    label: str
    draw: Callable[[], PagePicture | str | None]
    trace: str = ""


@dataclass(frozen=True)
class _SharedParts:
    """Parts of several figures, each made when it is needed first."""

    data: ReportData

    @cached_property
    def marks(self) -> _CellMarks:
        """Reference marks by cell and measure."""
        return _marks(self.data)

    @cached_property
    def limits(self) -> _plots.PlotLimits:
        """Limits of values that all figures of a kind share; there must be a run with tracks."""
        return _limits(self.data, self.marks)

    @cached_property
    def scenes(self) -> dict[str, Scene]:
        """Scenes of the runs by digest."""
        return _scenes(self.data)


def draw_figures(data: ReportData, *, processes: int | None = None) -> tuple[ReportFigure, ...]:
    """Draw every figure of a report."""
    shared = _SharedParts(data)
    drawn = (*_moments(data), *_of_cells(data, shared), *_of_campaign(data, shared))
    # What takes long first, and figures from one trace behind each other: it is read once for them.
    tasks = sorted(enumerate(drawn), key=lambda task: task[1].trace, reverse=True)
    try:
        done = parallel_map(_draw_task, tasks, doing="that draws figures", processes=processes)
        figures = dict(done)
    finally:
        forget_traces()
    return tuple(figures[number] for number in range(len(drawn)))


def _draw_task(numbered: tuple[int, _FigureTask]) -> tuple[int, ReportFigure]:
    number, task = numbered
    drawn = task.draw()
    if drawn is None or isinstance(drawn, str):
        return number, replace(task.figure, svg=drawn or "")
    svg = drawn.svg(f"f{number}", task.label)
    return number, replace(task.figure, svg=svg)


def notable_verdicts(data: ReportData) -> tuple[CellVerdict, ...]:
    """Return the verdicts to look at: what contradicts, is open or fails, unexpected ones first."""
    met = ExpectationStatus.MET
    notable = [
        oracle
        for cell in data.assessment.cells
        for oracle in cell.oracles
        if oracle.status is not met or oracle.verdict is not Outcome.PASS
    ]
    return tuple(sorted(notable, key=lambda oracle: oracle.status is met))


def _moments(data: ReportData) -> Iterator[_FigureTask]:
    """Draw the deciding moments of the first findings."""
    runs = {run.record.id: run for run in data.runs}
    for oracle in notable_verdicts(data)[:MOST_MOMENTS]:
        worst = oracle.worst
        if worst is None:
            continue
        run, seen = runs[worst.run], worst.verdict.evidence
        if not run.record.trace or not len(run.tracks.time):
            continue
        # What never happened is decided where the run ends.
        time = float(run.tracks.time[-1]) if seen.time is None else seen.time
        when = "the end" if seen.time is None else f"{time:.1f} s"
        caption = f"repeat {worst.repeat}, the seconds before {when}"
        label = f"The moment that decides {oracle.oracle}, {oracle.scenario} with {oracle.sut}"
        yield _FigureTask(
            ReportFigure(
                "moment", oracle.scenario, oracle.sut, caption, subject=oracle.oracle
            ),
            label,
            partial(draw_moment, Path(run.record.trace), worst.verdict, label),
            run.record.trace,
        )  # fmt: skip


def _cells(data: ReportData) -> dict[tuple[str, str], list[RunTracks]]:
    found: dict[tuple[str, str], list[RunTracks]] = {}
    for run in data.runs:
        if len(run.tracks.time) > 1:
            found.setdefault((run.record.scenario, run.record.sut), []).append(run.tracks)
    # The first ones: those with surprises have their moment drawn whatever their place.
    return dict(list(found.items())[:MOST_CELLS])


def _of_cells(data: ReportData, shared: _SharedParts) -> Iterator[_FigureTask]:
    cells, scenes, marks = _cells(data), shared.scenes, shared.marks
    limit = oracle_limit(data.input.oracles, "loc.error")
    for scenario in dict.fromkeys(scenario for scenario, _ in cells):
        here = {sut: runs for (name, sut), runs in cells.items() if name == scenario}
        shown = _plots.plot_limits([run for runs in here.values() for run in runs])
        frame = _plots.panel_limits(shared.limits, shown)
        for sut, runs in here.items():
            of, known = f"{scenario} with {sut}", marks.get((scenario, sut), {})
            if any(not np.isnan(run.error).all() for run in runs):
                yield _FigureTask(
                    ReportFigure("localisation", scenario, sut, sut),
                    f"Localisation error and spread over time, {of}",
                    partial(
                        _plots.plot_localisation, runs=runs, frame=frame, limit=limit,
                        marks=[*known.get("error mean", ()), *known.get("error max", ())],
                    ),
                )  # fmt: skip
            if any(np.isnan(run.clearance).all() for run in runs):
                continue
            yield _FigureTask(
                ReportFigure("distance", scenario, sut, sut), f"Clearance over time, {of}",
                partial(
                    _plots.plot_clearance, runs=runs, frame=frame,
                    marks=known.get("min clearance", ()),
                ),
            )  # fmt: skip
            scene = scenes.get(runs[0].scene)
            if scene is not None:
                yield _FigureTask(
                    ReportFigure("way", scenario, sut, sut),
                    f"Clearance along the way on the map, {of}",
                    partial(_plots.plot_way, runs=runs, frame=frame, scene=scene),
                )  # fmt: skip
            if any(len(run.returns) for run in runs):
                yield _FigureTask(
                    ReportFigure("returns", scenario, sut, f"{scenario}, {sut}"),
                    f"Laser returns inside the safety buffer as seen from the robot, {of}",
                    partial(_plots.plot_buffer, runs=runs),
                )


def _limits(data: ReportData, marks: _CellMarks) -> _plots.PlotLimits:
    """Return the limits of values that all figures of a kind share."""
    limit = oracle_limit(data.input.oracles, "loc.error")
    errors = [] if limit is None else [limit]
    for known in marks.values():
        errors += [m.value for name in ("error mean", "error max") for m in known.get(name, ())]
    runs = [run.tracks for run in data.runs if len(run.tracks.time) > 1]
    return _plots.plot_limits(runs, errors)


def _of_campaign(data: ReportData, shared: _SharedParts) -> Iterator[_FigureTask]:
    yield from _worst_localisation(data, shared.scenes)
    marks = shared.marks
    marked = {measure for found in marks.values() for measure in found}
    # Those of the paper, and besides whatever there is something to hold against.
    drawn = ("time in buffer", "error p95", "duration")
    for measure in MEASURES:
        if measure.name in drawn or measure.name in marked:
            of_measure = {cell: found.get(measure.name, []) for cell, found in marks.items()}
            yield from _boxes(data, measure, of_measure)
    yield from _comparisons(data)
    yield from _run_pairs(data, shared)
    yield from _triggers(data, shared)


def _marks(data: ReportData) -> _CellMarks:
    return cell_marks(data.input, data.assessment, data.buffer, data.oracle_texts)


def _worst_localisation(data: ReportData, scenes: dict[str, Scene]) -> Iterator[_FigureTask]:
    """Draw the run with the largest error of each scenario that asks how large it may be.

    Of the campaign, where none asks.
    """
    known = [run for run in data.runs if "error max" in run.tracks.measures]
    asked = dict.fromkeys(run.record.scenario for run in known if _asks_for_error(run.record))
    groups = [[run for run in known if run.record.scenario == name] for name in asked]
    for group in (groups or [known])[:MOST_WORST]:
        if group:
            yield from _worst_run(data, scenes, group)


def _asks_for_error(record: RunRow) -> bool:
    return oracle_limit((verdict.text for verdict in record.verdicts), "loc.error") is not None


def _worst_run(
    data: ReportData, scenes: dict[str, Scene], known: Sequence[ReportRun]
) -> Iterator[_FigureTask]:
    worst = max(known, key=lambda run: run.tracks.measures["error max"])
    scene = scenes.get(worst.tracks.scene)
    if scene is None or not worst.record.trace:
        return
    of = f"{worst.record.scenario} with {worst.record.sut}, repeat {worst.record.repeat}"
    limit = oracle_limit(data.input.oracles, "loc.error")
    for caption, label, draw in (
        ("the whole run", "in a whole run", partial(plot_error_overview, limit=limit)),
        ("around the peak", "over time", partial(plot_error_peak, limit=limit)),
        ("where it was", "on the map", partial(plot_peak_map, scene=scene)),
    ):
        yield _FigureTask(
            ReportFigure("worst-localisation", worst.record.scenario, of, caption),
            f"The largest localisation error {label}, {of}",
            partial(_draw_detailed, record=worst.record, buffer=data.buffer, draw=draw),
            worst.record.trace,
        )


def _draw_detailed(
    record: RunRow, buffer: SafetyBuffer, draw: Callable[..., Sheet]
) -> Sheet | None:
    """Draw a run from more samples than are kept of every run; ``None`` if its trace is gone."""
    try:
        sampler = sampled_trace(Path(record.trace))
    except TraceError:
        return None
    return draw(run=extract_tracks(record.id, sampler.trace, sampler, buffer, (), _DETAILED))


def _boxes(
    data: ReportData,
    measure: RunMeasure,
    marks: dict[tuple[str, str], list[ReferenceMark]],
) -> Iterator[_FigureTask]:
    values: dict[str, dict[str, list[float]]] = {}
    for run in data.runs:
        if measure.name in run.tracks.measures:
            of = values.setdefault(run.record.scenario, {}).setdefault(run.record.sut, [])
            of.append(run.tracks.measures[measure.name])
    if not values:
        return
    suts = tuple(dict.fromkeys(sut for cells in values.values() for sut in cells))
    table = tuple((scenario, tuple(cells.items())) for scenario, cells in values.items())
    yield _FigureTask(
        ReportFigure("boxes", "", "", measure.name), f"Boxplots of {measure.name} by scenario",
        partial(
            plot_boxes, values=table, suts=suts, axis=f"{measure.name} [{measure.unit}]",
            marks=marks,
        ),
    )  # fmt: skip


def _comparisons(data: ReportData) -> Iterator[_FigureTask]:
    """Draw the comparisons of the campaign, those of one unit together."""
    verdicts = [verdict for verdict in data.assessment.comparisons if verdict.differences]
    marks = comparison_marks(compared_references(data.input, data.assessment))
    suts = tuple(dict.fromkeys(cell.sut for cell in data.assessment.cells))
    for unit in dict.fromkeys(verdict.unit for verdict in verdicts):
        of_unit = [verdict for verdict in verdicts if verdict.unit == unit]
        names = {verdict.comparison for verdict in of_unit}
        shown = {key: found for key, found in marks.items() if key[0] in names}
        yield _FigureTask(
            ReportFigure("comparison", "", "", f"differences in {unit}"),
            f"What comparisons in {unit} found, with their bounds and limits",
            partial(plot_comparisons, verdicts=of_unit, suts=suts, marks=shown),
        )


def _run_pairs(data: ReportData, shared: _SharedParts) -> Iterator[_FigureTask]:
    """Draw, for each delay that is asked for, one run of both scenarios with each system."""
    suts = tuple(dict.fromkeys(run.record.sut for run in data.runs))
    delays = [c for c in data.input.declared.comparisons if c.quantity == DELAY]
    for comparison, sut in list(product(delays, suts))[:MOST_CELLS]:
        sides = [_runs_by_pair(data, name, sut) for name in (comparison.left, comparison.right)]
        both = sorted(sides[0].keys() & sides[1].keys())
        if not both:
            continue
        pair = [side[both[0]] for side in sides]
        shown = tuple(
            (
                run.record.scenario,
                Path(run.record.trace),
                tuple(e.time for e in run.tracks.encounters),
            )
            for run in pair
        )
        names = f"{comparison.left} and {comparison.right}"
        yield _FigureTask(
            ReportFigure("run-pair", names, sut, f"{sut}, repeat {pair[0].record.repeat}"),
            f"Speed and turning speed in a run of {names} with {sut}",
            partial(plot_run_pair, runs=shown, frame=shared.limits),
            pair[0].record.trace,
        )


def _runs_by_pair(data: ReportData, scenario: str, sut: str) -> dict[tuple[str, int], ReportRun]:
    """Return the runs of a scenario that can be drawn, by variant of the plan and repeat."""
    return {
        (run.record.scenario.partition("@")[2], run.record.repeat): run
        for run in data.runs
        if (base_name(run.record.scenario), run.record.sut) == (scenario, sut)
        and len(run.tracks.time) > 1
    }


def scenarios_with_triggers(data: ReportData) -> tuple[str, ...]:
    """Return the scenarios in the figures around triggers, in the order of their colours."""
    names = (run.record.scenario for run in data.runs if run.tracks.encounters)
    return tuple(dict.fromkeys(names))


def _triggers(data: ReportData, shared: _SharedParts) -> Iterator[_FigureTask]:
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
            partial(plot_triggers, scenarios=tuple(by_scenario.items()), frame=shared.limits),
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
