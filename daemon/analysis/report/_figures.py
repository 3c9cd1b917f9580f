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
from daemon.analysis.report._charts import (
    REPEATS,
    References,
    Scales,
    box_chart,
    clearance_chart,
    localisation_chart,
    returns_chart,
    shared_scales,
    trigger_chart,
)
from daemon.analysis.report._data import ReportData, ReportRun
from daemon.analysis.report._measures import error_limit, standard_measures, standard_names
from daemon.analysis.report._tracks import TriggerEncounter
from daemon.analysis.report.run_maps import draw_moment, draw_ways
from daemon.model.assessments import CellVerdict, ExpectationStatus, group_errors
from daemon.model.verdicts import Outcome, Verdict
from grammars.text.words import format_quantity
from templates.naming import file_name, free_name, xml_text

FIGURE_KINDS: Final = (
    "moment",
    "localisation",
    "distance",
    "way",
    "returns",
    "boxes",
    "trigger",
)
MOST_CELLS: Final = 60
"""Most cells with figures of their own; the report says so if there are more."""
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
    limit = error_limit(data.oracle_texts.values())
    scales = shared_scales(_drawn(data), limit)
    plan = [
        *_moments(data),
        *_of_cells(data, scales, limit),
        *_boxes(data),
        *_triggers(data, scales),
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


def _of_cells(data: ReportData, scales: Scales, limit: float | None) -> _Plan:
    cells: dict[tuple[str, str], list[ReportRun]] = {}
    for run in _drawn(data):
        cells.setdefault((run.record.scenario, run.record.sut), []).append(run)
    deciding = _deciding_verdicts(data)
    # Take the first ones; surprises have their own moment figure anyway.
    for (scenario, sut), runs in list(cells.items())[:MOST_CELLS]:
        of = f"{scenario} with {sut}"
        # Long and short scenarios each use the full width.
        end = max(
            float(run.tracks.time[-1])
            for (name, _), others in cells.items() for run in others if name == scenario
        )  # fmt: skip
        figure = partial(ReportFigure, scenario=scenario, sut=sut, caption=sut)
        if any(not np.isnan(run.tracks.error).all() for run in runs):
            chart = localisation_chart(runs, end, scales, limit)
            label = f"Localisation error and spread over time, {of}"
            yield figure("localisation", label=label, chart=chart), None
        if any(np.isnan(run.tracks.clearance).all() for run in runs):
            continue
        chart = clearance_chart(runs, end, scales)
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


def largest_errors(data: ReportData) -> Iterator[str]:
    """Yield run and moment of the largest localisation error of each scenario that limits it.

    If no scenario does, yield those of the whole campaign.
    """
    localised = [run for run in _drawn(data) if "error max" in run.tracks.measures]
    scenarios = dict.fromkeys(
        run.record.scenario
        for run in localised
        if error_limit(verdict.text for verdict in run.record.verdicts) is not None
    )
    groups = [[run for run in localised if run.record.scenario == name] for name in scenarios]
    for group in filter(None, groups or [localised]):
        worst = max(group, key=lambda run: run.tracks.measures["error max"])
        record, tracks = worst.record, worst.tracks
        error = format_quantity(tracks.measures["error max"], "m")
        moment = float(tracks.time[np.nanargmax(tracks.error)])
        run = f"{record.scenario} with {record.sut}, repeat {record.repeat}"
        yield f"{error} at {moment:.1f} s of {run}"


def _boxes(data: ReportData) -> _Plan:
    # A reference belongs to the measure with the meaning of its oracle, under any name.
    standard = standard_names(data.oracle_texts, data.buffer)
    references: dict[str, References] = {}
    for one in data.references:
        name = standard.get(one.reference.oracle)
        if name and one.scenario and one.reference.statistic != "rate":
            reference = (one.scenario, one.sut, one.reference)
            references[name] = [*references.get(name, ()), reference]
    # The measures of the paper, and every measure with a reference.
    names = {"time in buffer", "error p95", "duration", *references}
    for measure in standard_measures(data.buffer):
        rows = [
            (run.record.scenario, run.record.sut, run.record.repeat, value)
            for run in data.runs
            if (value := run.tracks.measures.get(measure.name)) is not None
        ]
        name = measure.name
        if name in names and rows:
            title, of_measure = f"{name} [{measure.unit}]", references.get(name, ())
            chart = box_chart(rows, _systems(data), title, of_measure)
            label = f"Boxplots of {name} by scenario"
            yield ReportFigure("boxes", "", "", name, label, name, chart), None


def _triggers(data: ReportData, scales: Scales) -> _Plan:
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
        chart = trigger_chart(scenarios, names, scales)
        yield ReportFigure("trigger", door, sut, sut, label, chart=chart), None
