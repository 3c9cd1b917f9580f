"""How long runs take, before they are executed and while they are.

By executed ones of their cell, by others of their system, and by their own speed.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
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
    "SELECT scenario, sut, count(*), total(wall), max(wall), total(time_limit)"
    " FROM (SELECT scenario, sut, wall, time_limit FROM run"
    " WHERE finished_at IS NOT NULL ORDER BY finished_at DESC LIMIT 10000) GROUP BY scenario, sut"
)
# What is paused, or lacks something, waits for people.
_QUEUED: Final = (
    "SELECT campaign.id, priority, scenario, sut, time_limit, count(*)"
    " FROM run JOIN campaign ON campaign.id = run.campaign"
    " WHERE state = 'queued' AND NOT paused AND lacks = ''"
    " GROUP BY campaign.id, scenario, sut, time_limit"
)
_RUNNING: Final = (
    "SELECT campaign.id, priority, scenario, sut, time_limit, run.id, worker, ? - leased_at"
    " FROM run JOIN campaign ON campaign.id = run.campaign WHERE state = 'running'"
)


@dataclass(frozen=True, slots=True)
class RunPace:
    """The pace of a run under way: ``elapsed`` wall time [s], ``speed`` in simulated seconds each.

    The speed is 0 while nothing was simulated.
    """

    elapsed: float
    speed: float


class _Durations:
    """Wall times of executed runs [s], by which others are estimated."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._mean: dict[tuple[str, str], float] = {}
        self._longest: dict[tuple[str, str], float] = {}
        walls, limits = defaultdict[str, float](float), defaultdict[str, float](float)
        for scenario, sut, runs, wall, longest, limit in db.execute(_EXECUTED):
            self._mean[scenario, sut] = wall / runs
            self._longest[scenario, sut] = longest
            walls[sut] += wall
            limits[sut] += limit
        self._share = {sut: walls[sut] / limit for sut, limit in limits.items() if limit > 0.0}

    def of(self, scenario: str, sut: str, limit: float) -> float | None:
        """Return the mean of a cell, or else what its system takes of a ``limit`` elsewhere."""
        mean = self._mean.get((scenario, sut))
        share = self._share.get(sut)
        return mean if mean is not None else None if share is None else share * limit

    def rest(
        self, scenario: str, sut: str, limit: float, elapsed: float, speed: float
    ) -> float | None:
        """Return how long a run under way goes on, ``None`` where nothing tells.

        It ends as the mean of its cell; if it is over that, as the longest; if it is over that as
        well, at its limit, as at its speed in a cell without an executed run.
        """
        cell = scenario, sut
        at_limit = limit / speed if speed > 0.0 else self.of(scenario, sut, limit)
        for whole in (self._mean.get(cell), self._longest.get(cell), at_limit):
            if whole is not None and whole > elapsed:
                return whole - elapsed
        return None


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """A run by the ``digest`` of its specification; only ``repeatable`` ones reuse results.

    It ends after ``limit`` simulated seconds.
    """

    digest: str
    scenario: str
    sut: str
    limit: float
    repeatable: bool = True


@dataclass(frozen=True, slots=True)
class Forecast:
    """For each run whether it has a result already, and how long it takes a worker [s].

    The time is ``None`` while nothing of its system was executed.
    """

    cached: Sequence[bool]
    seconds: Sequence[float | None]


def read_forecast(db: sqlite3.Connection, runs: Sequence[PlannedRun]) -> Forecast:
    """Return which runs need not be executed, and how long each takes."""
    durations = _Durations(db)
    digests = json.dumps([run.digest for run in runs if run.repeatable])
    known = {digest for (digest,) in db.execute(_WITH_RESULT, (digests,))}
    return Forecast(
        tuple(run.repeatable and run.digest in known for run in runs),
        tuple(durations.of(run.scenario, run.sut, run.limit) for run in runs),
    )


@dataclass(frozen=True, slots=True)
class TimeLeft:
    """Seconds until nothing waits or runs, over all and by campaign.

    ``None``, and no entry, when nothing does, and while nobody knows. Of paused campaigns only
    what runs counts.
    """

    all: float | None = None
    campaigns: Mapping[str, float] = field(default_factory=dict)

    def after(self, passed: float) -> TimeLeft:
        """Return what of it is left so many seconds later; nobody knows what is over by then."""
        whole = None if self.all is None or self.all <= passed else self.all - passed
        campaigns = {one: left - passed for one, left in self.campaigns.items() if left > passed}
        return TimeLeft(whole, campaigns)


@dataclass(slots=True)
class _Work:
    """Runs that are left of a campaign: their number, seconds on one slot, those of the longest.

    ``queued`` is the longest that has not begun [s]. The seconds are infinite while nobody knows
    how long one of them takes.
    """

    priority: int = 0
    runs: int = 0
    seconds: float = 0.0
    longest: float = 0.0
    queued: float = 0.0

    def add(self, runs: int, each: float) -> None:
        """Add ``runs`` that take so long ``each`` [s]."""
        self.runs += runs
        self.seconds += runs * each
        self.longest = max(self.longest, each)


def read_time_left(
    db: sqlite3.Connection,
    now: float,
    slots: int,
    paces: Mapping[str, RunPace],
    preparing: Collection[str] = (),
) -> TimeLeft:
    """Return how long what is left takes on ``slots``; campaigns of one priority take turns.

    ``paces`` are those of runs under way. Others have begun when they were leased, unless their
    worker is ``preparing``: nobody knows when it will begin.
    """
    if not slots:
        return TimeLeft()
    durations, work = _Durations(db), defaultdict[str, _Work](_Work)
    speeds: dict[str, float] = {}
    rests: list[float] = []
    for campaign, priority, scenario, sut, limit, run, worker, leased in db.execute(
        _RUNNING, (now,)
    ):
        pace = paces.get(run) or RunPace(max(0.0, leased), 0.0)
        if pace.speed > 0.0:
            speeds[sut] = pace.speed
        waits = run not in paces and worker in preparing
        rest = durations.rest(scenario, sut, limit, pace.elapsed, pace.speed)
        work[campaign].priority = priority
        rests.append(math.inf if waits or rest is None else rest)
        work[campaign].add(1, rests[-1])
    for campaign, priority, scenario, sut, limit, runs in db.execute(_QUEUED):
        each = durations.of(scenario, sut, limit)
        if each is None:
            each = limit / speeds[sut] if sut in speeds else math.inf
        work[campaign].priority = priority
        work[campaign].add(runs, each)
        work[campaign].queued = max(work[campaign].queued, each)
    for row in read_searches(db, SearchQuery(unfinished=True)):
        if (one := work.get(row.campaign)) is not None:
            # Those it may still propose: as those it has.
            one.add(max(0, row.task.runs - row.proposed), one.seconds / one.runs)
    seconds = sum(one.seconds for one in work.values())
    # No run is interrupted: what waits begins when one that holds a slot ends.
    free = min(rests) if len(rests) >= slots else 0.0

    def longest(one: _Work) -> float:
        return max(one.longest, free + one.queued if one.queued else 0.0)

    def last(one: _Work) -> float:
        before = sum(other.seconds for other in work.values() if other.priority > one.priority)
        beside = (
            min(other.seconds, one.seconds)
            for other in work.values()
            if other.priority == one.priority
        )
        return max(longest(one), (before + sum(beside)) / slots)

    whole = max((*map(longest, work.values()), seconds / slots))
    lasts = {campaign: last(one) for campaign, one in work.items()}
    return TimeLeft(
        whole if work and math.isfinite(whole) else None,
        {campaign: left for campaign, left in lasts.items() if math.isfinite(left)},
    )
