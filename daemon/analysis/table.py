"""Results of a campaign as a table: one row per run and oracle, for pandas, polars and DuckDB."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from daemon.model.assessments import CellVerdict, ExpectationStatus
from daemon.model.status import RunRow
from daemon.model.verdicts import Verdict
from grammars.text.diagnostics import Finding, InputError, Where

if TYPE_CHECKING:
    import pyarrow as pa

    from daemon.analysis.results import CampaignResults


@dataclass(frozen=True, slots=True)
class Field:
    """Column of the table: ``kind`` names its Arrow type, ``unit`` may be empty."""

    name: str
    kind: str
    unit: str
    about: str


COLUMNS: Final = (
    Field("campaign", "string", "", "id of the campaign, the path of a folder of traces"),
    Field("scenario", "string", "", "scenario of the campaign"),
    Field("system", "string", "", "system under test"),
    Field("repeat", "int64", "", "number of the repeat, from 0"),
    Field("run", "string", "", "id of the run, for `scenario show`, `replay` and `plot`"),
    Field("oracle", "string", "", "name of the oracle, null in the row of a run without verdicts"),
    Field("verdict", "string", "", "`pass`, `fail`, `inconclusive`, `error` or `measure`"),
    Field("margin", "float64", "see unit", "decisive bound of the margin, negative for `fail`"),
    Field("margin_lower", "float64", "see unit", "lower bound, null for an unbounded margin"),
    Field("margin_upper", "float64", "see unit", "upper bound, null for an unbounded margin"),
    Field("unit", "string", "", "unit of margin, value and threshold"),
    Field("value", "float64", "see unit", "the value that decides, the number of a measure"),
    Field("threshold", "float64", "see unit", "limit for the value"),
    Field("moment", "float64", "s", "simulated time of that value"),
    Field("about", "string", "", "object that decides, `kitchen_door.leaf` for example"),
    Field("note", "string", "", "remark of the oracle"),
    Field("expected", "string", "", "verdict that the campaign expects: `pass`, `fail`, `mixed` or "
           "`any`; null for a measure"),
    Field("as_expected", "bool", "", "whether all repeats together are as expected, null if open"),
    Field("why", "string", "", "reason in the campaign for an expected verdict other than `pass`"),
    Field("state", "string", "", "`queued`, `running`, `done`, `lost` or `cancelled`"),
    Field("outcome", "string", "", "verdict of the run as a whole"),
    Field("ended", "string", "", "`finished`, `limit` or `crashed`"),
    Field("simulated", "float64", "s", "simulated time of the run"),
    Field("wall", "float64", "s", "wall time that the run took"),
    Field("started", "timestamp", "UTC", "when the run started, by the clock of its machine"),
    Field("seed", "uint64", "", "root of everything random in the run"),
    Field("digest", "string", "", "digest of the specification of the run"),
    Field("trace", "string", "", "path of the trace on the machine that keeps it"),
)  # fmt: skip
"""Columns in order. Their names need no quotes in SQL."""

_FORMULA: Final = "^[=+\\-@\t\r\n＝＋－＠]"
"""First characters of cells that spreadsheets read as formulas, from OWASP's list."""
_NUMBER: Final = r"^[+-]?\d+(\.\d*)?([eE][+-]?\d+)?$"


def results_table(results: CampaignResults) -> pa.Table:
    """Return one row per run and oracle, and one for each run without verdicts.

    Rows are in the order of the runs and of their oracles. The columns are :data:`COLUMNS`, each
    with ``unit`` and ``about`` in the metadata of its field.
    """
    import pyarrow as pa

    kinds = {"timestamp": pa.timestamp("us", tz="UTC")}
    schema = pa.schema(
        pa.field(
            column.name,
            kinds.get(column.kind) or pa.type_for_alias(column.kind),
            metadata={"unit": column.unit, "about": column.about},
        )
        for column in COLUMNS
    )
    columns = list(zip(*_rows(results), strict=True)) or [()] * len(COLUMNS)
    return pa.Table.from_arrays(
        [pa.array(values, field.type) for values, field in zip(columns, schema, strict=True)],
        schema=schema,
    )


