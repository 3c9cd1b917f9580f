"""Commands that look at what there is: status, results, show, logs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.compare import Baseline, WorseBy
from scenario_tui.cli.options import AsJson, Connect, RunOrTrace, State

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.table import Table
    from rich.text import Text

    from daemon.analysis.run_history import RunLogLine, RunStep
    from daemon.model.status import CampaignRow, DaemonOverview, RunDetail, RunRow, WorkerRow
    from scenario_tui.cli.target import DaemonTarget


def status(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Say how everything stands: daemon, workers, campaigns."""
    from scenario_tui.cli.output import emit, stdout_console
    from scenario_tui.cli.target import DaemonTarget

    target = DaemonTarget(connect, state)
    endpoint = target.endpoint
    with target.open() as daemon:
        overview, campaigns = daemon.overview(), daemon.campaigns()
        workers = daemon.workers()
    if as_json:
        emit(
            "status",
            endpoint=endpoint,
            overview=overview,
            campaigns=list(campaigns),
            workers=list(workers),
        )
        return
    console = stdout_console()
    _print_overview(overview, endpoint, workers)
    if not campaigns:
        console.print("\nNo campaigns yet. Type: scenario submit CAMPAIGN.yaml")
        return
    console.print(_campaign_table(campaigns[:_MAX_CAMPAIGNS], overview.now, console.width))
    if len(campaigns) > _MAX_CAMPAIGNS:
        console.print(f"and {len(campaigns) - _MAX_CAMPAIGNS} older ones")


_MAX_CAMPAIGNS = 15
_OTHER_COLUMNS = 18
"""Columns that age and gaps take in the list of campaigns."""
_WIDE = 120
"""Columns from which on a table has room for paths."""


def _print_overview(
    overview: DaemonOverview, endpoint: str, workers: tuple[WorkerRow, ...]
) -> None:
    from daemon.batch.paths import endpoint_text
    from scenario_tui.cli.output import stdout_console, wrap_parts
    from scenario_tui.text.formatting import duration, pluralise, rate_text

    console = stdout_console()
    slots = sum(worker.slots for worker in workers)
    console.print(
        f"daemon {overview.version} at {endpoint_text(endpoint)}, "
        f"up {duration(overview.now - overview.started_at)}, "
        f"{pluralise(overview.workers, 'worker')} with {pluralise(slots, 'slot')}",
        soft_wrap=True,
    )
    parts = _tally_parts(overview) or ["no runs yet"]
    if overview.rate > 0:
        parts.append(rate_text(overview.rate))
    if overview.seconds_left is not None:
        parts.append(f"{duration(overview.seconds_left)} left")
    console.print(wrap_parts(parts, console.width), markup=False)
    if overview.trouble:
        last = overview.trouble.strip().splitlines()[-1]
        console.print(f"! no run can start: {last}", markup=False, style="yellow", soft_wrap=True)


def _tally_parts(row: CampaignRow | DaemonOverview) -> list[str]:
    """Return how many runs there are of each word, with its glyph."""
    from scenario_tui.text.formatting import GLYPHS, run_counts

    return [f"{GLYPHS[word]} {count} {word}" for word, count in run_counts(row).items()]


def _campaign_table(campaigns: tuple[CampaignRow, ...], now: float, width: int) -> Table:
    from rich import box
    from rich.table import Table

    from scenario_tui.cli.output import wrap_parts
    from scenario_tui.text.formatting import age_text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("campaign", "runs", "verdicts", "submitted"):
        table.add_column(title, overflow="fold")
    runs = [f"{row.total - row.queued - row.running}/{row.total}" for row in campaigns]
    room = width - max(len(row.id) for row in campaigns) - max(map(len, runs)) - _OTHER_COLUMNS
    for row, progress in zip(campaigns, runs, strict=True):
        counts = wrap_parts(_tally_parts(row), max(24, room))
        marks = [f"priority {row.priority}"] if row.priority else []
        marks += ["paused"] if row.paused else []
        name = f"{row.id} ({', '.join(marks)})" if marks else row.id
        table.add_row(name, progress, counts, age_text(row.submitted_at, now))
    return table


