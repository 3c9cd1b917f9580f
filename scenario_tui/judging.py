"""Judging campaigns while they run: again when something changed, and never all the time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from daemon.protocol import CampaignRow
from scenario_tui.asking import Daemon
from scenario_tui.summary import Conclusion, Results, conclude, gather, judge

EVERY: Final = 1.0
"""Seconds between two looks at the campaign that is shown."""
ELSEWHERE: Final = 5.0
"""Seconds between two looks at another one."""
JUDGED: Final = 100
"""How many campaigns are judged, the newest first."""
_SHARE: Final = 0.25
"""The share of its time a judge works at most, however large the campaigns are."""

_State = tuple[CampaignRow, int]


class Judge:
    """Remembers how campaigns stand; one step judges one campaign at most.

    ``conclusions`` and ``results`` (of the campaign that is wanted) are replaced and never changed,
    so that other threads may read them.
    """

    def __init__(
        self, *, every: float = EVERY, elsewhere: float = ELSEWHERE,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self.conclusions: Mapping[str, Conclusion] = {}
        self.results: Results | None = None
        self._every = every
        self._elsewhere = elsewhere
        self._clock = clock
        self._seen: dict[str, _State] = {}
        self._at: dict[str, float] = {}
        self._touches: dict[str, int] = {}
        self._rest_until = 0.0

    def touch(self, campaign: str) -> None:
        """Note that something of a campaign changed, even if its counts stay the same."""
        self._touches[campaign] = self._touches.get(campaign, 0) + 1

    def step(self, daemon: Daemon, campaigns: Sequence[CampaignRow], wanted: str) -> bool:
        """Judge the campaign that needs it most; return whether there was one."""
        began = self._clock()
        row = self._next(campaigns, wanted, began) if began >= self._rest_until else None
        if row is None:
            return False
        state = self._state(row)
        if row.id == wanted:
            results = gather(daemon, row)
            conclusion = conclude(results.assessment, finished=row.finished)
            self.results = results
        else:
            conclusion = judge(daemon, row)
        self.conclusions = {**self.conclusions, row.id: conclusion}
        ended = self._clock()
        self._seen[row.id], self._at[row.id] = state, ended
        if self._every:
            self._rest_until = ended + (ended - began) * (1.0 / _SHARE - 1.0)
        return True

    def _next(
        self, campaigns: Sequence[CampaignRow], wanted: str, now: float
    ) -> CampaignRow | None:
        first = (row for row in campaigns if row.id == wanted)
        due = (row for row in (*first, *campaigns[:JUDGED]) if self._due(row, wanted, now))
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
