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
from daemon.model.status import CampaignRow, LiveSnapshot, RunRow
from daemon.model.trials import (
    Trial,
    first_failure,
    read_trial,
    smallest_margin,
    smallest_so_far,
)
from daemon.search.answers.sentences import margin_words, phase_words
from grammars.text.words import count_noun, duration_text
from scenario_tui.client import newer_runs
from scenario_tui.library.watching import (
    WAITING,
    ProgressDisplay,
    ask_campaign,
    ask_running,
    run_lines,
)
from scenario_tui.text.formatting import GLYPHS, TERMINAL_STYLES, margin
from scenario_tui.text.search_text import sparkline

if TYPE_CHECKING:
    from daemon.model.proposals import Phase
    from daemon.model.search_answer import SearchRow
    from daemon.model.verbs import DaemonClient
    from daemon.search.client import SearchClient

_BAR: Final = 16
_CURVE: Final = 16
"""Cells of the curve of the smallest margin."""


@dataclass(slots=True)
class SearchWatch:
    """A search as it was seen last, and what has been told of it; ``client`` runs it here."""

    campaign: str
    client: SearchClient | None = None
    row: SearchRow | None = None
    rows: tuple[RunRow, ...] = ()
    explored: tuple[Trial, ...] = ()
    campaign_row: CampaignRow | None = None
    running: tuple[RunRow, ...] = ()
    told_first: bool = False
    told_phase: Phase = "explore"

    def look(self, daemon: DaemonClient, shown: ProgressDisplay) -> SearchRow:
        """Ask how it stands, and tell the first failure and what it goes on with."""
        row = daemon.search_row(self.campaign)
        if row is None:
            raise Refused(f"the daemon does not know the search {self.campaign} (any more)")
        self.rows = newer_runs(daemon, self.campaign, self.rows)
        trials = (read_trial(row.task, one) for one in self.rows if one.settled)
        self.explored = tuple(one for one in trials if one.proposal.phase == "explore")
        if shown.on_screen:
            self.campaign_row = ask_campaign(daemon, self.campaign)
            self.running = ask_running(daemon, self.campaign_row)
        self._tell(row, shown)
        self.row = row
        return row

    @property
    def finished(self) -> bool:
        """True once the search has ended, or waits for a client and has none here."""
        if self.row is None or self.row.state == "running":
            return False
        return self.row.ended or self.client is None or not self.client.is_alive()

    def draw(self, live: Mapping[str, LiveSnapshot], preparing: str, width: int) -> RenderableType:
        """Return the line of the search, and one for each running run."""
        if self.row is None:
            return Text(preparing)
        # What is dispensable goes first, until the bar fits.
        for dispensable in range(4):
            head, tail = Text(self.row.task.name, style="bold"), self._tail(dispensable)
            if head.cell_len + tail.cell_len + _BAR + 4 <= width:
                break
        line = Table.grid(padding=(0, 2))
        for _ in range(3):
            line.add_column(no_wrap=True)
        line.add_row(head, ProgressBar(self.row.task.runs, len(self.explored), width=_BAR), tail)
        idle = not (self.explored or self.running)
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
        row, explored = self.row, self.explored
        text = Text(f"{len(explored)}/{count_noun(row.task.runs, 'run')}")
        if failed := sum(trial.fails for trial in explored):
            words = count_noun(failed, "failure") if dispensable < 3 else f"{failed:,}"
            text.append(f"  {GLYPHS['fail']} {words}", style=TERMINAL_STYLES["fail"])
        best = smallest_margin(explored)
        if best is not None and best.value is not None:
            text.append(f"  {margin(best.value.margin, best.value.unit)}")
            if dispensable < 2:
                smallest = smallest_so_far(trial.compared for trial in explored)
                text.append(f"  {sparkline(smallest, _CURVE)}")
        if row.phase != "explore" and dispensable < 3:
            text.append(f"  {phase_words(row)}", style="dim")
        elif dispensable < 1 and self.campaign_row and self.campaign_row.seconds_left is not None:
            text.append(f"  at most {duration_text(self.campaign_row.seconds_left)} left")
        return text

    def _tell(self, row: SearchRow, shown: ProgressDisplay) -> None:
        if self.row is None and row.ended:
            self.told_first = True  # it was over when somebody came: its answer tells
        first = first_failure(self.explored)
        if first is not None and not self.told_first:
            self.told_first = True
            oracle = first.verdict.oracle if first.verdict else row.task.minimise
            by = f" by {words}" if (words := margin_words(first)) else ""
            shown.note(f"run {first.number} fails: {oracle}{by} ({first.run})")
        if row.phase != self.told_phase and row.state == "running":
            shown.note(phase_words(row))
        self.told_phase = row.phase
