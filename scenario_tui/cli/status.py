"""The command that shows the state of the daemon, its workers and its campaigns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.batch.errors import Unavailable
from grammars.text.words import count_noun, duration_text
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.output import plain_table, print_commands, print_line, stdout_console
from scenario_tui.source import DaemonTarget
from scenario_tui.text.formatting import age_text, rate_text, run_counts
from scenario_tui.text.styles import GLYPHS, KNOWN, NEWS

if TYPE_CHECKING:
    from rich.table import Table

    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, DaemonOverview
    from daemon.model.verbs import DaemonClient
    from scenario_tui.cli.values import DaemonStatus
    from scenario_tui.text.results import Conclusion

_MAX_CAMPAIGNS: Final = 15
_MOST_RUNS: Final = 5_000
"""Largest number of runs to judge, 0.08 ms each, to tell new failures from known ones."""
_OTHER_COLUMNS: Final = 18
"""Columns of the age and the gaps in the list of campaigns."""


def status(target: DaemonTarget) -> Answer[DaemonStatus]:
    """Show the state of the daemon, its workers and its campaigns."""
    from scenario_tui.cli.values import DaemonStatus

    endpoint = target.endpoint
    with target.open() as daemon:
        overview, workers = daemon.overview(), daemon.workers()
        campaigns: tuple[CampaignRow, ...] = ()
        searches: tuple[SearchRow, ...] = ()
        conclusions: Mapping[str, Conclusion] = {}
        # A daemon whose disk is full answers with the overview only.
        with suppress(Unavailable):
            campaigns = daemon.campaigns()
            conclusions = _judge_failures(daemon, campaigns[:_MAX_CAMPAIGNS])
            if any(row.search in ("running", "waiting") for row in campaigns):
                searches = daemon.searches(unfinished=True)
    value = DaemonStatus(endpoint, overview, campaigns, workers, searches)
    return Answer("status", value, partial(_print_status, value, conclusions, target))


def _judge_failures(
    daemon: DaemonClient, campaigns: Iterable[CampaignRow]
) -> dict[str, Conclusion]:
    """Return the conclusions of campaigns with failures, as long as they have few runs."""
    from daemon.analysis.results import read_results
    from scenario_tui.text.results import conclude

    conclusions, runs = {}, 0
    for row in campaigns:
        runs += row.total if row.failed and not row.search else 0
        if row.failed and not row.search and runs <= _MOST_RUNS:
            conclusions[row.id] = conclude(read_results(daemon, row))
    return conclusions


def _print_status(
    status: DaemonStatus, conclusions: Mapping[str, Conclusion], target: DaemonTarget
) -> None:
    """Print the daemon on two lines, and the newest campaigns."""
    campaigns = status.campaigns
    _print_overview(status, conclusions)
    if not campaigns and status.overview.trouble:
        return  # campaigns may exist that cannot be read now
    if not campaigns:
        print_line("\nNo campaigns yet. Type:")
        submit = target.command("submit", "my-tests/campaign.yaml")
        print_commands(
            ("scenario new my-tests", "write a small campaign"), (submit, "submit it to the daemon")
        )
        return
    console = stdout_console()
    newest, now = campaigns[:_MAX_CAMPAIGNS], status.overview.now
    console.print(_campaign_table(newest, conclusions, now, console.width))
    if len(campaigns) > _MAX_CAMPAIGNS:
        print_line(f"and {len(campaigns) - _MAX_CAMPAIGNS} older ones")
    if status.searches:
        from scenario_tui.text.search_text import search_line

        for row in status.searches:
            words = f"search {search_line(row)}"
            print_line(words)


def _print_overview(status: DaemonStatus, conclusions: Mapping[str, Conclusion]) -> None:
    from daemon.batch.paths import endpoint_text
    from scenario_tui.text.campaign_text import fail_style

    overview, console = status.overview, stdout_console()
    slots = sum(worker.slots for worker in status.workers if not worker.away)
    away = sum(worker.away for worker in status.workers)
    print_line(
        f"daemon {overview.version} at {endpoint_text(status.endpoint)}, "
        f"up {duration_text(overview.now - overview.started_at)}, "
        f"{count_noun(overview.workers, 'worker')} with {count_noun(slots, 'slot')}"
        + (f", {away} away" if away else "")
    )
    failed = [row for row in status.campaigns if row.failed and not row.search]
    styles = {fail_style(row, conclusions.get(row.id)) for row in failed}
    parts = _tally_parts(overview, "fail" if "fail" in styles else KNOWN) or [Text("no runs yet")]
    if overview.rate > 0:
        parts.append(Text(rate_text(overview.rate)))
    if overview.seconds_left is not None:
        parts.append(Text(f"{duration_text(overview.seconds_left)} left"))
    console.print(_wrap_parts(parts, console.width))
    if overview.preparing:
        print_line(overview.preparing)
    for number, trouble in enumerate(overview.troubles):
        what = "no run can start: " if overview.halted and number == 0 else ""
        words = f"! {what}{trouble.words.strip().splitlines()[-1]}"
        print_line(words, style="yellow")


def _tally_parts(
    row: CampaignRow | DaemonOverview, fail: str, conclusion: Conclusion | None = None
) -> list[Text]:
    """Return the number of runs with each word, then new and known failures.

    ``fail`` is the style of failed runs.
    """
    parts = [
        Text(f"{GLYPHS[word]} {count} {word}", style=fail if word == "fail" else word)
        for word, count in run_counts(row).items()
    ]
    if conclusion is not None and conclusion.word == "fail":
        parts.append(Text(f"! {conclusion.text}", style=NEWS))
    if conclusion is not None and conclusion.known:
        reasons = "; ".join(mark.reason for mark in conclusion.expectations.failures)
        parts.append(Text(f"{conclusion.known} known: {reasons}", style=KNOWN))
    return parts


def _campaign_table(
    campaigns: tuple[CampaignRow, ...],
    conclusions: Mapping[str, Conclusion],
    now: float,
    width: int,
) -> Table:
    from scenario_tui.text.campaign_text import fail_style

    table = plain_table("campaign", "runs", "verdicts", "submitted")
    runs = [f"{row.ended}/{row.total}" for row in campaigns]
    # Verdicts wrap between their parts only: rich would break at any blank.
    room = width - max(len(row.id) for row in campaigns) - max(map(len, runs)) - _OTHER_COLUMNS
    for row, progress in zip(campaigns, runs, strict=True):
        conclusion = conclusions.get(row.id)
        parts = _tally_parts(row, fail_style(row, conclusion), conclusion)
        if row.seconds_left is not None:
            parts.append(Text(f"{duration_text(row.seconds_left)} left"))
        counts = _wrap_parts(parts, max(24, room))
        marks = ["search"] if row.search else []
        marks += [f"priority {row.priority}"] if row.priority else []
        marks += ["paused"] if row.paused and not row.finished else []
        name = f"{row.id} ({', '.join(marks)})" if marks else row.id
        table.add_row(name, progress, counts, age_text(row.submitted_at, now))
    return table


def _wrap_parts(parts: Iterable[Text], width: int) -> Text:
    """Return parts, two blanks apart, in lines of at most ``width``; no part is broken."""
    lines: list[Text] = []
    for part in parts:
        if lines and len(lines[-1]) + 2 + len(part) <= width:
            lines[-1].append("  ").append_text(part)
        else:
            lines.append(Text().append_text(part))
    return Text("\n").join(lines)
