"""Telling those who look on: a little of every run to all, everything of a run to its watchers.

A run is watched while somebody subscribes to its own key. Whoever executes it is told by a file
in the attempt's folder, and makes the details then only.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import zenoh

from daemon.child import WATCHED
from daemon.messages import LIVE
from daemon.worker._backend import Execution

_PERIOD: Final = 0.2
"""Seconds between two words about a run to everybody, at least."""


@dataclass(slots=True)
class _Watch:
    """One run under way: its own publisher, and whether its folder says that it is watched."""

    publisher: zenoh.Publisher
    folder: Path
    watched: bool = False
    said: float = 0.0


@dataclass(slots=True)
class Watchers:
    """Publishes what executions tell of themselves under the name of their ``worker``."""

    session: zenoh.Session
    worker: str
    _all: zenoh.Publisher = field(init=False)
    _runs: dict[str, _Watch] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._all = self._publisher(f"{LIVE}/{self.worker}")

    def _publisher(self, key: str) -> zenoh.Publisher:
        drop = zenoh.CongestionControl.DROP
        return self.session.declare_publisher(key, congestion_control=drop)

    def publish(self, execution: Execution) -> None:
        """Pass on what an execution last told, to those who want it."""
        live, execution.live = execution.live, b""
        if not live:
            return
        watch = self._watch(execution)
        now = time.monotonic()
        if watch.watched:
            watch.publisher.put(live)
        if now - watch.said >= _PERIOD and _matches(self._all):
            watch.said = now
            self._all.put(live)

    def _watch(self, execution: Execution) -> _Watch:
        run, folder = execution.attempt.grant.run, execution.attempt.folder
        watch = self._runs.get(run)
        if watch is None or watch.folder != folder:
            self.forget(run)
            key = f"{LIVE}/{self.worker}/{run}"
            watch = self._runs[run] = _Watch(self._publisher(key), folder)
        watched = _matches(watch.publisher)
        if watched != watch.watched:
            watch.watched = watched
            mark = folder / WATCHED
            if watched:
                mark.touch()
            else:
                mark.unlink(missing_ok=True)
        return watch

    def forget(self, run: str) -> None:
        """Let go of a run that is over here."""
        watch = self._runs.pop(run, None)
        if watch is not None:
            watch.publisher.undeclare()  # type: ignore[no-untyped-call]


def _matches(publisher: zenoh.Publisher) -> bool:
    """Whether anybody subscribes: the status itself, declared as bool, is always true."""
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]
