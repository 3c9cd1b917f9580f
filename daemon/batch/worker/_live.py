"""Live views of runs: published for those who watch all runs, or one of them in detail."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import zenoh

from daemon.batch.run_process import WATCHED
from daemon.batch.worker._attempts import Execution
from daemon.model.messages import LIVE, OWNER
from daemon.model.status import LiveSnapshot
from grammars.text import codec

_LIVE_PERIOD: Final = 0.2
"""Seconds between two snapshots of a run for those who watch all runs, at least."""


@dataclass(slots=True)
class _WatchedRun:
    """One run under way: its own publisher, and whether its folder says that it is watched."""

    publisher: zenoh.Publisher
    folder: Path
    watched: bool = False
    published_at: float = 0.0
    latest: bytes = b""


@dataclass(slots=True)
class LivePublisher:
    """Publishes what executions tell of themselves under the name of their ``worker``."""

    session: zenoh.Session
    worker: str
    name: str = OWNER
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
        if not live:
            return
        watch = self._watch(execution)
        watch.latest = live
        now = time.monotonic()
        if watch.watched:
            watch.publisher.put(live)
        if now - watch.published_at >= _LIVE_PERIOD and _has_subscribers(self._all):
            watch.published_at = now
            self._all.put(live)

    def _watch(self, execution: Execution) -> _WatchedRun:
        run, folder = execution.attempt.lease.run, execution.attempt.folder
        watch = self._runs.get(run)
        if watch is None or watch.folder != folder:
            self.forget(run)
            key = f"{LIVE}/{self.name}/{self.worker}/{run}"
            watch = self._runs[run] = _WatchedRun(self._publisher(key), folder)
        watched = _has_subscribers(watch.publisher)
        if watched != watch.watched:
            watch.watched = watched
            mark = folder / WATCHED
            if watched:
                mark.touch()
            else:
                mark.unlink(missing_ok=True)
        return watch

    def simulated(self, run: str) -> float:
        """Return how far a run is, as it last said [s simulated]; 0 while it has said nothing."""
        watch = self._runs.get(run)
        if watch is None or not watch.latest:
            return 0.0
        try:
            return max(0.0, codec.from_json(LiveSnapshot, watch.latest).snapshot.time)
        except ValueError:  # written by the process of a run, which may be anything
            return 0.0

    def forget(self, run: str) -> None:
        """Let go of a run that is over here."""
        watch = self._runs.pop(run, None)
        if watch is not None:
            watch.publisher.undeclare()  # type: ignore[no-untyped-call]


def _has_subscribers(publisher: zenoh.Publisher) -> bool:
    """Whether anybody subscribes.

    The status is declared as a bool but is an object, which is always true (zenoh 1.10.2).
    """
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]
