"""All measures and margins of all runs as a table: CSV and Parquet, one row for each number."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from daemon.assessment import RunRecord
from daemon.report._extra import needed
from daemon.report._gather import Material
from daemon.report._series import MEASURES
from daemon.report._types import Driven
from daemon.verdict import Outcome

COLUMNS: Final = (
    "campaign", "scenario", "sut", "repeat", "run", "digest", "outcome",
    "kind", "name", "value", "unit", "verdict", "time", "object",
)  # fmt: skip
"""``kind`` is ``measure`` (of every run), ``oracle`` (``value`` is its signed margin, ``time`` and
``object`` its evidence) or ``oracle-measure`` (an oracle without a limit)."""

Row = tuple[str | int | float | None, ...]


def rows(material: Material) -> Iterator[Row]:
    """Return one row for each number of each run, in the order of :data:`COLUMNS`."""
    for run in material.runs:
        record = run.record
        head: Row = (
            material.chosen.name,
            record.scenario,
            record.sut,
            record.repeat,
            record.id,
            record.digest,
            str(record.outcome or record.state),
        )
        yield from ((*head, *row) for row in (*_measured(run.driven), *_judged(record)))


def _measured(driven: Driven) -> Iterator[Row]:
    for measure in MEASURES:
        if measure.name in driven.measures:
            value = driven.measures[measure.name]
            yield ("measure", measure.name, value, measure.unit, "", None, "")


def _judged(record: RunRecord) -> Iterator[Row]:
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


def write_csv(material: Material, path: Path) -> None:
    """Write the table as CSV (UTF-8, RFC 4180, numbers in full precision)."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(rows(material))


def write_parquet(material: Material, path: Path) -> None:
    """Write the table as Parquet; raises :class:`InputError` without the extra ``report``."""
    arrow = needed("pyarrow", "a Parquet file")
    parquet = needed("pyarrow.parquet", "a Parquet file")
    columns: Sequence[tuple[str | int | float | None, ...]] = tuple(
        zip(*rows(material), strict=True)
    ) or ((),) * len(COLUMNS)
    kinds = {"repeat": arrow.int64(), "value": arrow.float64(), "time": arrow.float64()}
    fields = [arrow.field(name, kinds.get(name, arrow.string())) for name in COLUMNS]
    arrays = [arrow.array(c, type=f.type) for c, f in zip(columns, fields, strict=True)]
    parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields)), path)
