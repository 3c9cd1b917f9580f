"""Watching a search until it has ended: how far it is, how near it came to a failure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from daemon.batch.errors import Refused
from daemon.model.proposals import objective
from daemon.model.status import CampaignRow, LiveSnapshot, RunRow
from grammars.text.words import count_noun
from scenario_tui.cli.progress import (
    WAITING,
    ProgressDisplay,
    ask_campaign,
    ask_running,
    run_lines,
)
from scenario_tui.client import newer_proposals
from scenario_tui.text.formatting import GLYPHS, TERMINAL_STYLES, duration, margin
from scenario_tui.text.search_text import (
    SearchTally,
    failures_text,
    phase_text,
    sparkline,
    tally_search,
)

if TYPE_CHECKING:
    from daemon.model.proposals import Phase, ProposalRow
    from daemon.model.search_answer import SearchRow
    from daemon.model.verbs import DaemonClient

_BAR: Final = 16
_CURVE: Final = 16
"""Cells of the curve of the smallest margin."""


@dataclass(slots=True)
class SearchWatch:
    """A search as it was seen last, and what has been told of it."""

    campaign: str
    row: SearchRow | None = None
    rows: tuple[ProposalRow, ...] = ()
    tally: SearchTally | None = None
    campaign_row: CampaignRow | None = None
    running: tuple[RunRow, ...] = ()
    told_first: bool = False
    told_phase: Phase = "explore"

    def look(self, daemon: DaemonClient, shown: ProgressDisplay) -> SearchRow:
        """Ask how it stands, and tell the first failure and what it goes on with."""
        row = daemon.search_row(self.campaign)
        if row is None:
            raise Refused(f"the daemon does not know the search {self.campaign} (any more)")
        self.rows = newer_proposals(daemon, self.campaign, self.rows)
        self.tally = tally_search(row.task, self.rows)
        if shown.on_screen:
            self.campaign_row = ask_campaign(daemon, self.campaign)
            self.running = ask_running(daemon, self.campaign_row)
        self._tell(row, shown)
        self.row = row
        return row

    @property
    def finished(self) -> bool:
        """Whether the search has ended."""
        return self.row is not None and self.row.state != "running"

    def draw(self, live: Mapping[str, LiveSnapshot], preparing: str, width: int) -> RenderableType:
        """Return the line of the search, and one for each running run."""
        if self.row is None or self.tally is None:
            return Text(preparing)
        # What is dispensable goes first, until the bar fits.
        for dispensable in range(4):
            head, tail = Text(self.row.task.name, style="bold"), self._tail(dispensable)
            if head.cell_len + tail.cell_len + _BAR + 4 <= width:
                break
        line = Table.grid(padding=(0, 2))
        for _ in range(3):
            line.add_column(no_wrap=True)
        line.add_row(head, ProgressBar(self.row.task.runs, self.tally.explored, width=_BAR), tail)
        idle = not (self.tally.explored or self.running)
        # While it explores the note has the numbers of the bar, as they were a few runs ago.
        exploring = self.row.phase == "explore"
        note = [] if exploring else self.row.note.strip().splitlines()[-1:]
        waiting = preparing or "".join(note) or (WAITING if idle else "")
        if self.campaign_row is not None and self.campaign_row.paused:
            waiting = f"paused: `scenario pause {self.campaign} --off` lets it go on"
        return Group(line, *run_lines(self.running, live, waiting))

    def _tail(self, dispensable: int) -> Text:
        """Return what stands behind the bar; less of it, the more is ``dispensable``."""
        assert self.row is not None
        assert self.tally is not None
        row, tally = self.row, self.tally
        text = Text(f"{tally.explored}/{count_noun(row.task.runs, 'run')}")
        if tally.failed:
            words = failures_text(tally.failed) if dispensable < 3 else f"{tally.failed:,}"
            words = f"{GLYPHS['fail']} {words}"
            text.append(f"  {words}", style=TERMINAL_STYLES["fail"])
        if tally.smallest is not None:
            text.append(f"  {margin(tally.smallest.margin, tally.smallest.unit)}")
            if dispensable < 2:
                text.append(f"  {sparkline([one.value for one in tally.best], _CURVE)}")
        if row.phase != "explore" and dispensable < 3:
            text.append(f"  {phase_text(row)}", style="dim")
        elif dispensable < 1 and (left := self._seconds_left()) is not None:
            text.append(f"  at most {duration(left)} left")
        return text

    def _seconds_left(self) -> float | None:
        return self.campaign_row.seconds_left if self.campaign_row is not None else None

    def _tell(self, row: SearchRow, shown: ProgressDisplay) -> None:
        if self.row is None and row.state != "running":
            self.told_first = True  # it was over when somebody came: its answer tells
        first = self.tally.first if self.tally else None
        if first is not None and not self.told_first:
            self.told_first = True
            worth = objective(row.task, first.run.leads)
            words = f": {worth.oracle} by {margin(worth.margin, worth.unit)}" if worth else ""
            shown.note(f"run {first.proposal.number} fails{words} ({first.run.id})")
        if row.phase != self.told_phase and row.state == "running":
            shown.note(phase_text(row))
        self.told_phase = row.phase
