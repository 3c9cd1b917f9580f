"""How campaigns stand, judged one after another beside what is shown."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, TypeAlias

from scenario_tui.text.results import Conclusion, conclude

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.status import CampaignRow
    from daemon.model.verbs import DaemonClient

ASSESS_SHOWN_EVERY: Final = 1.0
"""Seconds between two looks at the campaign that is shown."""
ASSESS_OTHERS_EVERY: Final = 5.0
"""Seconds between two looks at another one."""
CAMPAIGNS_ASSESSED: Final = 100
"""How many campaigns are judged, the newest first."""
_SHARE: Final = 0.25
"""The share of its time the assessor works at most, however large the campaigns are: it is a thread
beside the one that draws, and only one of them at a time runs Python.
"""
_State: TypeAlias = "tuple[CampaignRow, int]"


class CampaignAssessor:
    """Remembers how campaigns stand; one step judges one campaign at most.

    ``conclusions`` and ``results`` (of the campaign that is wanted) are replaced and never changed,
    so that other threads may read them.
    """

    def __init__(
        self, *, every: float = ASSESS_SHOWN_EVERY, elsewhere: float = ASSESS_OTHERS_EVERY,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self.conclusions: Mapping[str, Conclusion] = {}
        self.results: CampaignResults | None = None
        self._every = every
        self._elsewhere = elsewhere
        self._clock = clock
        self._seen: dict[str, _State] = {}
        self._at: dict[str, float] = {}
        self._touches: dict[str, int] = {}
        self._rest_until = 0.0

    # A run that is judged again may change its verdict while all counts stay what they were.
    def touch(self, campaign: str) -> None:
        """Note that something of a campaign changed, even if its counts stay the same."""
        self._touches[campaign] = self._touches.get(campaign, 0) + 1

    def step(self, daemon: DaemonClient, campaigns: Sequence[CampaignRow], wanted: str) -> bool:
        """Judge the campaign that needs it most; return whether there was one."""
        self._forget_others(campaigns)
        began = self._clock()
        row = self._next(campaigns, wanted, began) if began >= self._rest_until else None
        if row is None:
            return False
        # Loaded with the first campaign: the first screen does without.
        from daemon.analysis.results import read_results

        state = self._state(row)
        results = read_results(daemon, row)
        conclusion = conclude(results)
        if row.id == wanted:
            self.results = results
        self.conclusions = {**self.conclusions, row.id: conclusion}
        ended = self._clock()
        self._seen[row.id], self._at[row.id] = state, ended
        if self._every:
            self._rest_until = ended + (ended - began) * (1.0 / _SHARE - 1.0)
        return True

    def _forget_others(self, campaigns: Sequence[CampaignRow]) -> None:
        """Forget campaigns that are listed no more: deleted ones, and those long past."""
        listed = {row.id for row in campaigns}
        # Lists: another thread may note a change meanwhile.
        for gone in {*self._seen, *list(self._touches)} - listed:
            for known in (self._seen, self._at, self._touches):
                known.pop(gone, None)
        if not listed.issuperset(self.conclusions):
            self.conclusions = {name: c for name, c in self.conclusions.items() if name in listed}
        if self.results is not None and self.results.row.id not in listed:
            self.results = None

    def _next(
        self, campaigns: Sequence[CampaignRow], wanted: str, now: float
    ) -> CampaignRow | None:
        first = (row for row in campaigns if row.id == wanted)
        due = (
            row for row in (*first, *campaigns[:CAMPAIGNS_ASSESSED]) if self._due(row, wanted, now)
        )
        return next(due, None)

    def _due(self, row: CampaignRow, wanted: str, now: float) -> bool:
        before, shown = self._seen.get(row.id), row.id == wanted
        if before is None or (shown and not self._holds(wanted)):
            return True
        wait = self._every if shown else self._elsewhere
        return self._state(row) != before and now >= self._at[row.id] + wait

    def _holds(self, campaign: str) -> bool:
        return self.results is not None and self.results.row.id == campaign

    def _state(self, row: CampaignRow) -> _State:
        return row, self._touches.get(row.id, 0)
