"""The daemon's workers: the registry of those connected, and the local one it starts itself."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.numba_cache import numba_cache_environment
from daemon.batch.paths import StatePaths
from daemon.batch.permissions import open_private_log
from daemon.batch.server._runtime import EventLog
from daemon.model.execution import RunLimits, python_command
from daemon.model.messages import WorkerInfo
from daemon.model.spec import install_hint, own_version, version_text
from daemon.model.status import WorkerRow

MOST_WORKERS: Final = 4096
MOST_SLOTS: Final = 1024
"""Slots a worker is believed to have, when it is asked how many runs it may hold."""
_REMEMBERED: Final = 5.0
"""Seconds for which a worker that is away and has no leases stays on the list.

Sessions reconnect within half a second: who left for good need not be seen for long.
"""

# Seconds. A worker that dies at once is started again after twice the time, up to the longest; one
# that ran steadily died of something new and is started without delay.
_FIRST_PAUSE: Final = 0.1
_LONGEST_PAUSE: Final = 10.0
_STEADY: Final = 30.0
_SETTLED: Final = 5.0
_LARGEST_LOG: Final = 4 * 2**20
_LONGEST_TAIL: Final = 2000
"""Characters of the log that say why the local worker died."""


@dataclass(slots=True)
class _KnownWorker:
    info: WorkerInfo
    connected_at: float
    last_seen_at: float
    away_since: float | None = None
    holder: str = ""


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

    def check_identity(self, worker: WorkerInfo, holder: str) -> None:
        """Refuse a worker of another version, or one whose id is that of another key's worker."""
        # Results must not depend on who computed them, and trace bytes do depend on the version.
        theirs = version_text(worker.version, worker.engine)
        if theirs != self.version:
            raise Refused(
                f"worker {worker.id} has {theirs}, this daemon {self.version}: "
                f"{install_hint(self.version)}"
            )
        with self._lock:
            entry = self._entries.get(worker.id)
            if entry is not None and entry.holder != holder:
                raise Refused(
                    f"worker {worker.id} belongs to another key: choose another name for it"
                )

    def slots(self, worker: str) -> int:
        """Return how many slots a worker says it has, as far as that is believed."""
        with self._lock:
            entry = self._entries.get(worker)
            return 0 if entry is None else min(entry.info.slots, MOST_SLOTS)

    def slots_of_holder(self, holder: str) -> int:
        """Return the slots of all workers of a key together, as far as they are believed."""
        with self._lock:
            mine = (e.info.slots for e in self._entries.values() if e.holder == holder)
            return sum(min(slots, MOST_SLOTS) for slots in mine)

    def record_contact(self, info: WorkerInfo, now: float, holder: str = "") -> bool:
        """A request came from this worker of ``holder``; returns whether it is a new one."""
        with self._lock:
            entry = self._entries.get(info.id)
            if entry is None:
                self._entries[info.id] = _KnownWorker(info, now, now, holder=holder)
                return True
            entry.info, entry.last_seen_at, entry.away_since = info, now, None
            return False

    def connected(self, worker: str, holder: str = "") -> None:
        """The worker's liveliness token appeared."""
        with self._lock:
            if worker in self._entries and self._entries[worker].holder == holder:
                self._entries[worker].away_since = None

    def disconnected(self, worker: str, now: float, holder: str = "") -> None:
        """The worker's liveliness token vanished."""
        with self._lock:
            entry = self._entries.get(worker)
            mine = entry is not None and entry.holder == holder
            if entry is not None and mine and entry.away_since is None:
                entry.away_since = now

    def shift(self, seconds: float) -> None:
        """Move along with a clock that was set."""
        with self._lock:
            for entry in self._entries.values():
                entry.connected_at += seconds
                entry.last_seen_at += seconds
                if entry.away_since is not None:
                    entry.away_since += seconds

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
                    preparing=e.info.preparing,
                )
                for e in self._entries.values()
            )


class LocalWorker:
    """Starts the worker, starts it again when it dies, and ends it.

    ``trouble`` holds its last words from its death until a new one has settled.
    """

    def __init__(
        self,
        paths: StatePaths,
        log: EventLog,
        *,
        endpoint: str,
        slots: int,
        executor: str,
        limits: RunLimits,
        tether: bool,
    ) -> None:
        self._paths = paths
        self._log = log
        self._tether = tether
        self._command = python_command("-m", "daemon", "worker", "--connect", endpoint)
        self._command += ["--slots", str(slots), "--executor", executor]
        self._command += ["--wall", str(limits.wall), "--memory", str(limits.memory)]
        self._command += ["--nice", str(limits.nice)]
        self._command += ["--parent", str(os.getpid())] + (["--tether"] if tether else [])
        self._process: subprocess.Popen[bytes] | None = None
        self._started = 0.0
        self._pause = _FIRST_PAUSE
        self._next_start = 0.0
        self._log_start = 0
        self.trouble = ""

    def supervise(self) -> None:
        """Start the worker unless it runs or has just died; call this every now and then."""
        now = time.monotonic()
        if self.trouble and now - self._started > _SETTLED and self.alive:
            self.trouble = ""
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                self._rotate()
                return
            self._process = None
            steady = now - self._started > _STEADY
            self._pause = _FIRST_PAUSE if steady else min(2 * self._pause, _LONGEST_PAUSE)
            self._next_start = now + self._pause
            self.trouble = self._log_tail(code)
            self._log.write(
                "local worker ended", code=code, restart_in=self._pause, words=self.trouble
            )
        if now >= self._next_start:
            try:
                self._start(now)
            except OSError as error:
                self._pause = min(2 * self._pause, _LONGEST_PAUSE)
                self._next_start = now + self._pause
                self.trouble = f"the local worker cannot be started: {error}"

    def _rotate(self) -> None:
        """Put a log aside that has grown; the worker goes on at the beginning of the file.

        What it writes in that very moment is lost.
        """
        # Copied and cut off, not renamed: the worker and its children keep writing to the open
        # file, in append mode, so that they go on at its new end.
        log = self._paths.worker_log
        with suppress(FileNotFoundError):
            if log.stat().st_size > _LARGEST_LOG:
                # On a full disk what was said before is not kept.
                with suppress(OSError):
                    shutil.copy(log, log.with_suffix(".log.1"))
                os.truncate(log, 0)
                self._log_start = 0

    def _start(self, now: float) -> None:
        self._rotate()
        log = self._paths.worker_log
        with open_private_log(log) as output:
            self._log_start = output.seek(0, os.SEEK_END)
            self._process = subprocess.Popen(
                self._command,
                # A tethered daemon's standard input is the tether: both see its end.
                stdin=None if self._tether else subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                # Ctrl-C in the daemon's terminal is for the daemon, which ends it in order.
                start_new_session=True,
                env=numba_cache_environment(self._paths),
            )
        self._started = now
        self._log.write("local worker started", pid=self._process.pid)

    def _log_tail(self, code: int) -> str:
        words = ""
        with suppress(FileNotFoundError), self._paths.worker_log.open("rb") as log:
            size = log.seek(0, os.SEEK_END)
            log.seek(max(self._log_start, size - 4 * _LONGEST_TAIL))
            words = log.read().decode("utf-8", "replace").strip()
        return words[-_LONGEST_TAIL:] or f"the worker ended with code {code}"

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

    def signal(self, number: signal.Signals) -> None:
        """Pass a signal on: SIGTERM finishes runs, SIGQUIT gives them back."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(number)

    def wait(self, seconds: float) -> bool:
        """Wait for the end of the process; returns whether it came."""
        if self._process is None:
            return True
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True
