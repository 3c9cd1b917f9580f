"""Data of a report: traces, read in parallel and judged if necessary, and reference values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from daemon.analysis.coverage import Coverage, RunCoverage, run_coverage, sum_coverage
from daemon.analysis.parallel_map import parallel_map
from daemon.analysis.recorded import judge_row
from daemon.analysis.report._measures import (
    RunMeasure,
    SafetyBuffer,
    safety_buffer,
    standard_measures,
    standard_names,
)
from daemon.analysis.report._tracks import RunTracks, extract_tracks
from daemon.analysis.results import CampaignResults
from daemon.analysis.table import results_table
from daemon.judging import oracles
from daemon.judging.assessment import assess, reference_comparisons
from daemon.judging.oracles import SignalSampler
from daemon.model.assessments import Assessment, ReferenceComparison
from daemon.model.spec import RunSpec
from daemon.model.status import RunRow
from daemon.model.verdicts import Evidence, Outcome, Verdict
from daemon.trace import TraceError, read_trace
from grammars.model.behaviour import Trigger

if TYPE_CHECKING:
    import pyarrow as pa

_SAMPLES: Final = 36_000
"""Most samples in all figures of one kind together, to keep a report small."""
_FEWEST, _MOST = 90, 600
"""Least and greatest number of samples drawn of one run."""

ProgressWrapper: TypeAlias = Callable[[Iterable["ReportRun"], int], Iterable["ReportRun"]]


@dataclass(frozen=True, slots=True)
class ReportRun:
    """A judged run with the numbers of its trace; ``versions`` are of its software, by name."""

    record: RunRow
    tracks: RunTracks
    coverage: RunCoverage | None = None
    versions: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class ReportData:
    """Input of a report."""

    input: CampaignResults
    runs: tuple[ReportRun, ...]
    buffer: SafetyBuffer
    coverage: Coverage

    @property
    def assessment(self) -> Assessment:
        """The verdicts of all runs, assessed."""
        return self.input.assessment

    @property
    def oracle_texts(self) -> dict[str, str]:
        """The oracles that judged the runs, by name."""
        return {v.oracle: v.text for run in self.runs for v in run.record.verdicts}

    @property
    def references(self) -> tuple[ReferenceComparison, ...]:
        """Every reference value of the campaign beside the same statistic of its runs."""
        return reference_comparisons(self.input.declared.references, self.assessment)


def read_report_data(
    results: CampaignResults,
    specs: Sequence[RunSpec],
    *,
    processes: int | None = None,
    watched: ProgressWrapper | None = None,
) -> ReportData:
    """Read all traces and assess the campaign; ``watched`` may show the progress.

    ``specs`` are those of the runs. Runs without a result are judged by the oracles in their
    traces. A missing or damaged trace leaves a run without tracks, but never without its verdicts.
    """
    texts = tuple(dict.fromkeys(oracle.text for spec in specs for oracle in spec.oracles))
    buffer = safety_buffer(texts, dict.fromkeys(spec.robot.footprint for spec in specs))
    points = max(_FEWEST, min(_MOST, _SAMPLES // max(len(results.rows), 1)))
    oracles.warm_up()
    task = partial(
        _read_run, buffer=buffer, watches=_watches(specs), points=points, machine=results.machine
    )
    reading: Iterable[ReportRun] = parallel_map(
        task, results.rows, doing="that reads traces", processes=processes
    )
    runs = tuple(reading if watched is None else watched(reading, len(results.rows)))
    rows = tuple(run.record for run in runs)
    results = replace(results, rows=rows, assessment=assess(results.declared, rows))
    coverage = sum_coverage([run.coverage for run in runs if run.coverage is not None])
    return ReportData(results, runs, buffer, coverage)


def _watches(specs: Iterable[RunSpec]) -> tuple[Trigger, ...]:
    """Return the triggers of all scenarios: for each joint the first one at each distance."""
    triggers: dict[tuple[str, float], Trigger] = {}
    for spec in specs:
        for behaviour in spec.behaviours:
            if isinstance(behaviour, Trigger):
                triggers.setdefault((behaviour.joint, behaviour.distance), behaviour)
    return tuple(triggers.values())


def _read_run(
    record: RunRow,
    *,
    buffer: SafetyBuffer,
    watches: tuple[Trigger, ...],
    points: int,
    machine: str,
) -> ReportRun:
    if not record.trace:
        return ReportRun(record, RunTracks(problem=record.note or "there is no trace"))
    try:
        trace = read_trace(Path(record.trace), scans=True)
    except TraceError as error:
        return ReportRun(record, RunTracks(problem=error.findings[0].message))
    # After a clock that jumps or a NaN no part of a trace can be trusted; verdicts say so.
    invalid = oracles.trace_problems(trace)
    sampler = None if invalid else SignalSampler(trace)
    if record.result is None and record.state == "done":
        record = judge_row(record, trace, machine, sampler)
    if sampler is None:
        return ReportRun(record, RunTracks(problem="; ".join(invalid)))
    covered = run_coverage(trace)
    tracks = extract_tracks(sampler, buffer, watches, points)
    return ReportRun(record, tracks, covered, tuple(trace.versions.items()))


@dataclass(frozen=True, slots=True)
class MeasureColumn:
    """A measure and its values in each cell (scenario, SUT), in the order of the repeats.

    ``declared`` are the campaign's own names of it.
    """

    measure: RunMeasure
    values: dict[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)
    declared: list[str] = field(default_factory=list)


def measure_columns(data: ReportData) -> tuple[MeasureColumn, ...]:
    """Return every measure with a value: the standard ones, then those declared by the campaign.

    A declared measure with the meaning of a standard one adds its name to that column, and its
    values for missing traces.
    """
    measures = standard_measures(data.buffer)
    columns: dict[str | tuple[str, str], MeasureColumn] = {
        measure.name: MeasureColumn(measure) for measure in measures
    }
    runs = {run.record.id: run for run in data.runs}
    for cell in data.assessment.cells:
        place, here = (cell.scenario, cell.sut), [runs[run] for run in cell.runs]
        for measure in measures:
            measured = (run.tracks.measures for run in here)
            if values := tuple(run[measure.name] for run in measured if measure.name in run):
                columns[measure.name].values[place] = values
        # Separately for each scenario: two may have different oracles of one name.
        texts = {v.oracle: v.text for run in here for v in run.record.verdicts}
        standard = standard_names(texts, data.buffer)
        for own in cell.measures:
            text = texts.get(own.oracle, "")
            key = standard.get(own.oracle) or (own.oracle, text)
            alone = MeasureColumn(RunMeasure(own.oracle, own.unit, "", text, 2))
            column = columns.setdefault(key, alone)
            column.values.setdefault(place, own.values)
            if text and own.oracle not in column.declared:
                column.declared.append(own.oracle)
    return tuple(column for column in columns.values() if column.values)


def report_table(data: ReportData) -> pa.Table:
    """Return the table of results, with the standard measures as further oracles of each run."""
    standard = {measure.name: measure for measure in standard_measures(data.buffer)}
    rows = tuple(
        run.record
        if run.record.result is None
        else replace(run.record, result=replace(
            run.record.result,
            verdicts=(*run.record.verdicts, *_measure_verdicts(run, standard)),
        ))
        for run in data.runs
    )  # fmt: skip
    return results_table(replace(data.input, rows=rows))


def _measure_verdicts(run: ReportRun, standard: Mapping[str, RunMeasure]) -> Iterator[Verdict]:
    declared = {verdict.oracle for verdict in run.record.verdicts}
    for name, value in run.tracks.measures.items():
        if name not in declared:
            measure, evidence = standard[name], Evidence(value=value)
            yield Verdict(name, measure.text, Outcome.MEASURE, None, None, measure.unit, evidence)
