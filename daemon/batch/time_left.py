"""How long the runs that wait and run will still take: by cell, from repeats that have finished.

A queue in which one system under test takes ten times as long as another has no pace: the last
hour says nothing about the next. So every run that is left is given the time that it probably
takes, and all of them are laid on the slots there are, in the order in which they are leased.
"""

from __future__ import annotations

import heapq
import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

_PARTS_OF_A_SLOT: Final = 50
"""Parts that a queue is laid on each slot in, at least: the end is wrong by less than one."""
_FEWEST_PARTS: Final = 2000
"""Up to so many runs are laid one by one."""
_SETTLING: Final = 5.0
"""Seconds after which two thirds of a new estimate are said."""
_TELLING: Final = 0.1
"""Share of its limit that a run has to have simulated before its speed tells how long others take:
what it waited for at its start is most of its time until then."""
_LEAST_REST: Final = 0.05
"""What a run that takes longer than its repeats still takes, as a share of what they took."""


@dataclass(frozen=True, slots=True)
class ExecutedRuns:
    """Runs that were executed to their end: how many, and sums over them [s].

    ``wall`` is what they took, ``simulated`` what they simulated, ``limit`` what they might have.
    """

    runs: int = 0
    wall: float = 0.0
    simulated: float = 0.0
    limit: float = 0.0

    def __add__(self, other: ExecutedRuns) -> ExecutedRuns:
        return ExecutedRuns(
            self.runs + other.runs,
            self.wall + other.wall,
            self.simulated + other.simulated,
            self.limit + other.limit,
        )


@dataclass(frozen=True, slots=True)
class CellWork:
    """The runs of a scenario with a system under test: ``queued`` ones with limits of ``limit`` [s]
    on average, and what is known of its repeats.

    ``earlier`` are those of the campaign of the same name before this one.
    """

    scenario: str
    sut: str
    queued: int
    limit: float
    executed: ExecutedRuns = ExecutedRuns()
    earlier: ExecutedRuns = ExecutedRuns()


@dataclass(frozen=True, slots=True)
class RunProgress:
    """What a worker has said of a run: ``simulated`` seconds, by the wall clock's time ``at``."""

    simulated: float
    at: float


@dataclass(frozen=True, slots=True)
class RunInProgress:
    """A run that was leased ``elapsed`` seconds ago; ``age`` seconds ago it had simulated
    ``simulated`` seconds.
    """

    scenario: str
    sut: str
    limit: float
    elapsed: float
    simulated: float = 0.0
    age: float = 0.0


@dataclass(frozen=True, slots=True)
class CampaignWork:
    """What is left of a campaign, its cells in the order of their runs.

    Runs that wait start only if it is not ``paused``; those of higher ``priority`` start first.
    ``more`` are runs that a search has not proposed yet. There is no saying how long the runs take
    that it may add to them: its time is that of these.
    """

    id: str
    cells: tuple[CellWork, ...]
    running: tuple[RunInProgress, ...] = ()
    paused: bool = False
    priority: int = 0
    more: int = 0


@dataclass(frozen=True, slots=True)
class TimeLeft:
    """Seconds until nothing waits or runs, over all and by campaign; ``None`` while not known.

    Paused campaigns have no time of their own, and count in ``all`` with what runs of them.
    """

    all: float | None = None
    campaigns: Mapping[str, float | None] = field(default_factory=dict)


def follow_time_left(before: TimeLeft, passed: float, found: TimeLeft) -> TimeLeft:
    """Return what to say ``passed`` seconds after ``before`` was said, when now ``found`` is known.

    What is said comes nearer to what is known in some seconds: the first run of a cell that
    finishes may change what is thought of many others.
    """
    share = 1.0 - math.exp(-passed / _SETTLING)

    def follow(last: float | None, known: float | None) -> float | None:
        # Nothing is left, or not known, at once.
        if not known or not last:
            return known
        expected = max(0.0, last - passed)
        return expected + share * (known - expected)

    return TimeLeft(
        follow(before.all, found.all),
        {name: follow(before.campaigns.get(name), one) for name, one in found.campaigns.items()},
    )


def estimate_time_left(work: Sequence[CampaignWork], slots: int) -> TimeLeft:
    """Return how long what is left takes on ``slots``; campaigns of one priority take turns.

    Nothing is known while no slot is there, or while a run waits and nothing shows how fast runs
    are: none has been executed, and none that goes on has come far enough to tell.
    """
    busy = sum(len(one.running) for one in work)
    slots = max(slots, busy)
    speeds = {one.id: CellTimes(one, work) for one in work}
    lanes: list[float] = []
    ends: dict[str, float | None] = {one.id: 0.0 for one in work if not one.paused}
    whole = 0.0
    for one in work:
        for run in one.running:
            rest = speeds[one.id].rest(run)
            _note_end(ends, one.id, rest)
            whole = math.inf if rest is None else max(whole, rest)
            lanes.append(rest or 0.0)
    lanes += [0.0] * (slots - len(lanes))
    waiting = [one for one in work if not one.paused and _queued(one)]
    if waiting and not lanes:
        return TimeLeft(None, dict.fromkeys(ends))
    heapq.heapify(lanes)
    for priority in sorted({one.priority for one in waiting}, reverse=True):
        turn = [one for one in waiting if one.priority == priority]
        whole = max(whole, _lay(turn, speeds, lanes, ends))
    return TimeLeft(whole if math.isfinite(whole) else None, ends)


