"""The command that shows the results of a campaign; others print the same summary."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from grammars.text.words import count_noun
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.compare import compare_with_baseline, print_comparison
from scenario_tui.cli.options import Baseline, TableFile, WorseBy
from scenario_tui.cli.output import plain_table, print_commands, print_line, stdout_console
from scenario_tui.cli.search import search_answer
from scenario_tui.source import DaemonTarget, find_campaign, open_source, with_time_left
from scenario_tui.text.formatting import margin

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults, ComparedResults
    from daemon.judging.assessment import CampaignDifference, Expectations
    from daemon.model.status import RunRow
    from scenario_tui.cli.values import SearchResult

_WIDE: Final = 120
"""Columns of a terminal from which on a table has room for paths."""


def results(
    target: DaemonTarget,
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Id or name of a campaign, or its beginning; a folder of traces, a trace or a "
            "file of results. Default: the newest campaign.",
            autocompletion=completion.offers(completion.campaigns, completion.files(".json")),
        ),
    ] = "",
    runs: Annotated[bool, "List every run and its trace."] = False,
    outcome: Annotated[
        Literal["pass", "fail", "inconclusive", "error"] | None, "List only runs with this verdict."
    ] = None,
    text: Annotated[
        str,
        typer.Option(
            "--filter",
            help="List only runs that mention this text.",
            autocompletion=completion.offers(completion.names_in_campaign),
        ),
    ] = "",
    exit_status: Annotated[
        bool, "Exit with the code of the campaign: 0 as expected, 1 not, 3 broken, 4 open."
    ] = False,
    baseline: Baseline = "",
    worse_by: WorseBy = None,
    table: TableFile = None,
) -> Answer[ComparedResults] | Answer[SearchResult]:
    """Show the results of a campaign: every cell, and why cells are not as expected."""
    from daemon.analysis.results import ComparedResults, read_results

    is_listed = bool(outcome or text)
    with open_source(campaign, target) as source:
        row = find_campaign(source, campaign)
        search = source.search_row(row.id) if row.search and not is_listed else None
        whole = read_results(source, row)
        # Filters choose what is listed; the verdict is always about all runs.
        rows = whole.rows
        if is_listed:
            rows = source.all_runs(row.id, outcome=outcome or "", text=text)
    if table is not None:
        from daemon.analysis.table import results_table, write_table

        cells = results_table(whole)
        write_table(cells, table)
        target.say(f"{table}: {count_noun(cells.num_rows, 'row')}")
    if search is not None:
        if baseline:
            message = "does not apply to a search, which has no verdicts to compare"
            raise typer.BadParameter(message, param_hint="--baseline")
        answer = search_answer(search, rows, target)
        code = answer.code if exit_status else ExitCode.EXPECTED
        return replace(answer, text=partial(_print_search, answer, rows, runs), code=code)
    whole = replace(whole, row=with_time_left(whole.row, target))
    between = compare_with_baseline(whole, baseline, worse_by, target)
    print_text = partial(_print_listed, rows, whole)
    if not is_listed:
        print_text = partial(_print_results, whole, between, runs, target)
    value = ComparedResults.of(replace(whole, rows=rows), between)
    code = value.exit_code if exit_status or baseline else ExitCode.EXPECTED
    return Answer("results", value, print_text, code)


def _print_search(answer: Answer[SearchResult], rows: tuple[RunRow, ...], listed: bool) -> None:
    """Print the answer of a search, which has no matrix of verdicts."""
    answer.text()
    if listed:
        stdout_console().print()
        _print_runs(rows)


def print_summary(results: CampaignResults, baseline: CampaignDifference | None = None) -> None:
    """Print the matrix of cells, the unexpected ones, and the changes since the baseline."""
    from scenario_tui.text.summary import summary_parts

    row, console = results.row, stdout_console()
    took = None if row.finished_at is None else row.finished_at - row.submitted_at
    for part in summary_parts(results, took=took):
        console.print(part, crop=False)
    for file, problem in results.unread:
        print_line(f"not read: {file}: {problem}")
    if baseline is not None:
        print_comparison(baseline)


def _print_results(
    results: CampaignResults,
    comparison: CampaignDifference | None,
    listed: bool,
    target: DaemonTarget,
) -> None:
    row, rows = results.row, results.rows
    print_summary(results, comparison)
    if listed:
        _print_runs(rows, results.expectations)
    _print_folder(rows)
    more = (target.command("results", row.id, "--runs"), "every run and its trace")
    if listed and rows:
        more = (target.command("show", rows[0].id), "one run: the verdict of each oracle")
    # The dashboard shows a daemon, not a folder; a page needs more than a file of results.
    page = (target.command("report", row.id), "one page with figures")
    whole = [page] if row.ended and not row.id.endswith(".json") else []
    whole += [] if Path(row.id).exists() else [(target.command("tui"), "the dashboard")]
    print_commands(more, *whole)


def _print_folder(rows: tuple[RunRow, ...]) -> None:
    traces = [run.trace for run in rows if run.trace]
    if traces:
        folders = {trace.rpartition("/")[0] or "." for trace in traces}
        place = count_noun(len(folders), "folder") if len(folders) > 1 else folders.pop()
        where = f"{count_noun(len(traces), 'trace')} in {place}"
        if len(traces) == 1:
            where = f"1 trace: {traces[0]}"
        print_line(where)


def _print_listed(rows: tuple[RunRow, ...], results: CampaignResults) -> None:
    from scenario_tui.text.run_text import known_text

    if not rows:
        print_line("no run matches")
        return
    marks = results.expectations
    _print_runs(rows, marks)
    letters = "".join(marks.mark(row).letter for row in rows)
    for mark in marks.failures:
        if mark.letter in letters:
            print_line(known_text(mark))
    _print_folder(rows)


def _print_runs(rows: tuple[RunRow, ...], expectations: Expectations | None = None) -> None:
    from scenario_tui.text.run_text import marked_word

    console = stdout_console()
    # Narrow columns would break paths; the folder of all traces is printed below.
    paths = console.width >= _WIDE
    remarks = paths or any(row.reason or row.cached for row in rows)
    more = ("trace" if paths else "remark",) if remarks else ()
    table = plain_table("run", "", "verdict", "decided by", "margin", *more)
    # People copy names, so a narrow table shortens the labels of runs instead.
    table.columns[0].no_wrap, table.columns[1].overflow = True, "ellipsis"
    for row in rows:
        value = margin(row.margin, row.unit) if row.oracle else ""
        # In a folder a run has the name of its trace; the folder is printed below.
        name = row.id if paths or row.id != row.trace else row.id.rpartition("/")[2]
        remark = (paths and row.trace != row.id and row.trace) or row.reason
        if row.cached:
            remark += " (cached)" if remark else "cached"
        word = marked_word(row, expectations)
        more = (remark,) if remarks else ()
        table.add_row(name, row.label, word, row.oracle, value, *more)
    console.print(table)
