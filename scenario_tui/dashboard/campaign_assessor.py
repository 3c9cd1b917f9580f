"""Conclusions about campaigns, judged one after another in the background."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, TypeAlias

from scenario_tui.text.results import Conclusion, conclude

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.status import CampaignRow
    from daemon.model.verbs import DaemonClient

ASSESS_SHOWN_EVERY: Final = 1.0
"""Seconds between two judgements of the campaign in front."""
ASSESS_OTHERS_EVERY: Final = 5.0
"""Seconds between two judgements of any other campaign."""
_NEWEST: Final = 100
"""Number of campaigns to judge in any case; older ones only if they may have news."""
_RESULTS_KEPT: Final = 4
"""Results to keep: a user goes back to the same few campaigns, each of up to 100,000 runs."""
_SHARE: Final = 0.25
"""Largest share of its time in which the assessor works. Its thread shares the interpreter's lock
with the one that draws.
"""
_State: TypeAlias = "tuple[CampaignRow, int]"


class CampaignAssessor:
    """Remembers the conclusions about campaigns; one step judges one campaign at most.

    ``conclusions``, and ``results`` of the campaigns last in front, are replaced and never changed,
    so that other threads may read them.
    """

    def __init__(
        self, *, every: float = ASSESS_SHOWN_EVERY, elsewhere: float = ASSESS_OTHERS_EVERY,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self.conclusions: Mapping[str, Conclusion] = {}
        self.results: Mapping[str, CampaignResults] = {}
        self._every = every
        self._elsewhere = elsewhere
        self._clock = clock
        self._seen: dict[str, _State] = {}
        self._at: dict[str, float] = {}
        self._touches: dict[str, int] = {}
        self._rest_until = 0.0

    def touch(self, campaign: str) -> None:
        """Note a change of a campaign, even if its counts stay the same, as after a rejudgement."""
        self._touches[campaign] = self._touches.get(campaign, 0) + 1

    def step(self, daemon: DaemonClient, campaigns: Sequence[CampaignRow], about: str) -> str:
        """Judge the campaign that needs it most; return its id, empty if none does."""
        self._forget_others(campaigns)
        began = self._clock()
        row = self._next(campaigns, about, began) if began >= self._rest_until else None
        if row is None:
            return ""
        # Loaded with the first campaign, because the first screen does not need it.
        from daemon.analysis.results import read_results

        state = self._state(row)
        results = read_results(daemon, row)
        conclusion = conclude(results)
        if row.id == about or row.id in self.results:
            others = [(name, r) for name, r in self.results.items() if name != row.id]
            self.results = dict([*others, (row.id, results)][-_RESULTS_KEPT:])
        self.conclusions = {**self.conclusions, row.id: conclusion}
        ended = self._clock()
        self._seen[row.id], self._at[row.id] = state, ended
        if self._every:
            self._rest_until = ended + (ended - began) * (1.0 / _SHARE - 1.0)
        return row.id

    def _forget_others(self, campaigns: Sequence[CampaignRow]) -> None:
        """Forget campaigns that are not listed any more: deleted ones, and old ones."""
        listed = {row.id for row in campaigns}
        # A copy of the keys, because another thread may note a change meanwhile.
        for campaign in {*self._seen, *list(self._touches)} - listed:
            for memory in (self._seen, self._at, self._touches):
                memory.pop(campaign, None)
        if not listed.issuperset(self.conclusions):
            self.conclusions = {name: c for name, c in self.conclusions.items() if name in listed}
        if not listed.issuperset(self.results):
            self.results = {name: r for name, r in self.results.items() if name in listed}

    def _next(self, campaigns: Sequence[CampaignRow], about: str, now: float) -> CampaignRow | None:
        first = (row for row in campaigns if row.id == about)
        old = (r for r in campaigns[_NEWEST:] if (r.done or r.lost) and not r.acknowledged)
        rows = itertools.chain(first, campaigns[:_NEWEST], old)
        return next((row for row in rows if self._is_due(row, row.id == about, now)), None)

    def _is_due(self, row: CampaignRow, is_front: bool, now: float) -> bool:
        if row.id not in self._seen or (is_front and row.id not in self.results):
            return True
        state, wait = self._state(row), self._every if is_front else self._elsewhere
        if state == self._seen[row.id]:
            self._seen[row.id] = state  # the same object compares faster the next time
            return False
        return now >= self._at[row.id] + wait

    def _state(self, row: CampaignRow) -> _State:
        return row, self._touches.get(row.id, 0)
