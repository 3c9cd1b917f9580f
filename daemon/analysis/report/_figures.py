"""Figures of a report: their choice, and parallel drawing, for a page and as files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from markupsafe import Markup, escape

from daemon.analysis.charts import Chart, chart_figure, draw_charts, svg_pdf
from daemon.analysis.parallel_map import parallel_map
from daemon.analysis.report._campaign_charts import box_chart, comparison_chart, trigger_chart
from daemon.analysis.report._cell_charts import (
    REPEATS,
    ValueLimits,
    clearance_chart,
    localisation_chart,
    peak_chart,
    returns_chart,
    value_limits,
)
from daemon.analysis.report._data import (
    ReferenceMark,
    ReportData,
    ReportRun,
    cell_marks,
    comparison_marks,
)
from daemon.analysis.report._measures import MEASURES
from daemon.analysis.report._safety_buffer import oracle_limit
from daemon.analysis.report._tracks import TriggerEncounter
from daemon.analysis.report.run_maps import close_tracks, draw_moment, draw_ways
from daemon.model.assessments import CellVerdict, ExpectationStatus, group_errors
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome, Verdict
from templates.naming import file_name, free_name, xml_text

_Marks: TypeAlias = dict[tuple[str, str], dict[str, list[ReferenceMark]]]

MOST_CELLS: Final = 60
"""Most cells with figures of their own; the report says so if there are more."""
_MOST_WORST: Final = 4
"""Most scenarios whose largest localisation error is drawn in detail."""
_MOST_MOMENTS: Final = 24
"""Most findings whose deciding moment is drawn, since their traces are read again."""


@dataclass(frozen=True, slots=True)
class ReportFigure:
    """A figure: a ``chart`` or a map, drawn as ``svg``.

    ``kind`` is the aspect of a cell that it shows, ``subject`` its oracle, measure or unit, if any.
    ``label`` is for screen readers.
    """

    kind: str
    scenario: str
    sut: str
    caption: str
    label: str
    subject: str = ""
    chart: Chart | None = None
    svg: str = ""

    @property
    def markup(self) -> Markup:
        """The figure as a part of a page; scripts find figures of the same cell."""
        cell = xml_text(f"{self.scenario}, {self.sut}")
        if self.chart is not None:
            return chart_figure(self.chart, self.svg, self.label, cell=cell)
        return Markup(f'<div class="map" data-cell="{escape(cell)}">{self.svg}</div>')


_Map: TypeAlias = Callable[[], Markup | None]
_Plan: TypeAlias = Iterator[tuple[ReportFigure, _Map | None]]
"""Figures to draw: by their chart, or by a function."""


def draw_figures(data: ReportData, *, processes: int | None = None) -> tuple[ReportFigure, ...]:
    """Draw every figure of a report, except those with a missing trace."""
    marks = cell_marks(data)
    errors = [
        mark.value
        for of_cell in marks.values()
        for name in ("error mean", "error max")
        for mark in of_cell.get(name, ())
    ]
    limit = oracle_limit(data.oracles, "loc.error")
    limits = value_limits(_drawn(data), errors if limit is None else [limit, *errors])
    plan = [
        *_moments(data),
        *_of_cells(data, marks, limits),
        *_worst_localisation(data),
        *_boxes(data, marks),
        *_comparisons(data),
        *_triggers(data, limits),
    ]
    # Maps of one cell follow each other: they mostly show the same trace, which is read once then.
    maps = sorted(
        ((figure, draw) for figure, draw in plan if draw is not None),
        key=lambda pair: (pair[0].scenario, pair[0].sut, pair[0].kind),
        reverse=True,
    )
    draws = [draw for _, draw in maps]
    # Draw all maps before the first chart: otherwise the children of both would share the cores.
    results = parallel_map(_drawn_map, draws, doing="that draws maps", processes=processes)
    pictures = dict(zip(draws, results, strict=True))
    charts = [figure.chart for figure, _ in plan if figure.chart is not None]
    drawings = iter(draw_charts(charts, processes=processes))
    figures = (
        replace(figure, svg=next(drawings) if draw is None else pictures[draw])
        for figure, draw in plan
    )
    return tuple(figure for figure in figures if figure.svg)


def _drawn_map(draw: _Map) -> str:
    return str(draw() or "")


def write_figures(figures: tuple[ReportFigure, ...], folder: Path) -> None:
    """Write each figure as PDF, named by kind, scenario, SUT and subject."""
    folder.mkdir(parents=True, exist_ok=True)
    names: set[str] = set()
    for figure in figures:
        parts = (figure.kind, figure.scenario, figure.sut, figure.subject)
        # The scenario a-b with c and the scenario a with b-c give the same joined name.
        names.add(name := free_name(file_name("-".join(filter(None, parts))), names))
        (folder / f"{name}.pdf").write_bytes(svg_pdf(figure.svg))


def notable_verdicts(data: ReportData) -> tuple[CellVerdict, ...]:
    """Return contradicting, open and failing verdicts, unexpected ones first."""
    expected = ExpectationStatus.MET
    notable = [
        oracle
        for cell in data.assessment.cells
        for oracle in cell.oracles
        if oracle.status is not expected or oracle.verdict is not Outcome.PASS
    ]
    return tuple(sorted(notable, key=lambda oracle: oracle.status is expected))


def _systems(data: ReportData) -> list[str]:
    return list(dict.fromkeys(cell.sut for cell in data.assessment.cells))


def _drawn(data: ReportData) -> list[ReportRun]:
    return [run for run in data.runs if len(run.tracks.time) > 1]


def _moments(data: ReportData) -> _Plan:
    """Draw the deciding moments of the first findings."""
    runs = {run.record.id: run for run in data.runs}
    for oracle, *_ in group_errors(notable_verdicts(data))[:_MOST_MOMENTS]:
        worst = oracle.worst
        if worst is None:
            continue
        run, time = runs[worst.run], worst.verdict.evidence.time
        if not run.record.trace or not len(run.tracks.time):
            continue
        # The end of the run decides a condition that never held.
        when = "the end" if time is None else f"{time:.1f} s"
        caption = f"repeat {worst.repeat}, the seconds before {when}"
        label = f"The moment that decides {oracle.oracle}, {oracle.scenario} with {oracle.sut}"
        yield (
            ReportFigure("moment", oracle.scenario, oracle.sut, caption, label, oracle.oracle),
            partial(draw_moment, Path(run.record.trace), worst.verdict, label),
        )


def _of_cells(data: ReportData, marks: _Marks, limits: ValueLimits) -> _Plan:
    cells: dict[tuple[str, str], list[ReportRun]] = {}
    for run in _drawn(data):
        cells.setdefault((run.record.scenario, run.record.sut), []).append(run)
    limit = oracle_limit(data.oracles, "loc.error")
    deciding = _deciding_verdicts(data)
    # Take the first ones; surprises have their own moment figure anyway.
    for (scenario, sut), runs in list(cells.items())[:MOST_CELLS]:
        of, marked = f"{scenario} with {sut}", marks.get((scenario, sut), {})
        # Long and short scenarios each use the full width.
        end = max(
            float(run.tracks.time[-1])
            for (name, _), others in cells.items() for run in others if name == scenario
        )  # fmt: skip
        figure = partial(ReportFigure, scenario=scenario, sut=sut, caption=sut)
        if any(not np.isnan(run.tracks.error).all() for run in runs):
            errors = [*marked.get("error mean", ()), *marked.get("error max", ())]
            chart = localisation_chart(runs, end, limits, limit, errors)
            label = f"Localisation error and spread over time, {of}"
            yield figure("localisation", label=label, chart=chart), None
        if any(np.isnan(run.tracks.clearance).all() for run in runs):
            continue
        chart = clearance_chart(runs, end, limits, marked.get("min clearance", ()))
        yield figure("distance", label=f"Clearance over time, {of}", chart=chart), None
        label = f"Clearance along the way on the map, {of}"
        ways = {run.record.repeat: run.tracks for run in runs[:REPEATS]}
        trace, verdict = deciding.get((scenario, sut), (Path(runs[0].record.trace), None))
        yield figure("way", label=label), partial(draw_ways, ways, trace, label, verdict)
        if any(len(run.tracks.returns) for run in runs):
            label = f"Laser returns inside the safety buffer as seen from the robot, {of}"
            chart = returns_chart(runs)
            yield figure("returns", caption=f"{scenario}, {sut}", label=label, chart=chart), None


def _deciding_verdicts(data: ReportData) -> dict[tuple[str, str], tuple[Path, Verdict]]:
    """Return the gravest failing verdict of each cell, (scenario, SUT), and its trace."""
    traces = {run.record.id: run.record.trace for run in data.runs}
    deciding: dict[tuple[str, str], tuple[Path, Verdict]] = {}
    for oracle in notable_verdicts(data):
        worst = oracle.worst
        if worst and worst.verdict.outcome is Outcome.FAIL and (trace := traces[worst.run]):
            deciding.setdefault((oracle.scenario, oracle.sut), (Path(trace), worst.verdict))
    return deciding


def _worst_localisation(data: ReportData) -> _Plan:
    """Draw the run with the largest error of each scenario that limits this error.

    If no scenario does, draw that of the whole campaign.
    """
    limit = oracle_limit(data.oracles, "loc.error")
    localised = [run for run in _drawn(data) if "error max" in run.tracks.measures]
    scenarios = dict.fromkeys(
        run.record.scenario for run in localised if _asks_for_error(run.record)
    )
    groups = [[run for run in localised if run.record.scenario == name] for name in scenarios]
    for group in (groups or [localised])[:_MOST_WORST]:
        if group:
            worst = max(group, key=lambda run: run.tracks.measures["error max"])
            record = worst.record
            of = f"{record.scenario} with {record.sut}, repeat {record.repeat}"
            label = f"The largest localisation error over time, {of}"
            figure = ReportFigure("worst-localisation", record.scenario, record.sut, of, label)
            # The thinned samples of a long run are too few for one minute.
            tracks = close_tracks(Path(record.trace)) or worst.tracks
            yield replace(figure, chart=peak_chart(replace(worst, tracks=tracks), limit)), None


def _asks_for_error(record: RunRow) -> bool:
    return oracle_limit((verdict.text for verdict in record.verdicts), "loc.error") is not None


def _boxes(data: ReportData, marks: _Marks) -> _Plan:
    marked = {name for of_cell in marks.values() for name in of_cell}
    # The measures of the paper, and every measure with a reference.
    names = {"time in buffer", "error p95", "duration"} | marked
    for measure in MEASURES:
        rows = [
            (run.record.scenario, run.record.sut, run.record.repeat, value)
            for run in data.runs
            if (value := run.tracks.measures.get(measure.name)) is not None
        ]
        name = measure.name
        if name in names and rows:
            of_measure = {cell: of_cell.get(name, []) for cell, of_cell in marks.items()}
            chart = box_chart(rows, _systems(data), f"{name} [{measure.unit}]", of_measure)
            label = f"Boxplots of {name} by scenario"
            yield ReportFigure("boxes", "", "", name, label, name, chart), None


def _comparisons(data: ReportData) -> _Plan:
    """Draw the comparisons of the campaign, one figure for each unit."""
    verdicts = [verdict for verdict in data.assessment.comparisons if verdict.differences]
    marks = comparison_marks(data)
    for unit in dict.fromkeys(verdict.unit for verdict in verdicts):
        of_unit = [verdict for verdict in verdicts if verdict.unit == unit]
        chart = comparison_chart(of_unit, _systems(data), marks)
        label = f"Results of comparisons in {unit}, with their bounds and limits"
        caption = f"differences in {unit}"
        yield ReportFigure("comparison", "", "", caption, label, unit, chart), None


def _triggers(data: ReportData, limits: ValueLimits) -> _Plan:
    encounters: dict[tuple[str, str], dict[str, list[TriggerEncounter]]] = {}
    for run in data.runs:
        for encounter in run.tracks.encounters:
            if len(encounter.since) > 1:
                of_door = encounters.setdefault((encounter.joint, run.record.sut), {})
                of_door.setdefault(run.record.scenario, []).append(encounter)
    # Every figure has the same colours, even if a scenario is missing.
    names = list(dict.fromkeys(name for of_door in encounters.values() for name in of_door))
    for (joint, sut), scenarios in sorted(encounters.items()):
        door = joint.rpartition(".")[0] or joint
        label = f"Speed and turning speed around the trigger of {door} with {sut}"
        chart = trigger_chart(scenarios, names, limits)
        yield ReportFigure("trigger", door, sut, sut, label, chart=chart), None
