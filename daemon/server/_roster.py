"""Which workers there are: who they say they are, when they were last heard of."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Final

from daemon.messages import WorkerInfo
from daemon.protocol import WorkerRow

MOST_WORKERS: Final = 4096


@dataclass(slots=True)
class _Entry:
    info: WorkerInfo
    connected_at: float
    last_seen_at: float
    gone_at: float | None = None


@dataclass(slots=True)
class Roster:
    """Workers by id; a lost connection starts a ``grace`` [s] before a worker counts as gone.

    A worker not heard of for ``silence`` seconds is gone too, whatever its connection says.
    """

    grace: float
    silence: float
    _entries: dict[str, _Entry] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def full(self, worker: str) -> bool:
        """Whether there is no room for this worker."""
        with self._lock:
            return worker not in self._entries and len(self._entries) >= MOST_WORKERS

    def seen(self, info: WorkerInfo, now: float) -> bool:
        """A request came from this worker; returns whether it is a new one."""
        with self._lock:
            entry = self._entries.get(info.id)
            if entry is None:
                self._entries[info.id] = _Entry(info, now, now)
                return True
            entry.info, entry.last_seen_at, entry.gone_at = info, now, None
            return False

    def connected(self, worker: str) -> None:
        """The worker's liveliness token appeared."""
        with self._lock:
            if worker in self._entries:
                self._entries[worker].gone_at = None

    def disconnected(self, worker: str, now: float) -> None:
        """The worker's liveliness token vanished."""
        with self._lock:
            if worker in self._entries:
                self._entries[worker].gone_at = now

    def shift(self, seconds: float) -> None:
        """Move along with a clock that was set."""
        with self._lock:
            for entry in self._entries.values():
                entry.connected_at += seconds
                entry.last_seen_at += seconds
                if entry.gone_at is not None:
                    entry.gone_at += seconds

    def take_gone(self, now: float) -> tuple[str, ...]:
        """Forget the workers whose time is up and return their ids."""
        with self._lock:
            gone = tuple(
                name
                for name, entry in self._entries.items()
                if (entry.gone_at is not None and now - entry.gone_at >= self.grace)
                or now - entry.last_seen_at >= self.silence
            )
            for name in gone:
                del self._entries[name]
        return gone

    def rows(self) -> tuple[WorkerRow, ...]:
        """Workers as people see them, in order of appearance."""
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
                )
                for e in self._entries.values()
                if e.gone_at is None
            )
