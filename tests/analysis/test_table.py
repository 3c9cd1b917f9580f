"""The table of results: a row for each run and oracle, read by what people ask tables with."""

import csv
import math
from dataclasses import replace

import pyarrow as pa
import pyarrow.csv
import pyarrow.ipc
import pyarrow.parquet
import pytest

from daemon.analysis.results import CampaignResults
from daemon.analysis.table import COLUMNS, results_table, write_table
from daemon.judging.assessment import assess
from daemon.model.assessments import AssessmentRules, Expectation
from daemon.model.spec import Timing
from daemon.model.verdicts import Evidence, Outcome, RunState, Verdict
from grammars.text.diagnostics import InputError
from tests.make import campaign_row, run_result, run_row, with_result

WHY = "the door is 5 cm too narrow"
DECLARED = AssessmentRules(expectations=(Expectation("S1", "keeps-clear", ("*",), "fail", WHY),))
DOOR = Evidence(time=24.5, value=0.02, limit=0.05, object="kitchen_door.leaf", note="at 24.54 s")
KEEPS_CLEAR = Verdict("keeps-clear", "", Outcome.FAIL, -math.inf, -0.03, "m", DOOR)
IN_TIME = Verdict("in-time", "", Outcome.PASS, 10.5, 10.5, "s", Evidence(109.5, 109.5, 120.0))
DISTANCE = Verdict("distance", "", Outcome.MEASURE, None, None, "m", Evidence(value=12.5))


def table_of(*rows):
    row = campaign_row("c", name="corridor", total=len(rows))
    return results_table(CampaignResults(row, rows, DECLARED, assess(DECLARED, rows)))


def judged(*verdicts, **more):
    verdicts = verdicts or (KEEPS_CLEAR, IN_TIME, DISTANCE)
    return run_row("c.0", result=run_result(*verdicts), seed=2**63 + 1, digest="d", **more)


def test_a_row_says_what_an_oracle_found_in_a_run_or_that_there_is_no_result(tmp_path, golden):
    states = RunState.LOST, RunState.QUEUED, RunState.CANCELLED
    without = [run_row(f"c.{n}", repeat=n, state=s, trace="") for n, s in enumerate(states, 1)]
    timed = with_result(judged(), timing=Timing(2.5, 2.0, 60.0, 1_700_000_000.0))
    # More repeats will decide: neither as expected nor not.
    open_one = judged(replace(KEEPS_CLEAR, outcome=Outcome.INCONCLUSIVE, upper=0.1))
    path, texts = tmp_path / "table.csv", []
    for rows in ([timed], without, [open_one]):
        write_table(table_of(*rows), path)
        texts.append(path.read_text("utf-8"))
    golden("table.csv", "".join(texts))


def test_the_schema_is_the_same_for_every_campaign_and_has_units():
    empty, table = table_of(), table_of(judged())
    assert empty.num_rows == 0
    assert empty.schema == table.schema
    assert empty.column_names == [column.name for column in COLUMNS]
    assert empty.schema.field("wall").metadata[b"unit"] == b"s"
    assert table_of(judged()).equals(table)


def test_polars_pandas_and_duckdb_read_the_table_as_it_is_without_quotes_for_names():
    import duckdb
    import pandas as pd
    import polars as pl

    rows = table_of(judged())
    names = ", ".join(column.name for column in COLUMNS)
    assert duckdb.sql(f"SELECT {names} FROM rows").shape == (rows.num_rows, len(COLUMNS))
    oracles = [oracle for (oracle,) in duckdb.sql("SELECT oracle FROM rows").fetchall()]
    assert [*pl.DataFrame(rows)["oracle"]] == [*pd.DataFrame.from_arrow(rows)["oracle"]] == oracles


@pytest.mark.parametrize("ending", ["parquet", "csv", "arrow"])
def test_every_file_has_the_same_table(tmp_path, ending):
    path = tmp_path / f"table.{ending}"
    table = table_of(judged(), run_row("c.1", repeat=1, trace=""))
    write_table(table, path)
    options = pa.csv.ConvertOptions(column_types=table.schema, strings_can_be_null=True)
    readers = {
        "parquet": pa.parquet.read_table,
        "arrow": lambda path: pa.ipc.open_file(path).read_all(),
        "csv": lambda path: pa.csv.read_csv(path, convert_options=options),
    }
    assert readers[ending](path).to_pylist() == table.to_pylist()


FORMULAS = ("=1+1", "+1+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "\n=1", "＝1")
PLAIN = ("-1.5", "+1e-3", "plain", "a=b")


@pytest.mark.parametrize(
    ("name", "cell"), [*((one, f"'{one}") for one in FORMULAS), *zip(PLAIN, PLAIN, strict=True)]
)
def test_no_name_becomes_a_formula_of_a_spreadsheet(tmp_path, name, cell):
    path = tmp_path / "table.csv"
    write_table(table_of(judged(scenario=name)), path)
    with path.open(encoding="utf-8", newline="\n") as file:
        rows = list(csv.DictReader(file))
    assert {row["scenario"] for row in rows} == {cell}
    # Numbers stay numbers, also those with a minus.
    assert rows[0]["margin"] == "-0.03"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("table.xlsx", "a table ends with .parquet, .csv, .arrow, not with .xlsx"),
        ("table", "not with nothing"),
        ("none/table.csv", "cannot be written"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused(tmp_path, name, message):
    with pytest.raises(InputError, match=message):
        write_table(table_of(), tmp_path / name)
