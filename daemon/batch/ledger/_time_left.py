"""Expected times of runs, before and during their execution.

Estimated from executed runs of their cell, from others of their system, and from their own speed.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.ledger._queries import read_searches
from daemon.model.search_answer import SearchQuery
from daemon.model.submission import Submission

# The rules of reuse for submitted runs (``_results._FIND_RESULTS``).
_WITH_RESULT: Final = (
    "SELECT DISTINCT digest FROM run AS old WHERE digest IN (SELECT value FROM json_each(?))"
    " AND result <> '' AND repeatable AND state = 'done' AND outcome <> 'error'"
    " AND NOT EXISTS (SELECT 1 FROM run AS alarm WHERE alarm.digest = old.digest"
    " AND alarm.doubted = 1)"
)
# The latest runs are the best guide, and limit the cost for a large ledger.
_EXECUTED: Final = (
    "SELECT scenario, sut, count(*), total(wall), max(wall), total(time_limit)"
    " FROM (SELECT scenario, sut, wall, time_limit FROM run"
    " WHERE finished_at IS NOT NULL ORDER BY finished_at DESC LIMIT 10000) GROUP BY scenario, sut"
)
# Without campaigns that are paused or lack something: these wait for people.
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
    """Pace of a started run: ``elapsed`` wall time [s] and ``speed`` in simulated seconds a second.

    The speed is 0 before the first simulated time.
    """

    elapsed: float
    speed: float


class _Durations:
    """Wall times of executed runs [s], to estimate others; infinite if unknown."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._cells: dict[tuple[str, str], tuple[float, float]] = {}
        walls, limits = defaultdict[str, float](float), defaultdict[str, float](float)
        for scenario, sut, runs, wall, longest, limit in db.execute(_EXECUTED):
            self._cells[scenario, sut] = wall / runs, longest
            walls[sut] += wall
            limits[sut] += limit
        self._share = {sut: walls[sut] / limit for sut, limit in limits.items() if limit > 0.0}

    def of(self, scenario: str, sut: str, limit: float) -> float:
        """Return the mean of a cell, otherwise ``limit`` times the mean share of its system."""
        if (scenario, sut) in self._cells:
            return self._cells[scenario, sut][0]
        return self._share.get(sut, math.inf) * limit

    def rest(self, scenario: str, sut: str, limit: float, pace: RunPace) -> float:
        """Return the remaining time of a started run.

        It ends at the mean of its cell; if that has passed, at the longest. Beyond that, and
        without an executed run, it ends at its limit by its own speed.
        """
        at_limit = limit / pace.speed if pace.speed > 0.0 else self.of(scenario, sut, limit)
        wholes = (*self._cells.get((scenario, sut), ()), at_limit)
        return next((one for one in wholes if one > pace.elapsed), math.inf) - pace.elapsed


@dataclass(frozen=True, slots=True)
class Forecast:
    """For each run: whether it has a result already, and its expected time on a worker [s].

    The time is ``None`` before a run of its system was executed.
    """

    cached: Sequence[bool]
    seconds: Sequence[float | None]


def read_forecast(db: sqlite3.Connection, submission: Submission) -> Forecast:
    """Return for each run of a submission whether it has a result, and its expected time."""
    durations, digests = _Durations(db), submission.digests
    executed = {digest for (digest,) in db.execute(_WITH_RESULT, (json.dumps(digests),))}
    cells = (submission.cells[run.cell] for run in submission.runs)
    seconds = (durations.of(cell.scenario, cell.sut.name, cell.limit) for cell in cells)
    return Forecast(
        tuple(digest in executed for digest in digests),
        tuple(one if math.isfinite(one) else None for one in seconds),
    )


@dataclass(frozen=True, slots=True)
class TimeLeft:
    """Time until no run waits or runs [s], over all and by campaign.

    ``None``, and no entry, if idle or unknown. Of paused campaigns only running runs count.
    """

    all: float | None = None
    campaigns: Mapping[str, float] = field(default_factory=dict)

    def after(self, passed: float) -> TimeLeft:
        """Return the rest ``passed`` seconds later, without times that are over by then."""
        whole = None if self.all is None or self.all <= passed else self.all - passed
        campaigns = {one: rest - passed for one, rest in self.campaigns.items() if rest > passed}
        return TimeLeft(whole, campaigns)


@dataclass(slots=True)
class _Work:
    """Remaining runs of a campaign: number, seconds on one slot, seconds of the longest run.

    ``queued`` is the longest run that has not begun [s]. The seconds are infinite if the time of
    one of them is unknown.
    """

    priority: int = 0
    runs: int = 0
    seconds: float = 0.0
    longest: float = 0.0
    queued: float = 0.0

    def add(self, runs: int, each: float) -> None:
        """Add ``runs`` of ``each`` seconds."""
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
    """Return the expected time of the rest on ``slots``; campaigns of one priority take turns.

    ``paces`` are those of started runs. Others began with their lease, unless their worker is
    ``preparing``: its start is unknown.
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
        rests.append(math.inf if waits else durations.rest(scenario, sut, limit, pace))
        work[campaign].priority = priority
        work[campaign].add(1, rests[-1])
    for campaign, priority, scenario, sut, limit, runs in db.execute(_QUEUED):
        each = durations.of(scenario, sut, limit)
        if each == math.inf and sut in speeds:
            each = limit / speeds[sut]
        work[campaign].priority = priority
        work[campaign].add(runs, each)
        work[campaign].queued = max(work[campaign].queued, each)
    for row in read_searches(db, SearchQuery(unfinished=True)):
        if (one := work.get(row.campaign)) is not None:
            # Future proposals are estimated like the present ones.
            one.add(max(0, row.task.runs - row.proposed), one.seconds / one.runs)
    seconds = sum(one.seconds for one in work.values())
    # Runs are not interrupted: a waiting run begins when a running one ends.
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
        {campaign: rest for campaign, rest in lasts.items() if math.isfinite(rest)},
    )
