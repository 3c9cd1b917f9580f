"""What the feed asks about searches: how each stands, and the runs of the one that is shown."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from scenario_tui.dashboard.search_runs import SearchedRun, SearchRuns, searched_run

if TYPE_CHECKING:
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, ChangeEvent
    from daemon.model.verbs import DaemonClient

_PAGE: Final = 500
"""Runs of a search asked for at a time."""


class KnownSearches:
    """Remembers how searches stand, and the runs of one; asks for what changed and no more.

    ``rows`` and what :meth:`runs` returns are replaced and never changed, so that other threads
    may read them.
    """

    # Events come by another thread, and some may be lost: they say where to look, what a search
    # counts says that there is something to look for.

    def __init__(self) -> None:
        self.rows: Mapping[str, SearchRow] = {}
        self._seen: dict[str, tuple[CampaignRow, int]] = {}
        self._touches: dict[str, int] = {}
        self._hints: deque[str] = deque(maxlen=4096)
        self._shown: SearchRuns | None = None
        self._known: tuple[SearchedRun, ...] = ()

    def touch(self, event: ChangeEvent) -> None:
        """Note that something of a search changed, or one of its runs."""
        campaign = event.campaign or event.id
        if campaign in self.rows:
            self._touches[campaign] = self._touches.get(campaign, 0) + 1
            self._hints.append(event.id)

    def update_rows(self, daemon: DaemonClient, campaigns: Sequence[CampaignRow]) -> None:
        """Ask how searches stand, if one of these campaigns is a search that changed."""
        searches = {row.id: row for row in campaigns if row.search}
        seen = {name: (row, self._touches.get(name, 0)) for name, row in searches.items()}
        stale = [name for name in seen if seen[name] != self._seen.get(name)]
        found: dict[str, SearchRow] = {}
        if stale:
            # Those that are over do not change any more: mostly there are more of them.
            running = all(searches[name].search == "running" for name in stale)
            found = {row.campaign: row for row in daemon.searches(running=running)}
        if stale or len(searches) < len(self.rows):
            known = {**self.rows, **found}
            self.rows = {name: known[name] for name in searches if name in known}
        self._seen = seen

    def runs(self, daemon: DaemonClient, campaign: str) -> SearchRuns | None:
        """Return a search with its runs; asks only for those that are new or were not over."""
        row, shown = self.rows.get(campaign), self._shown
        if row is None:
            return None
        if shown is None or shown.campaign != campaign:
            shown, self._known = None, ()
        hinted = self._hinted(campaign)
        if shown is None or hinted or _counts(shown.row) != _counts(row):
            opened = (run.position for run in self._known if not run.settled)
            # All of it once more in the end: an event that was lost may have been about any run.
            ended = shown is not None and shown.row.state != row.state
            first = 0 if ended else min((len(self._known), *opened, *hinted))
            self._known = self._ask(daemon, row, first)
        if shown is None or shown.row is not row or shown.runs is not self._known:
            shown = self._shown = SearchRuns(row, self._known)
        return shown

    def _hinted(self, campaign: str) -> list[int]:
        """Return the positions of runs of which something was heard since: mostly open ones."""
        found = []
        while self._hints:
            name, _, position = self._hints.popleft().rpartition(".")
            if name == campaign and position.isdecimal():
                found.append(int(position))
        return found

    def _ask(self, daemon: DaemonClient, row: SearchRow, first: int) -> tuple[SearchedRun, ...]:
        # The dashboard's first screen is not to wait for what only the thread that asks needs.
        from daemon.model.proposals import ProposalQuery
        from daemon.model.verbs import PROPOSALS

        known = list(self._known[:first])
        while len(known) < row.proposed:
            page = daemon.ask(PROPOSALS, ProposalQuery(row.campaign, len(known), _PAGE))
            if not page:
                break
            known.extend(searched_run(row.task, one) for one in page)
        return tuple(known)


def _counts(row: SearchRow) -> tuple[int, int, str]:
    return row.proposed, row.finished, row.state
