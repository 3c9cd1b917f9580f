"""The command that says how everything stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from scenario_tui.cli.options import AsJson, Connect, State
from scenario_tui.cli.output import Output, plain_table, stdout_console, wrap_parts

if TYPE_CHECKING:
    from rich.table import Table

    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, DaemonOverview, WorkerRow

_MAX_CAMPAIGNS: Final = 15
_OTHER_COLUMNS: Final = 18
"""Columns that age and gaps take in the list of campaigns."""


class StatusOutput(Output, schema="status"):
    """How everything stands; ``searches`` are those that have not ended."""

    endpoint: str
    overview: DaemonOverview
    campaigns: tuple[CampaignRow, ...]
    workers: tuple[WorkerRow, ...]
    searches: tuple[SearchRow, ...] = ()

    def print(self) -> None:
        """Print the daemon on two lines, and the newest campaigns."""
        console, now = stdout_console(), self.overview.now
        self._print_overview()
        if not self.campaigns and self.overview.trouble:
            return  # there may be some that cannot be read just now
        if not self.campaigns:
            console.print("\nNo campaigns yet. Type: scenario submit CAMPAIGN.yaml")
            return
        console.print(_campaign_table(self.campaigns[:_MAX_CAMPAIGNS], now, console.width))
        if len(self.campaigns) > _MAX_CAMPAIGNS:
            console.print(f"and {len(self.campaigns) - _MAX_CAMPAIGNS} older ones")
        self._print_searches()

    def _print_searches(self) -> None:
        from scenario_tui.text.search_text import search_line

        for row in self.searches:
            words = f"search {search_line(row)}"
            stdout_console().print(words, markup=False, highlight=False, soft_wrap=True)

    def _print_overview(self) -> None:
        from daemon.batch.paths import endpoint_text
        from grammars.text.words import count_noun, duration_text
        from scenario_tui.text.formatting import rate_text

        overview, console = self.overview, stdout_console()
        slots = sum(worker.slots for worker in self.workers if not worker.away)
        away = sum(worker.away for worker in self.workers)
        console.print(
            f"daemon {overview.version} at {endpoint_text(self.endpoint)}, "
            f"up {duration_text(overview.now - overview.started_at)}, "
            f"{count_noun(overview.workers, 'worker')} with {count_noun(slots, 'slot')}"
            + (f", {away} away" if away else ""),
            soft_wrap=True,
        )
        parts = _tally_parts(overview) or ["no runs yet"]
        if overview.rate > 0:
            parts.append(rate_text(overview.rate))
        if overview.seconds_left is not None:
            parts.append(f"{duration_text(overview.seconds_left)} left")
        console.print(wrap_parts(parts, console.width), markup=False)
        if overview.preparing:
            console.print(overview.preparing, markup=False, soft_wrap=True)
        for number, trouble in enumerate(overview.troubles):
            what = "no run can start: " if overview.halted and number == 0 else ""
            words = f"! {what}{trouble.words.strip().splitlines()[-1]}"
            console.print(words, markup=False, style="yellow", soft_wrap=True)


def status(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Say how everything stands: daemon, workers, campaigns."""
    from contextlib import suppress

    from daemon.batch.errors import Unavailable
    from scenario_tui.cli.target import DaemonTarget

    target = DaemonTarget(connect, state)
    endpoint = target.endpoint
    with target.open() as daemon:
        overview, workers = daemon.overview(), daemon.workers()
        campaigns: tuple[CampaignRow, ...] = ()
        searches: tuple[SearchRow, ...] = ()
        # A daemon whose disk is full has no more to say than that.
        with suppress(Unavailable):
            campaigns = daemon.campaigns()
            if any(row.search in ("running", "waiting") for row in campaigns):
                searches = daemon.searches(unfinished=True)
    StatusOutput(endpoint, overview, campaigns, workers, searches).show(as_json)


def _tally_parts(row: CampaignRow | DaemonOverview) -> list[str]:
    """Return how many runs there are of each word, with its glyph."""
    from scenario_tui.text.formatting import GLYPHS, run_counts

    return [f"{GLYPHS[word]} {count} {word}" for word, count in run_counts(row).items()]


def _campaign_table(campaigns: tuple[CampaignRow, ...], now: float, width: int) -> Table:
    from grammars.text.words import duration_text
    from scenario_tui.text.formatting import age_text

    table = plain_table("campaign", "runs", "verdicts", "submitted")
    runs = [f"{row.ended}/{row.total}" for row in campaigns]
    # Verdicts wrap between their parts, never inside of one: rich would break at any blank.
    room = width - max(len(row.id) for row in campaigns) - max(map(len, runs)) - _OTHER_COLUMNS
    for row, progress in zip(campaigns, runs, strict=True):
        parts = _tally_parts(row)
        if row.seconds_left is not None:
            parts.append(f"{duration_text(row.seconds_left)} left")
        counts = wrap_parts(parts, max(24, room))
        marks = ["search"] if row.search else []
        marks += [f"priority {row.priority}"] if row.priority else []
        marks += ["paused"] if row.paused and not row.finished else []
        name = f"{row.id} ({', '.join(marks)})" if marks else row.id
        table.add_row(name, progress, counts, age_text(row.submitted_at, now))
    return table
