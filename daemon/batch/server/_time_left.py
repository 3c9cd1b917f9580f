"""The estimate of how long what is left takes, kept for a while between two questions."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

from daemon.batch.ledger import LedgerReader
from daemon.batch.server._workers import WorkerRegistry
from daemon.batch.time_left import TimeLeft, estimate_time_left, follow_time_left

_FRESH: Final = 0.25
"""Seconds for which an estimate holds, at least: several questions come with each look."""
_SHARE: Final = 0.05
"""Of the time of the thread that answers questions, at most so much goes into estimates: to count
what is left of 100,000 runs takes a quarter of a second."""


@dataclass(frozen=True, slots=True)
class _Estimate:
    made_at: float
    until: float
    left: TimeLeft
    about: object = None


class TimeLeftClock:
    """Says how long what is left takes; between two estimates the time that passes is taken off."""

    def __init__(self, registry: WorkerRegistry) -> None:
        self._registry = registry
        self._last = _Estimate(0.0, 0.0, TimeLeft())

    def of_all(self, ledger: LedgerReader, now: float) -> float | None:
        """Return the seconds until nothing waits or runs; ``None`` if nothing does or while nobody
        knows.
        """
        found = self._estimate(ledger, now)
        return _after(found.left.all, now - found.made_at)

    def of_campaign(self, ledger: LedgerReader, campaign: str, now: float) -> float | None:
        """Return the seconds until nothing of a campaign waits or runs, likewise."""
        found = self._estimate(ledger, now)
        return _after(found.left.campaigns.get(campaign), now - found.made_at)

    def _estimate(self, ledger: LedgerReader, now: float) -> _Estimate:
        last = self._last
        if last.made_at <= now < last.until:
            return last
        begun = time.perf_counter()
        rows = self._registry.rows()
        slots = sum(row.slots for row in rows if not row.away and not row.trouble)
        work = ledger.workload(now, self._registry.progress())
        left = estimate_time_left(work, slots)
        # What people do, or a worker that comes or leaves, is seen at once.
        about = (slots, tuple((one.id, one.paused, one.priority) for one in work))
        if about == last.about and now > last.made_at:
            left = follow_time_left(last.left, now - last.made_at, left)
        took = time.perf_counter() - begun
        self._last = _Estimate(now, now + max(_FRESH, took / _SHARE), left, about)
        return self._last


def _after(seconds: float | None, passed: float) -> float | None:
    # Nothing that is left takes no time: then there is nothing to say.
    return max(0.0, seconds - passed) if seconds else None