def _queued(work: CampaignWork) -> int:
    return work.more + sum(cell.queued for cell in work.cells)


def _note_end(ends: dict[str, float | None], campaign: str, end: float | None) -> None:
    """Take in that a run of a campaign ends then; once that is not known of one it stays so."""
    known = ends.get(campaign)
    if campaign in ends and known is not None:
        ends[campaign] = None if end is None else max(known, end)


def _lay(
    turn: Sequence[CampaignWork],
    times: Mapping[str, CellTimes],
    lanes: list[float],
    ends: dict[str, float | None],
) -> float:
    """Lay what waits of campaigns that take turns on the lanes, each time on that which is free
    first; return when the last run ends.
    """
    waiting = sum(_queued(one) for one in turn)
    size = max(1, waiting // max(_FEWEST_PARTS, _PARTS_OF_A_SLOT * len(lanes)))
    queues = deque((one.id, deque(_parts(one, times[one.id], size))) for one in turn)
    last = 0.0
    while queues:
        campaign, parts = queues.popleft()
        runs, seconds = parts.popleft()
        if seconds is None:
            # Nobody knows when those behind it begin.
            _note_end(ends, campaign, None)
            last = math.inf
            continue
        end = lanes[0] + runs * seconds
        heapq.heapreplace(lanes, end)
        last = max(last, end)
        _note_end(ends, campaign, end)
        if parts:
            queues.append((campaign, parts))
    return last


def _parts(work: CampaignWork, times: CellTimes, size: int) -> Iterable[tuple[int, float | None]]:
    """Yield so many runs that take so long each, in order."""
    cells = [
        (cell.queued, times.of_run(cell.scenario, cell.sut, cell.limit)) for cell in work.cells
    ]
    cells.append((work.more, times.of_any()))
    for queued, seconds in cells:
        for first in range(0, queued, size):
            yield min(size, queued - first), seconds


def _pace_by_sut(running: Iterable[RunInProgress]) -> dict[str, tuple[float, float]]:
    """Return by system under test what runs in progress took, and what they simulated in it [s]."""
    paces: dict[str, tuple[float, float]] = {}
    for run in running:
        if run.simulated >= _TELLING * run.limit:
            pace = (run.elapsed - run.age, run.simulated)
            paces[run.sut] = _summed((paces.get(run.sut, (0.0, 0.0)), pace))
    return paces


def _summed(paces: Iterable[tuple[float, float]]) -> tuple[float, float]:
    found = list(paces)
    return sum(wall for wall, _ in found), sum(simulated for _, simulated in found)


class CellTimes:
    """How long runs of a campaign take, by their cell, else by what is most like them.

    Where nothing of it was executed those of ``all_work`` tell, at last those that go on.
    """

    def __init__(self, work: CampaignWork, all_work: Sequence[CampaignWork]) -> None:
        self._cells = {(cell.scenario, cell.sut): cell for cell in work.cells}
        self._suts: dict[str, ExecutedRuns] = {}
        for cell in work.cells:
            found = cell.executed if cell.executed.runs else cell.earlier
            self._suts[cell.sut] = self._suts.get(cell.sut, ExecutedRuns()) + found
        self._any = sum(self._suts.values(), ExecutedRuns())
        self._running = _pace_by_sut(work.running)
        # Of systems of which nothing runs yet either, others are better than nothing.
        paces = self._running or _pace_by_sut(run for one in all_work for run in one.running)
        self._any_running = _summed(paces.values())
        if not self._any.runs:
            # Better than nothing: other campaigns on the same machines.
            others = [cell.executed for one in all_work for cell in one.cells]
            self._any = sum(others, ExecutedRuns())

    def of_run(self, scenario: str, sut: str, limit: float) -> float | None:
        """Return the seconds that a run with that ``limit`` [s simulated] takes, if known."""
        if (same := self._executed(scenario, sut)) is not None:
            return same.wall / same.runs
        alike = self._suts.get(sut, ExecutedRuns())
        # A limit is no duration: runs take the share of it that others have taken.
        if alike.limit > 0.0:
            return limit * alike.wall / alike.limit
        wall, simulated = self._running.get(sut, (0.0, 0.0))
        if simulated > 0.0:
            share = self._any.simulated / self._any.limit if self._any.limit > 0.0 else 1.0
            return limit * share * wall / simulated
        if self._any.limit > 0.0:
            return limit * self._any.wall / self._any.limit
        wall, simulated = self._any_running
        return limit * wall / simulated if simulated > 0.0 else None

    def of_any(self) -> float | None:
        """Return the seconds that any run takes."""
        return self._any.wall / self._any.runs if self._any.runs else None

    def rest(self, run: RunInProgress) -> float | None:
        """Return the seconds that a run in progress still takes."""
        whole = self.of_run(run.scenario, run.sut, run.limit)
        if whole is None:
            return None
        left = whole - run.elapsed
        known = self._executed(run.scenario, run.sut)
        if run.simulated > 0.0 and known is not None and known.simulated > 0.0:
            # By what it has simulated rather than by the clock: it may have waited for a scene, or
            # for machine code, before it began.
            left = whole * (1.0 - run.simulated * known.runs / known.simulated) - run.age
        return max(left, whole * _LEAST_REST)

    def _executed(self, scenario: str, sut: str) -> ExecutedRuns | None:
        """Return the repeats of a cell that were executed, of this campaign or the one before."""
        cell = self._cells.get((scenario, sut))
        if cell is None:
            return None
        return next((found for found in (cell.executed, cell.earlier) if found.runs), None)
