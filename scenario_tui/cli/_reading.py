"""Commands that read: status, results."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._gate import Baseline, WorseBy
from scenario_tui.cli._options import AsJson, Connect, State

if TYPE_CHECKING:
    from rich.table import Table

    from daemon.protocol import CampaignRow, Overview, RunRow, WorkerRow


def status(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Say how everything stands: daemon, workers, campaigns."""
    from scenario_tui.cli._output import emit, out
    from scenario_tui.cli._session import Target

    target = Target(connect, state)
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
    console = out()
    _print_overview(overview, endpoint, workers)
    if not campaigns:
        console.print("\nNo campaigns yet. Type: scenario submit CAMPAIGN.yaml")
        return
    console.print(_campaign_table(campaigns[:_SHOWN], overview.now, console.width))
    if len(campaigns) > _SHOWN:
        console.print(f"and {len(campaigns) - _SHOWN} older ones")


_SHOWN = 15
_BESIDE = 18
"""Columns that age and gaps take in the list of campaigns."""
_ROOMY = 120
"""Columns from which on a table has room for paths."""


def _print_overview(overview: Overview, endpoint: str, workers: tuple[WorkerRow, ...]) -> None:
    from daemon.places import endpoint_text
    from scenario_tui.cli._output import out, packed
    from scenario_tui.wording import counted, duration, rate

    console = out()
    slots = sum(worker.slots for worker in workers)
    console.print(
        f"daemon {overview.version} at {endpoint_text(endpoint)}, "
        f"up {duration(overview.now - overview.started_at)}, "
        f"{counted(overview.workers, 'worker')} with {counted(slots, 'slot')}",
        soft_wrap=True,
    )
    parts = _tallied(overview) or ["no runs yet"]
    if overview.rate > 0:
        parts.append(rate(overview.rate))
    if overview.seconds_left is not None:
        parts.append(f"{duration(overview.seconds_left)} left")
    console.print(packed(parts, console.width), markup=False)
    if overview.trouble:
        last = overview.trouble.strip().splitlines()[-1]
        console.print(f"! no run can start: {last}", markup=False, style="yellow", soft_wrap=True)


def _tallied(row: CampaignRow | Overview) -> list[str]:
    """Return how many runs there are of each word, with its glyph."""
    from scenario_tui.wording import GLYPHS, tally

    return [f"{GLYPHS[word]} {count} {word}" for word, count in tally(row).items()]


def _campaign_table(campaigns: tuple[CampaignRow, ...], now: float, width: int) -> Table:
    from rich import box
    from rich.table import Table

    from scenario_tui.cli._output import packed
    from scenario_tui.wording import ago

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("campaign", "runs", "verdicts", "submitted"):
        table.add_column(title, overflow="fold")
    runs = [f"{row.total - row.queued - row.running}/{row.total}" for row in campaigns]
    room = width - max(len(row.id) for row in campaigns) - max(map(len, runs)) - _BESIDE
    for row, progress in zip(campaigns, runs, strict=True):
        counts = packed(_tallied(row), max(24, room))
        marks = [f"priority {row.priority}"] if row.priority else []
        marks += ["paused"] if row.paused else []
        name = f"{row.id} ({', '.join(marks)})" if marks else row.id
        table.add_row(name, progress, counts, ago(row.submitted_at, now))
    return table


def results(
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Id or name of a campaign, or how it begins. Default: the newest.",
            autocompletion=_completion.campaigns,
        ),
    ] = "",
    runs: Annotated[bool, typer.Option("--runs", help="List every run and its trace.")] = False,
    state: State = None,
    outcome: Annotated[
        str,
        typer.Option(
            "--outcome",
            help="List only runs with this verdict, pass, fail ...",
            autocompletion=_completion.one_of("pass", "fail", "inconclusive", "error"),
        ),
    ] = "",
    text: Annotated[
        str,
        typer.Option(
            "--filter",
            help="List only runs that mention this text.",
            autocompletion=_completion.mentioned,
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
    from scenario_tui.asking import all_runs
    from scenario_tui.cli._compare import print_between
    from scenario_tui.cli._gate import final_code, hold
    from scenario_tui.cli._session import Target, find_campaign
    from scenario_tui.cli._summary import print_summary
    from scenario_tui.cli._told import emit_results
    from scenario_tui.summary import gather

    target = Target(connect, state)
    with target.open() as daemon:
        row = find_campaign(daemon, campaign)
        found = gather(daemon, row)
        rows = found.rows
        if outcome or text:
            rows = all_runs(daemon, row.id, outcome=outcome, text=text)
    between = hold(found, baseline, worse_by, target.open)
    if as_json:
        emit_results(replace(found, rows=rows), comparison=between)
    elif outcome or text:
        _print_runs(rows)
    else:
        print_summary(found, took=_took(row))
        if between is not None:
            print_between(between)
        if runs:
            _print_runs(rows)
        _print_whereabouts(row, rows, listed=runs)
    if exit_status or baseline:
        raise typer.Exit(final_code(found, between))


def _took(row: CampaignRow) -> float | None:
    return None if row.finished_at is None else row.finished_at - row.submitted_at


def _print_whereabouts(row: CampaignRow, rows: tuple[RunRow, ...], *, listed: bool) -> None:
    from scenario_tui.cli._output import out
    from scenario_tui.cli._summary import print_commands
    from scenario_tui.wording import counted

    traces = [run.trace for run in rows if run.trace]
    if traces:
        where = f"{counted(len(traces), 'trace')} in {traces[0].rpartition('/')[0]}"
        out().print(where, markup=False, soft_wrap=True)
    runs = (f"scenario results {row.id} --runs", "every run and its trace")
    one = (f"scenario show {rows[0].id if rows else 'RUN'}", "one run: what each oracle says")
    print_commands(one if listed else runs, ("scenario tui", "the dashboard"))


def _print_runs(rows: tuple[RunRow, ...]) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from scenario_tui.cli._output import out
    from scenario_tui.wording import STYLES, glyph_word, margin, run_label, word_of

    console = out()
    # Paths would be folded into columns of letters; below, the folder of all of them is said.
    paths = console.width >= _ROOMY
    remarks = paths or any(row.reason or row.cached for row in rows)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("run", "", "verdict", "decided by", "margin"):
        table.add_column(title, overflow="fold")
    if remarks:
        table.add_column("trace" if paths else "remark", overflow="fold")
    for row in rows:
        word = Text(glyph_word(word_of(row)), style=STYLES[word_of(row)])
        shown = margin(row.margin, row.unit) if row.oracle else ""
        kept = (paths and row.trace) or row.reason
        if row.cached:
            kept += " (cached)" if kept else "cached"
        cells = (row.id, run_label(row), word, row.oracle, shown, *([kept] if remarks else ()))
        table.add_row(*cells)
    console.print(table)