def results(
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Id or name of a campaign, or how it begins. Default: the newest.",
            autocompletion=completion.campaigns,
        ),
    ] = "",
    runs: Annotated[bool, typer.Option("--runs", help="List every run and its trace.")] = False,
    state: State = None,
    outcome: Annotated[
        str,
        typer.Option(
            "--outcome",
            help="List only runs with this verdict, pass, fail ...",
            autocompletion=completion.one_of("pass", "fail", "inconclusive", "error"),
        ),
    ] = "",
    text: Annotated[
        str,
        typer.Option(
            "--filter",
            help="List only runs that mention this text.",
            autocompletion=completion.names_in_campaign,
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
    from scenario_tui.cli.compare import compare_with_baseline, final_code, print_comparison
    from scenario_tui.cli.results import emit_results, print_summary
    from scenario_tui.cli.target import DaemonTarget, find_campaign
    from scenario_tui.client import all_runs
    from scenario_tui.text.results import gather_results

    target = DaemonTarget(connect, state)
    with target.open() as daemon:
        row = find_campaign(daemon, campaign)
        found = gather_results(daemon, row)
        rows = found.rows
        if outcome or text:
            rows = all_runs(daemon, row.id, outcome=outcome, text=text)
    between = compare_with_baseline(found, baseline, worse_by, target.open)
    if as_json:
        emit_results(replace(found, rows=rows), comparison=between)
    elif outcome or text:
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


def _elapsed(row: CampaignRow) -> float | None:
    return None if row.finished_at is None else row.finished_at - row.submitted_at


def _print_trace_folder(row: CampaignRow, rows: tuple[RunRow, ...], *, listed: bool) -> None:
    from scenario_tui.cli.output import stdout_console
    from scenario_tui.cli.results import print_commands
    from scenario_tui.text.formatting import pluralise

    traces = [run.trace for run in rows if run.trace]
    if traces:
        where = f"{pluralise(len(traces), 'trace')} in {traces[0].rpartition('/')[0]}"
        stdout_console().print(where, markup=False, soft_wrap=True)
    runs = (f"scenario results {row.id} --runs", "every run and its trace")
    one = (f"scenario show {rows[0].id if rows else 'RUN'}", "one run: what each oracle says")
    print_commands(one if listed else runs, ("scenario tui", "the dashboard"))


def _print_runs(rows: tuple[RunRow, ...]) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from scenario_tui.cli.output import stdout_console
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
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("run", "", "verdict", "decided by", "margin"):
        table.add_column(title, overflow="fold")
    if remarks:
        table.add_column("trace" if paths else "remark", overflow="fold")
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
        autocompletion=completion.runs,
    ),
]