def _rows(results: CampaignResults) -> Iterator[tuple[object, ...]]:
    cells = results.assessment.cells
    judged = {(o.scenario, o.sut, o.oracle): o for cell in cells for o in cell.oracles}
    campaign = results.row.id
    for run in results.rows:
        head = (campaign, run.scenario, run.sut, run.repeat, run.id)
        tail = _run_cells(run)
        for verdict in run.verdicts or (None,):
            cell = judged.get((run.scenario, run.sut, verdict.oracle)) if verdict else None
            yield (*head, *_verdict_cells(verdict), *_expectation_cells(cell), *tail)


def _verdict_cells(verdict: Verdict | None) -> tuple[object, ...]:
    if verdict is None:
        return (None,) * 11
    evidence = verdict.evidence
    return (
        verdict.oracle,
        str(verdict.outcome),
        verdict.margin,
        verdict.lower,
        verdict.upper,
        verdict.unit,
        evidence.value,
        evidence.limit,
        evidence.time,
        evidence.object or None,
        evidence.note_text or None,
    )


def _expectation_cells(cell: CellVerdict | None) -> tuple[object, ...]:
    if cell is None:
        return (None, None, None)
    as_expected = None
    if cell.status is not ExpectationStatus.OPEN:
        as_expected = cell.status is ExpectationStatus.MET
    return (cell.expected, as_expected, cell.why or None)


def _run_cells(run: RunRow) -> tuple[object, ...]:
    started = run.result.timing.started if run.result else 0.0
    return (
        str(run.state),
        None if run.outcome is None else str(run.outcome),
        run.ended or None,
        run.simulated if run.result else None,
        run.wall if run.result else None,
        datetime.fromtimestamp(started, UTC) if started else None,
        run.seed,
        run.digest or None,
        run.trace or None,
    )


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet, CSV or an Arrow file, by the ending of ``path``.

    Raises :class:`InputError` for other endings and for a file that cannot be written.
    """
    write = table_writer(path)
    try:
        write(table, path)
    except OSError as error:
        message = f"cannot be written: {error.strerror or error}"
        raise InputError(Finding(Where(str(path)), message)) from error


def table_writer(path: Path) -> Callable[[pa.Table, Path], None]:
    """Return the writer for the ending of ``path``; raises :class:`InputError` for unknown ones."""
    if path.suffix in _WRITERS:
        return _WRITERS[path.suffix]
    message = f"a table ends with {', '.join(_WRITERS)}, not with {path.suffix or 'nothing'}"
    raise InputError(Finding(Where(str(path)), message, f"write {path.stem}.parquet"))


def _write_parquet(table: pa.Table, path: Path) -> None:
    import pyarrow.parquet

    pyarrow.parquet.write_table(table, path)


def _write_csv(table: pa.Table, path: Path) -> None:
    """Write CSV in UTF-8, with an apostrophe before texts that a spreadsheet would calculate."""
    import pyarrow as pa
    import pyarrow.csv

    for index, field in enumerate(table.schema):
        if pa.types.is_string(field.type):
            table = table.set_column(index, field, _plain_cells(table.column(index)))
    pyarrow.csv.write_csv(table, path)


def _plain_cells(texts: Any) -> Any:
    """Return texts that spreadsheets show instead of calculating them (CWE-1236)."""
    import pyarrow.compute as pc

    formula = pc.match_substring_regex(texts, _FORMULA)
    number = pc.match_substring_regex(texts, _NUMBER)
    guarded = pc.binary_join_element_wise("'", texts, "")
    return pc.if_else(pc.and_not(formula, number), guarded, texts)


def _write_arrow(table: pa.Table, path: Path) -> None:
    import pyarrow as pa

    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_file(file, table.schema) as writer:
        writer.write_table(table)


_WRITERS: Final[dict[str, Callable[[Any, Path], None]]] = {
    ".parquet": _write_parquet,
    ".csv": _write_csv,
    ".arrow": _write_arrow,
}
