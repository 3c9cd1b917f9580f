"""The daemon's memory: workers, the deadlines of their leases, and the clients of searches."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger import RunPace
from daemon.model.messages import LeaseRef, WorkerInfo
from daemon.model.search_answer import SearchState
from daemon.model.spec import install_hint, own_version, version_text
from daemon.model.status import WorkerRow

_MOST_WORKERS: Final = 4096
_REMEMBERED: Final = 5.0
"""Time for which an absent worker without leases stays on the list [s].

Sessions reconnect within half a second, so longer absences are final.
"""
_CLIENT_SILENCE: Final = 15.0
"""Silence after which a client counts as gone [s]; a waiting one reports every five."""
_SHOWN: Final = {one.name for one in fields(WorkerInfo)} & {one.name for one in fields(WorkerRow)}
"""Fields of a worker's description that people see."""
_LEAST_STALL: Final = 0.25
"""Shortest stall [s]; ticks that are late by less waited for other jobs."""


class LeaseClock:
    """Clock for leases and the silence of workers: the seconds in which the daemon listened.

    It stands still while the writer is stalled by a long transaction, a stopped process, or a
    suspended or busy machine, since no lease can be renewed then. It does not follow changes of the
    wall clock. ``tick`` is the period of :meth:`advance` [s].
    """

    def __init__(self, tick: float) -> None:
        self.now = 0.0
        self._longest = tick + max(_LEAST_STALL, tick)
        self._last: float | None = None

    def advance(self, steady: float) -> float:
        """Advance to the time ``steady`` of a monotonic clock; return the length of a stall [s]."""
        passed = 0.0 if self._last is None else steady - self._last
        self._last = steady
        self.now += min(passed, self._longest)
        return max(0.0, passed - self._longest)


