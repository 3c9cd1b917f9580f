"""Publication of live views of runs: all runs in brief, single runs in detail."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING, Final, TypeAlias

import zenoh

from daemon.batch.run_process import WatchDetail
from daemon.model.messages import JUDGED, LIVE, MOST_PROGRESS, RunProgress
from daemon.model.status import LiveSnapshot
from grammars.text import codec

if TYPE_CHECKING:
    from daemon.batch.worker._dask import DaskExecution
    from daemon.batch.worker._zygotes import ForkedExecution

Execution: TypeAlias = "ForkedExecution | DaskExecution"
"""A running attempt. It writes its trace, then its result, into the attempt's folder.

Call ``listen`` when its ``waitables`` are ready, at ``deadline`` at the latest. ``end`` is ``None``
while any of its processes may run; after ``kill`` it is set within half a minute.
"""
_LIVE_PERIOD: Final = 0.2
"""Least time between two snapshots of a run for watchers of all runs [s]."""
LINE_RATE: Final = 40_000.0
"""Most bytes a second published of a run, on average over some seconds."""
_BURST: Final = 20_000.0
"""Most bytes published at once after a pause."""


@dataclass(slots=True)
class LineBudget:
    """A token bucket of :data:`LINE_RATE` bytes a second; ``balance`` may become a debt."""

    balance: float = _BURST
    filled_at: float = -math.inf

    def allows(self, now: float, debt: float = 0.0) -> bool:
        """Return whether the debt at ``now`` [s] is below ``debt`` bytes."""
        self.balance = min(_BURST, self.balance + (now - self.filled_at) * LINE_RATE)
        self.filled_at = now
        return self.balance > -debt

    def spend(self, size: int) -> None:
        """Take ``size`` bytes."""
        self.balance -= size


@dataclass(slots=True)
class _WatchedRun:
    """A running run: its own publishers, and the details last requested from it."""

    execution: Execution
    publishers: dict[WatchDetail, zenoh.Publisher]
    budget: LineBudget = field(default_factory=LineBudget)
    details: frozenset[WatchDetail] = frozenset()
    published_at: float = 0.0
    began_at: float = field(default_factory=time.monotonic)
    latest: bytes = b""


@dataclass(slots=True)
class LivePublisher:
    """Publishes snapshots and judgements of executions under the name of their ``worker``."""

    session: zenoh.Session
    worker: str
    name: str
    _all: zenoh.Publisher = field(init=False)
    _runs: dict[str, _WatchedRun] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._all = self._publisher(f"{LIVE}/{self.name}/{self.worker}")

    def _publisher(self, key: str) -> zenoh.Publisher:
        # Telemetry only. With BLOCK a frozen daemon would stop this loop for 5 s, and then close
        # the transport, with the loss of everything on it.
        drop = zenoh.CongestionControl.DROP
        return self.session.declare_publisher(key, congestion_control=drop)

    def publish(self, execution: Execution) -> None:
        """Publish the latest snapshot and judgement of an execution to its watchers."""
        live, execution.live = execution.live, b""
        judged, execution.judged = execution.judged, b""
        if not live and not judged:
            return
        watch = self._watch(execution)
        now = time.monotonic()
        # A judgement has priority over snapshots, since there is only one a second.
        if (
            judged
            and WatchDetail.JUDGEMENT in watch.details
            and watch.budget.allows(now, LINE_RATE / 2)
        ):
            watch.budget.spend(len(judged))
            watch.publishers[WatchDetail.JUDGEMENT].put(judged)
        if not live:
            return
        watch.latest = live
        if WatchDetail.DETAILS in watch.details and watch.budget.allows(now):
            watch.budget.spend(len(live))
            watch.publishers[WatchDetail.DETAILS].put(live)
        due = now - watch.published_at >= _LIVE_PERIOD and WatchDetail.MARGIN in watch.details
        if due and watch.budget.allows(now):
            watch.published_at = now
            bare = _without_details(live) if WatchDetail.DETAILS in watch.details else live
            watch.budget.spend(len(bare))
            self._all.put(bare)

    def _watch(self, execution: Execution) -> _WatchedRun:
        run = execution.attempt.lease.run
        watch = self._runs.get(run)
        if watch is None or watch.execution is not execution:
            self.forget(run)
            key = f"{LIVE}/{self.name}/{self.worker}/{run}"
            keys = {WatchDetail.DETAILS: key, WatchDetail.JUDGEMENT: f"{key}/{JUDGED}"}
            publishers = {what: self._publisher(key) for what, key in keys.items()}
            watch = self._runs[run] = _WatchedRun(execution, publishers)
        publishers = {WatchDetail.MARGIN: self._all, **watch.publishers}
        details = frozenset(one for one, where in publishers.items() if _has_subscribers(where))
        if details != watch.details:
            watch.details = details
            execution.watch(details)
        return watch

    def progress(self) -> tuple[RunProgress, ...]:
        """Return the progress of the first :data:`MOST_PROGRESS` runs."""
        now = time.monotonic()
        reports = []
        for run, watch in islice(self._runs.items(), MOST_PROGRESS):
            with suppress(ValueError):  # written by the process of a run
                simulated = codec.from_json(LiveSnapshot, watch.latest).snapshot.time
                reports.append(RunProgress(run, max(0.0, simulated), now - watch.began_at))
        return tuple(reports)

    def forget(self, run: str) -> None:
        """Forget a run that has ended here."""
        if watch := self._runs.pop(run, None):
            for publisher in watch.publishers.values():
                publisher.undeclare()  # type: ignore[no-untyped-call]


def _without_details(live: bytes) -> bytes:
    """Return a snapshot for watchers of all runs, without the details for watchers of one run."""
    try:
        value = codec.from_json(LiveSnapshot, live)
    except ValueError:  # written by the process of a run; readers skip it
        return live
    bare = replace(value.snapshot, spread=None, returns=(), plan=(), contacts=())
    return codec.to_json(replace(value, snapshot=bare))


def _has_subscribers(publisher: zenoh.Publisher) -> bool:
    """Return whether a publisher has subscribers.

    The status is declared as a bool but is an object, which is always true (zenoh 1.10.2).
    """
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]
