"""Live views of runs: published for those who watch all runs, or one of them in detail."""

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
"""An attempt under way. It leaves its trace, then its result, in the attempt's folder.

It is listened to when its ``waitables`` are ready, at ``deadline`` at the latest. ``end`` is
``None`` while anything of it runs as far as can be known here; that of one that is killed comes
within half a minute.
"""
_LIVE_PERIOD: Final = 0.2
"""Seconds between two snapshots of a run for those who watch all runs, at least."""
LINE_RATE: Final = 40_000.0
"""Bytes a second that are published of a run at most, on average over some seconds."""
_BURST: Final = 20_000.0
"""Bytes that may be published at once after a pause."""


@dataclass(slots=True)
class LineBudget:
    """A token bucket: :data:`LINE_RATE` bytes a second, and what exceeds it is owed."""

    left: float = _BURST
    filled_at: float = -math.inf

    def allows(self, now: float, owed: float = 0.0) -> bool:
        """Whether no more than ``owed`` bytes are owed at ``now`` [s]."""
        self.left = min(_BURST, self.left + (now - self.filled_at) * LINE_RATE)
        self.filled_at = now
        return self.left > -owed

    def spend(self, size: int) -> None:
        """Take so many bytes."""
        self.left -= size


@dataclass(slots=True)
class _WatchedRun:
    """One run under way: its own publishers, and what is wanted of it as far as it knows."""

    execution: Execution
    publishers: dict[WatchDetail, zenoh.Publisher]
    budget: LineBudget = field(default_factory=LineBudget)
    wanted: frozenset[WatchDetail] = frozenset()
    published_at: float = 0.0
    began_at: float = field(default_factory=time.monotonic)
    latest: bytes = b""


@dataclass(slots=True)
class LivePublisher:
    """Publishes what executions tell of themselves under the name of their ``worker``."""

    session: zenoh.Session
    worker: str
    name: str
    _all: zenoh.Publisher = field(init=False)
    _runs: dict[str, _WatchedRun] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._all = self._publisher(f"{LIVE}/{self.name}/{self.worker}")

    def _publisher(self, key: str) -> zenoh.Publisher:
        # Telemetry, never the record. With BLOCK a frozen daemon stops this loop for 5 s, and then
        # the transport is closed and everything on it lost.
        drop = zenoh.CongestionControl.DROP
        return self.session.declare_publisher(key, congestion_control=drop)

    def publish(self, execution: Execution) -> None:
        """Pass on what an execution last said of itself, to those who want it."""
        live, execution.live = execution.live, b""
        judged, execution.judged = execution.judged, b""
        if not live and not judged:
            return
        watch = self._watch(execution)
        now = time.monotonic()
        # Rather snapshots are left out than a judgement, of which there is one a second.
        if (
            judged
            and WatchDetail.JUDGEMENT in watch.wanted
            and watch.budget.allows(now, LINE_RATE / 2)
        ):
            watch.budget.spend(len(judged))
            watch.publishers[WatchDetail.JUDGEMENT].put(judged)
        if not live:
            return
        watch.latest = live
        if WatchDetail.DETAILS in watch.wanted and watch.budget.allows(now):
            watch.budget.spend(len(live))
            watch.publishers[WatchDetail.DETAILS].put(live)
        due = now - watch.published_at >= _LIVE_PERIOD and WatchDetail.MARGIN in watch.wanted
        if due and watch.budget.allows(now):
            watch.published_at = now
            bare = _without_details(live) if WatchDetail.DETAILS in watch.wanted else live
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
        listened = {WatchDetail.MARGIN: self._all, **watch.publishers}
        wanted = frozenset(what for what, where in listened.items() if _has_subscribers(where))
        if wanted != watch.wanted:
            watch.wanted = wanted
            execution.watch(wanted)
        return watch

    def progress(self) -> tuple[RunProgress, ...]:
        """Return how far runs are, of the first :data:`MOST_PROGRESS`."""
        now = time.monotonic()
        found = []
        for run, watch in islice(self._runs.items(), MOST_PROGRESS):
            with suppress(ValueError):  # written by the process of a run
                simulated = codec.from_json(LiveSnapshot, watch.latest).snapshot.time
                found.append(RunProgress(run, max(0.0, simulated), now - watch.began_at))
        return tuple(found)

    def forget(self, run: str) -> None:
        """Let go of a run that is over here."""
        if watch := self._runs.pop(run, None):
            for publisher in watch.publishers.values():
                publisher.undeclare()  # type: ignore[no-untyped-call]


def _without_details(live: bytes) -> bytes:
    """Return a snapshot as those see it who watch all runs: of that one, others see the details."""
    try:
        told = codec.from_json(LiveSnapshot, live)
    except ValueError:  # written by the process of a run; who reads it leaves it out
        return live
    bare = replace(told.snapshot, spread=None, returns=(), plan=(), contacts=())
    return codec.to_json(replace(told, snapshot=bare))


def _has_subscribers(publisher: zenoh.Publisher) -> bool:
    """Whether anybody subscribes.

    The status is declared as a bool but is an object, which is always true (zenoh 1.10.2).
    """
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]
