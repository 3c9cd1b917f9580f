"""The workers that are connected to the daemon, and until when their leases last."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger import RunPace
from daemon.model.messages import LeaseRef, WorkerInfo
from daemon.model.spec import install_hint, own_version, version_text
from daemon.model.status import WorkerRow

_MOST_WORKERS: Final = 4096
_REMEMBERED: Final = 5.0
"""Seconds for which a worker that is away and has no leases stays on the list.

Sessions reconnect within half a second: who left for good need not be seen for long.
"""
_LEAST_STALL: Final = 0.25
"""Seconds; ticks that are late by less are late because something else had its turn."""


class LeaseClock:
    """Seconds in which the daemon listened: what leases, and the silence of workers, are timed by.

    It stands still while the writer is stalled: by a transaction that takes long, a process that is
    stopped, a machine that is suspended or too busy. Nobody could renew a lease meanwhile.
    Whoever sets the wall clock does not move it. ``tick`` is the period of :meth:`advance` [s].
    """

    def __init__(self, tick: float) -> None:
        self.now = 0.0
        self._longest = tick + max(_LEAST_STALL, tick)
        self._last: float | None = None

    def advance(self, steady: float) -> float:
        """Go on to the time ``steady`` of a monotonic clock; returns the length of a stall [s]."""
        passed = 0.0 if self._last is None else steady - self._last
        self._last = steady
        self.now += min(passed, self._longest)
        return max(0.0, passed - self._longest)


class LeaseDeadlines:
    """Deadlines of leases: in memory, while the ledger knows who has what.

    A lease lasts ``period`` seconds from its latest renewal, or from the first look at it. So all
    last one period when a daemon starts: it was away, not its workers.
    """

    def __init__(self, period: float, clock: LeaseClock) -> None:
        self._period = period
        self._clock = clock
        self._deadlines: dict[int, float] = {}

    def renew(self, leases: Iterable[LeaseRef]) -> None:
        """Let leases last one period from now."""
        self._deadlines |= dict.fromkeys(
            (lease.token for lease in leases), self._clock.now + self._period
        )

    def overdue(self, leases: Sequence[LeaseRef]) -> tuple[LeaseRef, ...]:
        """Return those of all ``leases`` there are that nobody has renewed in time."""
        now = self._clock.now
        known = self._deadlines
        self._deadlines = {
            lease.token: known.get(lease.token, now + self._period) for lease in leases
        }
        return tuple(lease for lease in leases if self._deadlines[lease.token] < now)


@dataclass(slots=True)
class _KnownWorker:
    """A worker; the times of its contacts are for people, ``heard`` is by the lease clock."""

    info: WorkerInfo
    connected_at: float
    last_seen_at: float
    heard: float
    away_since: float | None = None


@dataclass(slots=True)
class WorkerRegistry:
    """Workers by id, and which of them are away: their connection is lost, or they are silent.

    A worker not heard of for ``silence`` seconds of the ``clock`` is away, whatever its connection
    says. Being away costs it nothing: its leases last as long as they do. It is forgotten when it
    has none any more. Workers must have our ``version``.
    """

    silence: float
    clock: LeaseClock
    version: str = field(default_factory=own_version)
    _entries: dict[str, _KnownWorker] = field(default_factory=dict)
    # Asked by the ledger's threads, told by Zenoh's callbacks.
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def check_version(self, worker: WorkerInfo) -> None:
        """Refuse a worker of another version."""
        # Results must not depend on who computed them, and trace bytes do depend on the version.
        theirs = version_text(worker.version, worker.engine)
        if theirs != self.version:
            raise Refused(
                f"worker {worker.id} has {theirs}, this daemon {self.version}: "
                f"{install_hint(self.version)}"
            )

    def record_contact(self, info: WorkerInfo) -> bool:
        """A request came from this worker; returns whether it is a new one.

        Raises :class:`Refused` for one worker too many.
        """
        now, heard = time.time(), self.clock.now
        with self._lock:
            entry = self._entries.get(info.id)
            if entry is None:
                if len(self._entries) >= _MOST_WORKERS:
                    there = f"there are {_MOST_WORKERS} already"
                    raise Refused(f"worker {info.id} has to wait: {there}")
                self._entries[info.id] = _KnownWorker(info, now, now, heard)
                return True
            entry.info, entry.last_seen_at = info, now
            entry.heard, entry.away_since = heard, None
            return False

    def connected(self, worker: str) -> None:
        """The worker's liveliness token appeared."""
        with self._lock:
            if worker in self._entries:
                self._entries[worker].away_since = None

    def disconnected(self, worker: str) -> None:
        """The worker's liveliness token vanished."""
        with self._lock:
            entry = self._entries.get(worker)
            if entry is not None and entry.away_since is None:
                entry.away_since = self.clock.now

    def slots(self) -> int:
        """How many runs the workers can execute at a time that are here and have no trouble."""
        return sum(row.slots for row in self.rows() if not row.away and not row.trouble)

    def paces(self) -> dict[str, RunPace]:
        """Return the paces of runs under way, as their workers told and as far as they are now."""
        with self._lock:
            return {
                one.run: RunPace(
                    one.elapsed + self.clock.now - entry.heard,
                    one.simulated / one.elapsed if one.elapsed > 0.0 else 0.0,
                )
                for entry in self._entries.values()
                for one in entry.info.progress
            }

    def notices(self) -> tuple[str, ...]:
        """Return what workers that are here want people to know."""
        with self._lock:
            here = (entry.info for entry in self._entries.values() if entry.away_since is None)
            return tuple(f"worker {info.id}: {info.notice}" for info in here if info.notice)

    def absent(self) -> frozenset[str]:
        """The ids of workers that are away for so long that nothing but leases keeps them."""
        with self._lock:
            return frozenset(name for name in self._entries if self._is_absent(name))

    def forget(self, workers: Iterable[str]) -> tuple[str, ...]:
        """Forget those of the workers that have not come back meanwhile, and return their ids."""
        with self._lock:
            gone = tuple(name for name in workers if self._is_absent(name))
            for name in gone:
                del self._entries[name]
        return gone

    def _is_absent(self, name: str) -> bool:
        entry = self._entries.get(name)
        if entry is None:
            return False
        away = entry.away_since
        lost = away is not None and self.clock.now - away >= _REMEMBERED
        return lost or self._is_silent(entry)

    def _is_silent(self, entry: _KnownWorker) -> bool:
        return self.clock.now - entry.heard >= self.silence

    def rows(self) -> tuple[WorkerRow, ...]:
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
                    away=e.away_since is not None or self._is_silent(e),
                    trouble=e.info.trouble,
                    preparation=e.info.preparation,
                    cpu=e.info.cpu,
                    memory=e.info.memory,
                    memory_total=e.info.memory_total,
                )
                for e in self._entries.values()
            )