class LeaseDeadlines:
    """Deadlines of leases, in memory; the ledger stores the holders.

    A lease lasts ``period`` seconds from its latest renewal, or from the first check of it. So
    after the start of a daemon all leases last one period.
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
        """Return the lapsed ones among all ``leases``."""
        now = self._clock.now
        previous = self._deadlines
        self._deadlines = {
            lease.token: previous.get(lease.token, now + self._period) for lease in leases
        }
        return tuple(lease for lease in leases if self._deadlines[lease.token] < now)


@dataclass(slots=True)
class _KnownWorker:
    """A worker; ``contact`` is by the lease clock, the other times are for people."""

    info: WorkerInfo
    connected_at: float
    last_seen_at: float
    contact: float
    away_since: float | None = None


@dataclass(slots=True)
class WorkerRegistry:
    """Workers by id, including those that are away: without a connection, or silent.

    A worker that is silent for ``silence`` seconds of the ``clock`` is away, even with a
    connection. Its leases are not affected. It is forgotten when it has none. Workers must have our
    ``version``.
    """

    silence: float
    clock: LeaseClock
    version: str = field(default_factory=own_version)
    _entries: dict[str, _KnownWorker] = field(default_factory=dict)
    # Read by the ledger's threads, changed by Zenoh's callbacks.
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def check_version(self, worker: WorkerInfo) -> None:
        """Refuse a worker of another version."""
        # Results must not depend on the worker, and trace bytes depend on the version.
        theirs = version_text(worker.version, worker.engine)
        if theirs != self.version:
            raise Refused(
                f"worker {worker.id} has {theirs}, this daemon {self.version}: "
                f"{install_hint(self.version)}"
            )

    def record_contact(self, info: WorkerInfo) -> bool:
        """Record a request of a worker; return whether it is a new one.

        Raises :class:`Refused` for too many workers.
        """
        now, contact = time.time(), self.clock.now
        with self._lock:
            entry = self._entries.get(info.id)
            if entry is None:
                if len(self._entries) >= _MOST_WORKERS:
                    words = f"there are {_MOST_WORKERS} already"
                    raise Refused(f"worker {info.id} has to wait: {words}")
                self._entries[info.id] = _KnownWorker(info, now, now, contact)
                return True
            entry.info, entry.last_seen_at = info, now
            entry.contact, entry.away_since = contact, None
            return False

    def connected(self, worker: str) -> None:
        """Note that the worker's liveliness token appeared."""
        with self._lock:
            if worker in self._entries:
                self._entries[worker].away_since = None

    def disconnected(self, worker: str) -> None:
        """Note that the worker's liveliness token vanished."""
        with self._lock:
            entry = self._entries.get(worker)
            if entry is not None and entry.away_since is None:
                entry.away_since = self.clock.now

    def slots(self) -> int:
        """Return the number of slots of all connected workers without trouble."""
        return sum(row.slots for row in self.rows() if not row.away and not row.trouble)

    def paces(self) -> dict[str, RunPace]:
        """Return the paces of started runs, extrapolated from the workers' reports."""
        with self._lock:
            return {
                one.run: RunPace(
                    one.elapsed + self.clock.now - entry.contact,
                    one.simulated / one.elapsed if one.elapsed > 0.0 else 0.0,
                )
                for entry in self._entries.values()
                for one in entry.info.progress
            }

    def notices(self) -> tuple[str, ...]:
        """Return the notices of connected workers for people."""
        with self._lock:
            here = (entry.info for entry in self._entries.values() if entry.away_since is None)
            return tuple(f"worker {info.id}: {info.notice}" for info in here if info.notice)

    def absent(self) -> frozenset[str]:
        """Return the ids of workers that are away for long, and stay only because of leases."""
        with self._lock:
            return frozenset(name for name in self._entries if self._is_absent(name))

    def forget(self, workers: Iterable[str]) -> tuple[str, ...]:
        """Forget those of the workers that are still absent, and return their ids."""
        with self._lock:
            absent = tuple(name for name in workers if self._is_absent(name))
            for name in absent:
                del self._entries[name]
        return absent

    def _is_absent(self, name: str) -> bool:
        entry = self._entries.get(name)
        if entry is None:
            return False
        away = entry.away_since
        is_lost = away is not None and self.clock.now - away >= _REMEMBERED
        return is_lost or self._is_silent(entry)

    def _is_silent(self, entry: _KnownWorker) -> bool:
        return self.clock.now - entry.contact >= self.silence

    def rows(self) -> tuple[WorkerRow, ...]:
        """Return all workers, including absent ones, in order of appearance."""
        with self._lock:
            return tuple(
                WorkerRow(
                    connected_at=e.connected_at,
                    last_seen_at=e.last_seen_at,
                    away=e.away_since is not None or self._is_silent(e),
                    **{name: getattr(e.info, name) for name in _SHOWN},
                )
                for e in self._entries.values()
            )


class SearchClients:
    """The clients that make the proposals of searches, one for each, by their latest report.

    Kept in memory, by a monotonic clock. After its start the daemon waits for the permitted silence
    of a client before it reports a search as waiting.
    """

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._words: dict[str, tuple[str, float]] = {}

    def client(self, campaign: str) -> str:
        """Return the client of a search, empty without one."""
        client, at = self._words.get(campaign, ("", 0.0))
        return client if time.monotonic() - at < _CLIENT_SILENCE else ""

    def state(self, campaign: str) -> SearchState:
        """Return the state of an unfinished search: ``running`` or ``waiting``."""
        fresh = campaign not in self._words and time.monotonic() - self._started < _CLIENT_SILENCE
        return "running" if fresh or self.client(campaign) else "waiting"

    def claim(self, campaign: str, client: str) -> bool:
        """Record a report of a client; return whether the search is its own."""
        if self.client(campaign) not in ("", client):
            return False
        self._words[campaign] = (client, time.monotonic())
        return True

    def require(self, campaign: str, client: str) -> None:
        """Record a report of a client; refuse any but that of the search."""
        if not self.claim(campaign, client):
            raise Refused(f"{self.client(campaign)} makes the proposals of {campaign}")

    def leave(self, campaign: str) -> None:
        """Let a search wait for another client."""
        self._words[campaign] = ("", 0.0)
