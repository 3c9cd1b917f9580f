"""Reports for machines: a table as CSV and Parquet, one row for each number."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from daemon.analysis.report._data import ReportData
from daemon.analysis.report._measures import MEASURES
from daemon.analysis.report._tracks import RunTracks
from daemon.model.assessments import ReferenceValue
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome

COLUMNS: Final = (
    "campaign", "scenario", "sut", "repeat", "run", "digest", "outcome",
    "kind", "name", "value", "unit", "verdict", "time", "object",
)  # fmt: skip
"""``kind`` is ``measure`` (of every run), ``oracle`` (``value`` is its signed margin, ``time`` and
``object`` its evidence), ``oracle-measure`` (an oracle without a limit) or, of no run,
``reference`` (what somebody else found; ``object`` says who) and ``reference-deviation``."""

_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""What makes spreadsheets take a cell for a formula, also after an import; as OWASP lists it."""
_NUMBER: Final = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", re.ASCII)

Row = tuple[str | int | float | None, ...]


def table_rows(data: ReportData) -> Iterator[Row]:
    """Return one row for each number of each run, in the order of :data:`COLUMNS`."""
    for run in data.runs:
        record = run.record
        head: Row = (
            data.input.row.name,
            record.scenario,
            record.sut,
            record.repeat,
            record.id,
            record.digest,
            str(record.outcome or record.state),
        )
        yield from ((*head, *row) for row in (*_measure_rows(run.tracks), *_verdict_rows(record)))
    for compared in data.references:
        of: Row = (data.input.row.name, compared.scenario, compared.sut, None, "", "", "")
        yield from ((*of, *row) for row in _reference_rows(compared.reference))


def _reference_rows(reference: ReferenceValue) -> Iterator[Row]:
    what, unit = f"{reference.oracle} {reference.statistic}", reference.unit
    named = (unit, "", None, f"{reference.name}: {reference.source}")
    yield ("reference", what, reference.value, *named)
    if reference.deviation is not None:
        yield ("reference-deviation", what, reference.deviation, *named)


def _measure_rows(tracks: RunTracks) -> Iterator[Row]:
    for measure in MEASURES:
        if measure.name in tracks.measures:
            value = tracks.measures[measure.name]
            yield ("measure", measure.name, value, measure.unit, "", None, "")


def _verdict_rows(record: RunRow) -> Iterator[Row]:
    for verdict in record.verdicts:
        evidence = verdict.evidence
        measure = verdict.outcome is Outcome.MEASURE
        yield (
            "oracle-measure" if measure else "oracle",
            verdict.oracle,
            evidence.value if measure else verdict.margin,
            verdict.unit,
            str(verdict.outcome),
            evidence.time,
            evidence.object,
        )


def write_csv(data: ReportData, path: Path) -> None:
    """Write the table as CSV (UTF-8, RFC 4180, numbers in full precision).

    Texts that a spreadsheet would calculate get an apostrophe in front.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(map(_plain_cells, table_rows(data)))


def _plain_cells(row: Row) -> Row:
    return tuple(_plain_cell(cell) if isinstance(cell, str) else cell for cell in row)


def _plain_cell(text: str) -> str:
    """Return text that spreadsheets show and do not calculate (CWE-1236)."""
    calculated = text.startswith(_FORMULA) and not _NUMBER.fullmatch(text)
    return f"'{text}" if calculated else text


def write_parquet(data: ReportData, path: Path) -> None:
    """Write the table as Parquet."""
    # Half a second of libraries that only this format takes.
    import pyarrow
    import pyarrow.parquet

    # Declared, not inferred: a column of nothing but gaps would get no type, and files of two
    # campaigns could not be read together.
    kinds = {"repeat": pyarrow.int64(), "value": pyarrow.float64(), "time": pyarrow.float64()}
    schema = pyarrow.schema((name, kinds.get(name, pyarrow.string())) for name in COLUMNS)
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in table_rows(data)]
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows, schema), path)
