"""Commands that look at what came out: results, show."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Final, TypeAlias

import typer

from daemon.batch.errors import Unreachable
from scenario_tui.cli import completion
from scenario_tui.cli.options import AsJson, Baseline, Connect, State, WorseBy
from scenario_tui.cli.output import Output, plain_table, say, show_progress, stdout_console

if TYPE_CHECKING:
    from collections.abc import Iterable

    from daemon.model.search import SearchTask
    from daemon.model.search_answer import SearchRow
    from daemon.model.spec import Snapshot
    from daemon.model.status import CampaignRow, RunDetail, RunRow

_WIDE: Final = 120
"""Columns from which on a table has room for paths."""


def results(
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Id or name of a campaign, or how it begins. Default: the newest.",
            autocompletion=completion.offers(completion.campaigns),
        ),
    ] = "",
    runs: Annotated[bool, typer.Option("--runs", help="List every run and its trace.")] = False,
    state: State = None,
    outcome: Annotated[
        str,
        typer.Option(
            "--outcome",
            help="List only runs with this verdict, pass, fail ...",
            autocompletion=completion.offers(
                completion.words("pass", "fail", "inconclusive", "error")
            ),
        ),
    ] = "",
    text: Annotated[
        str,
        typer.Option(
            "--filter",
            help="List only runs that mention this text.",
            autocompletion=completion.offers(completion.names_in_campaign),
        ),
    ] = "",
    exit_status: Annotated[
        bool,
        typer.Option(
            "--exit-status",
            help="Leave with the code of the campaign: 0 as expected, 1 not, 3 broken, 4 open.",
        ),
    ] = False,
    baseline: Baseline = "",
    worse_by: WorseBy = None,
    connect: Connect = "",
    as_json: AsJson = False,
) -> None:
    """Show what came out of a campaign: every cell, what is not as expected and why."""
    from daemon.analysis.results import read_results
    from scenario_tui.cli.compare import compare_with_baseline, final_code, print_comparison
    from scenario_tui.cli.results import emit_results, print_summary
    from scenario_tui.cli.search import read_search
    from scenario_tui.source import DaemonTarget, find_campaign_or_search, open_source

    target = DaemonTarget(connect, state, say, show_progress)
    with open_source(campaign, target) as daemon:
        row = find_campaign_or_search(daemon, campaign)
        listed = outcome or text
        if row.search and not listed:
            _refuse_baseline(baseline)
            answer = read_search(daemon, row.id, runs=as_json)
            rows = daemon.all_runs(row.id) if runs else ()
            _show_search(answer, rows, exit_status=exit_status, as_json=as_json)
            return
        found = read_results(daemon, row)
        # Filters choose what is listed; the verdict is always about all runs.
        rows = found.rows
        if listed:
            rows = daemon.all_runs(row.id, outcome=outcome, text=text)
    between = compare_with_baseline(found, baseline, worse_by, target)
    if as_json:
        emit_results(replace(found, rows=rows), comparison=between)
    elif listed:
        _print_runs(rows)
    else:
        print_summary(found, took=_elapsed(row))
        if between is not None:
            print_comparison(between)
        if runs:
            _print_runs(rows)
        _print_trace_folder(row, rows, listed=runs)
    if exit_status or baseline:
        raise typer.Exit(final_code(found, between))


def _show_search(
    answer: tuple[SearchRow, tuple[RunRow, ...]],
    runs: tuple[RunRow, ...],
    *,
    exit_status: bool,
    as_json: bool,
) -> None:
    """Show a search in place of a matrix of verdicts, which it has not."""
    from scenario_tui.cli.answer import write_json
    from scenario_tui.cli.search import search_answer

    found = search_answer(*answer)
    if as_json:
        write_json(found.schema, found.value)
    else:
        found.text()
    if runs and not as_json:
        _print_runs(runs)
    if exit_status:
        raise typer.Exit(found.code)


def _refuse_baseline(baseline: str) -> None:
    if baseline:
        message = "a search has no verdicts to hold against others"
        raise typer.BadParameter(message, param_hint="--baseline")


def _elapsed(row: CampaignRow) -> float | None:
    return None if row.finished_at is None else row.finished_at - row.submitted_at


def _print_trace_folder(row: CampaignRow, rows: tuple[RunRow, ...], *, listed: bool) -> None:
    from grammars.text.words import count_noun
    from scenario_tui.cli.results import print_commands

    traces = [run.trace for run in rows if run.trace]
    if traces:
        where = f"{count_noun(len(traces), 'trace')} in {traces[0].rpartition('/')[0]}"
        stdout_console().print(where, markup=False, soft_wrap=True)
    runs = (f"scenario results {row.id} --runs", "every run and its trace")
    one = (f"scenario show {rows[0].id if rows else 'RUN'}", "one run: what each oracle says")
    print_commands(one if listed else runs, ("scenario tui", "the dashboard"))


def _print_runs(rows: tuple[RunRow, ...]) -> None:
    from rich.text import Text

    from scenario_tui.text.formatting import (
        TERMINAL_STYLES,
        glyph_word,
        margin,
        run_label,
        run_word,
    )

    console = stdout_console()
    # Paths would be folded into columns of letters; below, the folder of all of them is said.
    paths = console.width >= _WIDE
    remarks = paths or any(row.reason or row.cached for row in rows)
    more = ("trace" if paths else "remark",) if remarks else ()
    table = plain_table("run", "", "verdict", "decided by", "margin", *more)
    for row in rows:
        word = Text(glyph_word(run_word(row)), style=TERMINAL_STYLES[run_word(row)])
        shown = margin(row.margin, row.unit) if row.oracle else ""
        kept = (paths and row.trace) or row.reason
        if row.cached:
            kept += " (cached)" if kept else "cached"
        cells = (row.id, run_label(row), word, row.oracle, shown, *([kept] if remarks else ()))
        table.add_row(*cells)
    console.print(table)


RunName: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="RUN",
        help="Id of a run, or a campaign's name, a dot and the run's number.",
        autocompletion=completion.offers(completion.runs),
    ),
]


class RunOutput(Output, schema="run"):
    """Everything about one run; of a search also the ``proposal`` that it is.

    ``standing`` says why there is no trace of it (yet), empty when there is one; ``live`` is how
    far one is that runs, if it told within half a second.
    """

    run: RunDetail
    task: SearchTask | None = None
    standing: str = ""
    live: Snapshot | None = None

    def print(self) -> None:
        """Print what it was and what each oracle says, then what to type next."""
        from scenario_tui.cli.results import print_commands
        from scenario_tui.text.formatting import TERMINAL_STYLES
        from scenario_tui.text.run_text import run_text
        from scenario_tui.text.search_text import proposal_text

        stdout_console().print(run_text(self.run, self.live, TERMINAL_STYLES), soft_wrap=True)
        starting = self.run.row.state == "running" and self.live is None
        if starting or (self.run.row.state == "queued" and not self.run.row.reason):
            stdout_console().print(f"{self.standing}\n", markup=False, soft_wrap=True)
        proposal = self.run.row.proposal
        if proposal is not None and self.task is not None:
            console = stdout_console()
            about = proposal_text(self.task, proposal, console.width, TERMINAL_STYLES)
            console.print(about, soft_wrap=True)
        print_commands(*_next_commands(self.run, self.task))


def show(
    run: RunName,
    log: Annotated[
        bool,
        typer.Option(
            "--log",
            help="Tell what happened instead: attempts, mission, contacts, what the SUT said. Of "
            "a trace (.mcap), too.",
        ),
    ] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="With the log all lines of all outputs, not the last.")
    ] = False,
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="NAME",
            help="Of the log all that the system under test wrote to this output, stack.txt say.",
        ),
    ] = "",
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Show one run: what each oracle says and why, or what happened in it.

    The log is read from the state directory of this machine; no daemon is needed for it unless one
    is named.
    """
    from scenario_tui.source import DaemonTarget

    target = DaemonTarget(connect, state, say, show_progress)
    if log or everything or output:
        from scenario_tui.cli.logs import show_log

        show_log(run, output, target, everything=everything, as_json=as_json)
        return
    from scenario_tui.library.watching import latest_snapshot
    from scenario_tui.source import find_run, open_source, why_no_trace

    with open_source(run, target) as daemon:
        detail = find_run(daemon, run)
        search = daemon.search_row(detail.row.campaign)
        found = RunOutput(detail)
        if search is not None:
            found = replace(found, task=search.task)
        if not detail.row.trace:
            standing = why_no_trace(detail.row, daemon, target)
            found = replace(found, standing=standing)
    if detail.row.state == "running":
        # Only a daemon that runs knows how far it is; without one what is recorded is said.
        with suppress(Unreachable), target.open() as running:
            found = replace(found, live=latest_snapshot(running, detail.row.id))
            workers = running.workers() if found.live is None else ()
            prepares = [one.preparing for one in workers if one.id == detail.row.worker]
            found = replace(found, standing=next(filter(None, prepares), found.standing))
    found.show(as_json)


def _next_commands(detail: RunDetail, task: SearchTask | None = None) -> Iterable[tuple[str, str]]:
    from daemon.model.run_state import RunState

    row = detail.row
    if row.trace:
        begin = f" --from {row.oracle}" if row.outcome == "fail" else ""
        yield f"scenario replay {row.id}{begin}", "watch it"
    yield f"scenario show {row.id} --log", "what happened, in order"
    if not row.repeatable and row.trace:
        yield f"scenario verify {row.id}", "how far its outcomes spread"
    if task is not None:
        yield f"scenario search {row.campaign}", "the search it belongs to"
    elif row.outcome == "fail":
        yield f"scenario blame {row.id}", "what makes it fail"
    if row.state in (RunState.LOST, RunState.CANCELLED):
        yield f"scenario retry {row.campaign}", "queue what is lost or cancelled again"
