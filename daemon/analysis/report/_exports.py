"""Reports for machines: a table as CSV and Parquet, and JUnit XML.

The table has one row for each number. JUnit has a suite for each cell, a case for each of its
oracles, as build servers read them. Parquet and JUnit take libraries of the extra ``report``.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from daemon.analysis.report._data import ReportData
from daemon.analysis.report._formatting import format_quantity
from daemon.analysis.report._tracks import MEASURES, RunTracks
from daemon.judging.assessment import evidence_text
from daemon.model.assessments import CellAssessment, CellVerdict, ComparisonVerdict, RunRecord
from daemon.model.verdicts import Outcome
from grammars.text.diagnostics import Diagnostic, InputError, Where
from templates.naming import xml_text


def require_extra(module: str, purpose: str) -> ModuleType:
    """Import a library of the extra ``report``.

    Raises :class:`InputError` that says how to get it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        message = f"{purpose} takes the library {name}, which is not installed"
        hint = 'install it with: pip install "scenario-tui[report]"'
        raise InputError(Diagnostic(Where("scenario report"), message, hint)) from error


COLUMNS: Final = (
    "campaign", "scenario", "sut", "repeat", "run", "digest", "outcome",
    "kind", "name", "value", "unit", "verdict", "time", "object",
)  # fmt: skip
"""``kind`` is ``measure`` (of every run), ``oracle`` (``value`` is its signed margin, ``time`` and
``object`` its evidence) or ``oracle-measure`` (an oracle without a limit)."""

Row = tuple[str | int | float | None, ...]


def table_rows(data: ReportData) -> Iterator[Row]:
    """Return one row for each number of each run, in the order of :data:`COLUMNS`."""
    for run in data.runs:
        record = run.record
        head: Row = (
            data.input.name,
            record.scenario,
            record.sut,
            record.repeat,
            record.id,
            record.digest,
            str(record.outcome or record.state),
        )
        yield from ((*head, *row) for row in (*_measure_rows(run.tracks), *_verdict_rows(record)))


def _measure_rows(tracks: RunTracks) -> Iterator[Row]:
    for measure in MEASURES:
        if measure.name in tracks.measures:
            value = tracks.measures[measure.name]
            yield ("measure", measure.name, value, measure.unit, "", None, "")


def _verdict_rows(record: RunRecord) -> Iterator[Row]:
    for verdict in record.verdicts:
        seen = verdict.evidence
        measure = verdict.outcome is Outcome.MEASURE
        yield (
            "oracle-measure" if measure else "oracle",
            verdict.oracle,
            seen.value if measure else verdict.margin,
            verdict.unit,
            str(verdict.outcome),
            seen.time,
            seen.object,
        )


