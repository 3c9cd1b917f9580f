"""The registry of the workers that are connected to the daemon."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.time_left import RunProgress
from daemon.model.messages import WorkerInfo
from daemon.model.spec import install_hint, own_version, version_text
from daemon.model.status import WorkerRow

MOST_WORKERS: Final = 4096
_REMEMBERED: Final = 5.0
"""Seconds for which a worker that is away and has no leases stays on the list.

Sessions reconnect within half a second: who left for good need not be seen for long.
"""


@dataclass(slots=True)
class _KnownWorker:
    info: WorkerInfo
    connected_at: float
    last_seen_at: float
    away_since: float | None = None
    progress: dict[str, RunProgress] = field(default_factory=dict)


@dataclass(slots=True)
class WorkerRegistry:
    """Workers by id, and which of them are away: their connection is lost, or they are silent.

    A worker not heard of for ``silence`` seconds is away, whatever its connection says. Being away
    costs it nothing: its leases last as long as they do. It is forgotten when it has none any more.
    Workers must have our ``version``.
    """

    silence: float
    version: str = field(default_factory=own_version)
    _entries: dict[str, _KnownWorker] = field(default_factory=dict)
    # Asked by the ledger's threads, told by Zenoh's callbacks.
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def check_room(self, worker: str) -> None:
        """Refuse one worker too many."""
        with self._lock:
            if worker not in self._entries and len(self._entries) >= MOST_WORKERS:
                raise Refused(f"worker {worker} has to wait: there are {MOST_WORKERS} already")

    def check_version(self, worker: WorkerInfo) -> None:
        """Refuse a worker of another version."""
        # Results must not depend on who computed them, and trace bytes do depend on the version.
        theirs = version_text(worker.version, worker.engine)
        if theirs != self.version:
            raise Refused(
                f"worker {worker.id} has {theirs}, this daemon {self.version}: "
                f"{install_hint(self.version)}"
            )

    def record_contact(self, info: WorkerInfo, now: float) -> bool:
        """A request came from this worker; returns whether it is a new one."""
        with self._lock:
            entry = self._entries.get(info.id)
            if entry is None:
                self._entries[info.id] = _KnownWorker(info, now, now)
                return True
            entry.info, entry.last_seen_at, entry.away_since = info, now, None
            return False

    def record_progress(self, worker: str, progress: dict[str, RunProgress]) -> None:
        """A worker has said how far its runs are."""
        with self._lock:
            if worker in self._entries:
                self._entries[worker].progress = progress

    def progress(self) -> dict[str, RunProgress]:
        """How far runs are, as far as workers have told."""
        with self._lock:
            told = [entry.progress for entry in self._entries.values()]
        return {run: far for one in told for run, far in one.items()}

    def connected(self, worker: str) -> None:
        """The worker's liveliness token appeared."""
        with self._lock:
            if worker in self._entries:
                self._entries[worker].away_since = None

    def disconnected(self, worker: str, now: float) -> None:
        """The worker's liveliness token vanished."""
        with self._lock:
            entry = self._entries.get(worker)
            if entry is not None and entry.away_since is None:
                entry.away_since = now

    def shift(self, seconds: float) -> None:
        """Move along with a clock that was set."""
        with self._lock:
            for entry in self._entries.values():
                entry.connected_at += seconds
                entry.last_seen_at += seconds
                if entry.away_since is not None:
                    entry.away_since += seconds

    def notices(self) -> tuple[str, ...]:
        """Return what workers that are here want people to know."""
        with self._lock:
            here = (entry.info for entry in self._entries.values() if entry.away_since is None)
            return tuple(f"worker {info.id}: {info.notice}" for info in here if info.notice)

    def absent(self, now: float) -> frozenset[str]:
        """The ids of workers that are away for so long that nothing but leases keeps them."""
        with self._lock:
            return frozenset(name for name in self._entries if self._is_absent(name, now))

    def forget(self, workers: Iterable[str], now: float) -> tuple[str, ...]:
        """Forget those of the workers that have not come back meanwhile, and return their ids."""
        with self._lock:
            gone = tuple(name for name in workers if self._is_absent(name, now))
            for name in gone:
                del self._entries[name]
        return gone

    def _is_absent(self, name: str, now: float) -> bool:
        entry = self._entries.get(name)
        if entry is None:
            return False
        lost = entry.away_since is not None and now - entry.away_since >= _REMEMBERED
        return lost or self._is_silent(entry, now)

    def _is_silent(self, entry: _KnownWorker, now: float) -> bool:
        return now - entry.last_seen_at >= self.silence

    def rows(self, now: float) -> tuple[WorkerRow, ...]:
        """Workers as people see them, in order of appearance, those that are away too."""
        with self._lock:
            return tuple(
                WorkerRow(
                    id=e.info.id,
                    host=e.info.host,
                    pid=e.info.pid,
                    version=e.info.version,
                    slots=e.info.slots,
                    busy=e.info.busy,
                    connected_at=e.connected_at,
                    last_seen_at=e.last_seen_at,
                    away=e.away_since is not None or self._is_silent(e, now),
                    trouble=e.info.trouble,
                    preparation=e.info.preparation,
                )
                for e in self._entries.values()
            )
