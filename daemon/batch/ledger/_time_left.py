"""How long runs take, before and while they wait: by what executed ones of their cell took."""

from __future__ import annotations

import json
import sqlite3
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.ledger._searches import read_searches
from daemon.model.search_answer import SearchQuery

# As results are found for runs that are submitted (``_results._FIND_RESULTS``).
_WITH_RESULT: Final = (
    "SELECT DISTINCT digest FROM run AS old WHERE digest IN (SELECT value FROM json_each(?))"
    " AND result <> '' AND repeatable AND state = 'done' AND outcome <> 'error'"
    " AND NOT EXISTS (SELECT 1 FROM run AS alarm WHERE alarm.digest = old.digest"
    " AND alarm.doubted = 1)"
)
# The latest ones tell most, and a large ledger costs no more than a small one.
_EXECUTED: Final = (
    "SELECT scenario, sut, count(*), total(wall) FROM (SELECT scenario, sut, wall FROM run"
    " WHERE finished_at IS NOT NULL ORDER BY finished_at DESC LIMIT 10000) GROUP BY scenario, sut"
)
# Of paused campaigns only what runs.
_LEFT: Final = (
    "SELECT campaign.id, priority, scenario, sut, state, count(*), total(?1 - leased_at)"
    " FROM run JOIN campaign ON campaign.id = run.campaign"
    " WHERE state = 'running' OR (state = 'queued' AND NOT paused)"
    " GROUP BY campaign.id, scenario, sut, state"
)
_LEAST_REST: Final = 0.05
"""What a run that takes longer than others of its cell still takes, as a share of their time."""


class _MeanTimes:
    """Mean times that executed runs took [s]."""

    def __init__(self, db: sqlite3.Connection) -> None:
        sums: dict[tuple[str, str], tuple[int, float]] = defaultdict(lambda: (0, 0.0))
        for scenario, sut, runs, wall in db.execute(_EXECUTED):
            for key in ((scenario, sut), ("", sut), ("", "")):
                known, seconds = sums[key]
                sums[key] = known + runs, seconds + wall
        self._means = {key: seconds / runs for key, (runs, seconds) in sums.items()}

    def of(self, scenario: str = "", sut: str = "") -> float | None:
        """Return that of a cell, else of its system under test, else of all; ``None`` if none."""
        keys = ((scenario, sut), ("", sut), ("", ""))
        return next((self._means[key] for key in keys if key in self._means), None)


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """A run by the ``digest`` of its specification; only ``repeatable`` ones reuse results."""

    digest: str
    scenario: str
    sut: str
    repeatable: bool = True


@dataclass(frozen=True, slots=True)
class Forecast:
    """For each run whether it has a result already, and how long it takes a worker [s].

    The time is ``None`` while nothing was executed.
    """

    cached: Sequence[bool]
    seconds: Sequence[float | None]


def read_forecast(db: sqlite3.Connection, runs: Sequence[PlannedRun]) -> Forecast:
    """Return which runs need not be executed, and how long each takes."""
    times = _MeanTimes(db)
    digests = json.dumps([run.digest for run in runs if run.repeatable])
    known = {digest for (digest,) in db.execute(_WITH_RESULT, (digests,))}
    return Forecast(
        tuple(run.repeatable and run.digest in known for run in runs),
        tuple(times.of(run.scenario, run.sut) for run in runs),
    )


@dataclass(frozen=True, slots=True)
class TimeLeft:
    """Seconds until nothing waits or runs, over all and by campaign.

    ``None``, and no entry, when nothing does, and while nobody knows. Of paused campaigns only
    what runs counts.
    """

    all: float | None = None
    campaigns: Mapping[str, float] = field(default_factory=dict)


@dataclass(slots=True)
class _Work:
    """Runs that are left of a campaign: seconds on one slot, and those of the longest run."""

    priority: int = 0
    seconds: float = 0.0
    longest: float = 0.0

    def add(self, seconds: float, longest: float) -> None:
        self.seconds += seconds
        self.longest = max(self.longest, longest)


def read_time_left(db: sqlite3.Connection, now: float, slots: int) -> TimeLeft:
    """Return how long what is left takes on ``slots``; campaigns of one priority take turns."""
    times = _MeanTimes(db)
    work: dict[str, _Work] = defaultdict(_Work)
    for campaign, priority, scenario, sut, state, runs, elapsed in db.execute(_LEFT, (now,)):
        mean = times.of(scenario, sut)
        if mean is None or not slots:
            return TimeLeft()
        whole = runs * mean
        rest = max(_LEAST_REST * whole, whole - max(0.0, elapsed)) if state == "running" else whole
        work[campaign].priority = priority
        work[campaign].add(rest, rest / runs)
    for row in read_searches(db, SearchQuery(unfinished=True)):
        # Nothing shows how long the runs take that a search may still propose: as any.
        if row.campaign in work:
            work[row.campaign].add(max(0, row.task.runs - row.proposed) * (times.of() or 0.0), 0.0)
    whole = _Work()
    for one in work.values():
        whole.add(one.seconds, one.longest)

    def last(one: _Work) -> float:
        before = sum(other.seconds for other in work.values() if other.priority > one.priority)
        beside = (
            min(other.seconds, one.seconds)
            for other in work.values()
            if other.priority == one.priority
        )
        return max(one.longest, (before + sum(beside)) / slots)

    return TimeLeft(
        max(whole.longest, whole.seconds / slots) if work else None,
        {campaign: last(one) for campaign, one in work.items()},
    )
