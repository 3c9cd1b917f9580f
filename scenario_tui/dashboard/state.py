"""The state of the daemon: campaigns, searches, and the conclusions about them."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, TypeAlias

from scenario_tui.text.results import Conclusion, conclude

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, DaemonOverview
    from daemon.model.verbs import DaemonClient

CAMPAIGNS_SHOWN: Final = 500
"""Newest campaigns in the table; thousands would be slow to lay out."""
_NEWEST: Final = 100
"""Number of campaigns to judge in any case; older ones only if they may have news."""
_RESULTS_KEPT: Final = 4
"""Results to keep: a user goes back to the same few campaigns, each of up to 100,000 runs."""
_SHARE: Final = 0.25
"""Largest share of its time in which the assessor works. Its thread shares the interpreter's lock
with the one that draws.
"""

_Judged: TypeAlias = "tuple[CampaignRow, int]"
"""A campaign as it was judged, and the number of its changes until then."""


@dataclass(frozen=True, slots=True)
class DashboardState:
    """Last state of the daemon; ``at`` is its time [s since the epoch], 0 before the first one.

    ``problem`` tells why the dashboard is not connected; with ``refused`` a daemon answered but
    refused, as other versions do. ``results`` are those of the campaigns last in front, as soon as
    they are judged.
    """

    connected: bool = False
    problem: str = ""
    refused: bool = False
    at: float = 0.0
    overview: DaemonOverview | None = None
    campaigns: tuple[CampaignRow, ...] = ()
    conclusions: Mapping[str, Conclusion] = field(default_factory=dict)
    results: Mapping[str, CampaignResults] = field(default_factory=dict)
    searches: Mapping[str, SearchRow] = field(default_factory=dict)

    def campaign(self, campaign: str) -> CampaignRow | None:
        """Return the campaign with this id."""
        return next((row for row in self.campaigns if row.id == campaign), None)


def listed_campaigns(daemon: DaemonClient, about: str) -> tuple[CampaignRow, ...]:
    """Return the newest campaigns, all unfinished ones, and the one in front."""
    rows = daemon.campaign_page(limit=CAMPAIGNS_SHOWN)
    if len(rows) < CAMPAIGNS_SHOWN:
        return rows
    listed = {row.id: row for row in (*rows, *daemon.campaign_page(unfinished=True))}
    if about and about not in listed and (row := daemon.campaign(about)):
        listed[about] = row
    return tuple(listed.values())


def search_rows(
    daemon: DaemonClient, campaigns: Sequence[CampaignRow], last: DashboardState
) -> Mapping[str, SearchRow]:
    """Return the searches among campaigns by their id; ended ones are fetched after a change."""
    searches = {row.id: row for row in campaigns if row.search}
    before = {row.id: row for row in last.campaigns}
    going = {name for name, row in searches.items() if row.search in ("running", "waiting")}
    stale = going.union(name for name, row in searches.items() if row != before.get(name))
    # Ended searches are usually the majority.
    new = daemon.searches(unfinished=stale == going) if stale else ()
    rows = {**last.searches, **{row.campaign: row for row in new}}
    return {name: rows[name] for name in searches if name in rows}


class CampaignAssessor:
    """Remembers the conclusions about campaigns; one step judges one campaign at most.

    ``conclusions``, and ``results`` of the campaigns last in front, are replaced and never changed,
    so that other threads may read them.
    """

    def __init__(
        self, *, every: float = 1.0, elsewhere: float = 5.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self.conclusions: Mapping[str, Conclusion] = {}
        self.results: Mapping[str, CampaignResults] = {}
        self._every = every
        """Seconds between two judgements of the campaign in front."""
        self._elsewhere = elsewhere
        """Seconds between two judgements of any other campaign."""
        self._clock = clock
        self._judged: dict[str, tuple[_Judged, float]] = {}
        self._touches: Counter[str] = Counter()
        self._rest_until = 0.0

    def touch(self, campaign: str) -> None:
        """Note a change of a campaign, even if its counts stay the same, as after a rejudgement."""
        self._touches[campaign] += 1

    def step(self, daemon: DaemonClient, campaigns: Sequence[CampaignRow], about: str) -> str:
        """Judge the campaign that needs it most; return its id, empty if none does."""
        self._forget_others({row.id for row in campaigns})
        began = self._clock()
        row = self._next(campaigns, about, began) if began >= self._rest_until else None
        if row is None:
            return ""
        # Loaded with the first campaign, because the first screen does not need it.
        from daemon.analysis.results import read_results

        state = (row, self._touches[row.id])
        results = read_results(daemon, row)
        conclusion = conclude(results)
        if row.id == about or row.id in self.results:
            others = [(name, r) for name, r in self.results.items() if name != row.id]
            self.results = dict([*others, (row.id, results)][-_RESULTS_KEPT:])
        self.conclusions = {**self.conclusions, row.id: conclusion}
        ended = self._clock()
        self._judged[row.id] = (state, ended)
        if self._every:
            self._rest_until = ended + (ended - began) * (1.0 / _SHARE - 1.0)
        return row.id

    def _forget_others(self, listed: set[str]) -> None:
        """Forget campaigns that are not listed any more: deleted ones, and old ones."""
        if not listed.issuperset(self._judged):
            self._judged = {name: one for name, one in self._judged.items() if name in listed}
            self.conclusions = {name: c for name, c in self.conclusions.items() if name in listed}
            self.results = {name: r for name, r in self.results.items() if name in listed}

    def _next(self, campaigns: Sequence[CampaignRow], about: str, now: float) -> CampaignRow | None:
        first = (row for row in campaigns if row.id == about)
        old = (r for r in campaigns[_NEWEST:] if (r.done or r.lost) and not r.acknowledged)
        rows = itertools.chain(first, campaigns[:_NEWEST], old)
        return next((row for row in rows if self._is_due(row, row.id == about, now)), None)

    def _is_due(self, row: CampaignRow, is_front: bool, now: float) -> bool:
        if row.id not in self._judged or (is_front and row.id not in self.results):
            return True
        judged, at = self._judged[row.id]
        state = (row, self._touches[row.id])
        if state == judged:
            self._judged[row.id] = (state, at)  # the same object compares faster the next time
            return False
        return now >= at + (self._every if is_front else self._elsewhere)