def show(run: RunName, connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Show one run: what each oracle says and why, what it was, where its trace lies."""
    from scenario_tui.cli.output import emit, stdout_console
    from scenario_tui.cli.results import print_commands
    from scenario_tui.cli.target import DaemonTarget, find_run
    from scenario_tui.text.run_text import run_text

    with DaemonTarget(connect, state).open() as daemon:
        detail = find_run(daemon, run)
    if as_json:
        emit("run", run=detail)
        return
    stdout_console().print(_in_terminal_colours(run_text(detail, None)), soft_wrap=True)
    print_commands(*_next_commands(detail))


def _in_terminal_colours(text: Text) -> Text:
    """Return a text of the dashboard in the colours of this terminal."""
    from rich.text import Span

    from scenario_tui.text import formatting
    from scenario_tui.text.formatting import TERMINAL_STYLES

    ours = {style: TERMINAL_STYLES[word] for word, style in formatting.DASHBOARD_STYLES.items()}
    ours |= {formatting.QUIET: "dim", formatting.UNSURE: "yellow"}
    text.spans = [
        Span(span.start, span.end, ours.get(str(span.style), span.style)) for span in text.spans
    ]
    return text


def _next_commands(detail: RunDetail) -> Iterable[tuple[str, str]]:
    row = detail.row
    if row.trace:
        begin = f" --from {row.oracle}" if row.outcome == "fail" else ""
        yield f"scenario replay {row.id}{begin}", "watch it"
    yield f"scenario logs {row.id}", "what happened, in order"
    if row.outcome == "fail":
        yield f"scenario blame {row.id}", "what makes it fail"


def logs(
    run: RunOrTrace,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Tell what happened in a run: its attempts, its mission, contacts, what the SUT said.

    Read from the state directory of this machine; no daemon is needed unless one is named.
    """
    from daemon.analysis.run_history import read_run_log
    from scenario_tui.cli.output import emit
    from scenario_tui.cli.target import DaemonTarget

    if run.endswith(".mcap"):
        said = read_run_log(Path(run))
        if as_json:
            emit("logs", run="", attempts=0, reason="", steps=[], output=[], recorded=list(said))
        else:
            _print_recorded(said)
        return
    row, happened, printed, said = _collect_log(run, DaemonTarget(connect, state))
    if as_json:
        emit("logs", run=row.id, attempts=row.attempt, reason=row.reason, steps=list(happened),
             output=list(printed), recorded=list(said))  # fmt: skip
        return
    _print_steps(happened, row.attempt)
    known = any(step.note.strip() == row.reason.strip() for step in happened)
    _print_texts((*printed, "" if known else row.reason))
    if said:
        _print_recorded(said)


def _collect_log(
    run: str, target: DaemonTarget
) -> tuple[RunRow, tuple[RunStep, ...], tuple[str, ...], tuple[RunLogLine, ...]]:
    """Return a run, its attempts, what they print, what its trace recorded.

    A daemon elsewhere does not tell of attempts.
    """
    from daemon.analysis.report import open_ledger
    from daemon.analysis.run_history import read_outputs, read_run_log, read_steps
    from scenario_tui.cli.target import find_run, one_trace

    happened: tuple[RunStep, ...] = ()
    printed: tuple[str, ...] = ()
    if target.named:
        with target.open() as daemon:
            row = find_run(daemon, run).row
    else:
        with open_ledger(target.places) as ledger:
            row = find_run(ledger, run).row
        happened, printed = read_steps(target.places, row.id), read_outputs(target.places, row.id)
    said = read_run_log(one_trace(row.id, target, "RUN")) if row.trace else ()
    return row, happened, printed, said


def _print_steps(happened: tuple[RunStep, ...], attempts: int) -> None:
    from datetime import datetime

    from scenario_tui.cli.output import stdout_console
    from scenario_tui.text.formatting import pluralise

    console = stdout_console()
    for step in happened:
        when = datetime.fromtimestamp(step.at).astimezone().strftime("%Y-%m-%d %H:%M:%S")
        note = f"  {step.note.strip()}" if step.note else ""
        console.print(f"{when}  {step.state}{note}", markup=False, soft_wrap=True)
    if not happened:
        console.print(f"{pluralise(attempts, 'attempt')}; when is not remembered any more")


def _print_texts(texts: tuple[str, ...]) -> None:
    from scenario_tui.cli.output import stdout_console

    for text in filter(None, texts):
        stdout_console().print(f"\n{text.strip()}", markup=False, soft_wrap=True)


def _print_recorded(said: tuple[RunLogLine, ...]) -> None:
    from rich.text import Text

    from scenario_tui.cli.output import stdout_console

    console = stdout_console()
    console.print("\nin simulated time", style="dim")
    styles = {"warn": "yellow", "error": "bold red", "fatal": "bold red"}
    width = max(len(line.source) for line in said)
    for line in said:
        text = Text(f"{line.time:8.1f} s  {line.source:<{width}}  ")
        console.print(text.append(line.text, style=styles.get(line.level, "")), soft_wrap=True)