def write_csv(data: ReportData, path: Path) -> None:
    """Write the table as CSV (UTF-8, RFC 4180, numbers in full precision)."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(table_rows(data))


def write_parquet(data: ReportData, path: Path) -> None:
    """Write the table as Parquet; raises :class:`InputError` without the extra ``report``."""
    arrow = require_extra("pyarrow", "a Parquet file")
    parquet = require_extra("pyarrow.parquet", "a Parquet file")
    columns: Sequence[tuple[str | int | float | None, ...]] = tuple(
        zip(*table_rows(data), strict=True)
    ) or ((),) * len(COLUMNS)
    # Declared, not inferred: a column of nothing but gaps would get no type, and files of two
    # campaigns could not be read together.
    kinds = {"repeat": arrow.int64(), "value": arrow.float64(), "time": arrow.float64()}
    fields = [arrow.field(name, kinds.get(name, arrow.string())) for name in COLUMNS]
    arrays = [arrow.array(c, type=f.type) for c, f in zip(columns, fields, strict=True)]
    parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields)), path)


def write_junit(data: ReportData, path: Path) -> None:
    """Write what :func:`daemon.judging.assessment.assess` made of the campaign.

    FAIL is a failure, ERROR an error, INCONCLUSIVE an error of type ``inconclusive``; what fails
    as expected is skipped (``xfail: why``), what passes against expectation a failure of type
    ``xpass``. Raises :class:`InputError` without the extra ``report``.
    """
    junit = require_extra("junitparser", "a JUnit file")
    xml = junit.JUnitXml(xml_text(data.input.name))
    wall = {run.record.id: run.record.timing.wall for run in data.runs if run.record.timing}
    for cell in data.assessment.cells:
        suite = junit.TestSuite(xml_text(f"{cell.scenario}/{cell.sut}"))
        for case in _cell_cases(cell, data, junit):
            suite.add_testcase(case)
        suite.update_statistics()
        suite.time = round(sum(wall.get(run, 0.0) for run in cell.runs), 3)
        xml.add_testsuite(suite)
    if data.assessment.comparisons:
        suite = junit.TestSuite("comparisons")
        for comparison in data.assessment.comparisons:
            suite.add_testcase(_comparison_case(comparison, data, junit))
        suite.update_statistics()
        xml.add_testsuite(suite)
    xml.update_statistics()
    xml.write(str(path), pretty=True)


def _cell_cases(cell: CellAssessment, data: ReportData, junit: Any) -> list[Any]:
    place = f"{data.input.name}.{cell.scenario}.{cell.sut}"
    if not cell.oracles:
        case = junit.TestCase("runs", xml_text(place))
        case.result = [junit.Error("no run was judged by any oracle", str(cell.verdict))]
        return [case]
    return [_oracle_case(oracle, place, data, junit) for oracle in cell.oracles]


def _oracle_case(oracle: CellVerdict, place: str, data: ReportData, junit: Any) -> Any:
    case = junit.TestCase(xml_text(oracle.oracle), xml_text(place))
    case.result = _case_result(oracle, oracle.passed > 0, _summary(oracle), junit)
    lines = [
        f"{run.record.id}: {verdict.outcome}  {evidence_text(verdict)}"
        for run in data.runs
        if (run.record.scenario, run.record.sut) == (oracle.scenario, oracle.sut)
        and (verdict := run.record.verdict(oracle.oracle)) is not None
    ]
    case.system_out = xml_text("\n".join(lines))
    return case


def _summary(oracle: CellVerdict) -> str:
    parts = [f"{oracle.passed} of {oracle.n} pass"]
    if oracle.worst is not None:
        parts.append(f"worst in {oracle.worst.run}: {evidence_text(oracle.worst.verdict)}")
        parts.append(oracle.worst.verdict.text)
    return "; ".join(parts)


def _comparison_case(cell: ComparisonVerdict, data: ReportData, junit: Any) -> Any:
    case = junit.TestCase(
        xml_text(f"{cell.comparison} {cell.sut}"), xml_text(f"{data.input.name}.comparisons")
    )
    said = f"mean {format_quantity(cell.mean, cell.unit, signed=True)}, n={cell.n}: {cell.text}"
    passed = cell.verdict is Outcome.PASS
    case.result = _case_result(cell, passed, f"{said}; {cell.note}" if cell.note else said, junit)
    return case


def _case_result(
    cell: CellVerdict | ComparisonVerdict, passed: bool, said: str, junit: Any
) -> list[Any]:
    # JUnit knows no expectations and no third verdict. As pytest does: what fails as expected is
    # skipped, what passes against expectation fails; inconclusive is an error, so that a build that
    # shows nothing is not green.
    message = xml_text(said)
    if cell.expected != "pass" and cell.met:
        if cell.verdict is Outcome.PASS:
            return []
        return [junit.Skipped(xml_text(f"xfail: {cell.why}"), "xfail")]
    if cell.verdict is Outcome.ERROR:
        return [junit.Error(message, "error")]
    if cell.expected != "pass" and passed:
        text = f"expected {cell.expected} ({cell.why}), but {said}"
        return [junit.Failure(xml_text(text), "xpass")]
    if cell.verdict is Outcome.INCONCLUSIVE:
        return [junit.Error(message, "inconclusive")]
    return [junit.Failure(message, "fail")] if cell.verdict is Outcome.FAIL else []
