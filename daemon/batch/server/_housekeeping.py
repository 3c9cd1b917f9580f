"""The daemon's housekeeping: the quota of traces, strays, and moves of traces to a store."""

from __future__ import annotations

import threading
import time
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Final

from daemon.batch.amounts import size_text
from daemon.batch.errors import DaemonError
from daemon.batch.ledger import (
    LedgerReader,
    LedgerWriter,
    RetentionPolicy,
    remove_strays,
    stored_bytes,
    sweep_traces,
)
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._threads import LedgerJob, WriterThread
from daemon.batch.stores import copy_between, matches_digest
from grammars.text.files import matching_paths

# Seconds between two checks of traces: regularly, and at least while the quota is exceeded.
_PERIOD: Final = 60.0
_REST: Final = 1.0
_STRAYS_PERIOD: Final = 3600.0
# A check reads the folder of every campaign and the inputs of every run. This multiple of its
# duration as a pause keeps it below 2 % of a core and of the disk.
_SHARE: Final = 50.0
# Share of the quota that remains after a sweep, so that not every new trace causes another.
_LEAST: Final = 0.95
_MOVE_PERIOD: Final = 2.0
"""Period of checks for traces to move [s]."""
_AFTER_PROBLEM: Final = 60.0


class Housekeeping(threading.Thread):
    """Keeps the traces below ``limit`` bytes (0: no limit) and removes strays, until closed.

    ``used`` is the known size of the traces; ``trouble`` is the reason why no run may start.
    """

    def __init__(self, paths: StatePaths, log: EventLog, limit: int) -> None:
        super().__init__(name="housekeeping", daemon=True)
        self.limit = limit
        self.used = 0
        self.trouble = ""
        self._paths = paths
        self._log = log
        self._strays_due = 0.0
        self._wake = threading.Event()
        self._closing = threading.Event()

    def add_bytes(self, size: int) -> None:
        """Count a new trace of ``size`` bytes; check soon if the quota is exceeded."""
        self.used += size
        if self.limit and self.used > self.limit:
            self._wake.set()

    def run(self) -> None:
        """Check periodically until closed."""
        while not self._closing.is_set():
            start = time.monotonic()
            try:
                self._keep_quota()
                if start >= self._strays_due:
                    self._strays_due = start + _STRAYS_PERIOD
                    self._remove_strays()
            except (DaemonError, OSError) as error:
                self._log.write("housekeeping failed", problem=str(error))
            self._closing.wait(max(_REST, _SHARE * (time.monotonic() - start)))
            # While no run may start, no event wakes this thread: check again without waiting.
            if not self.trouble:
                self._wake.wait(_PERIOD)
            self._wake.clear()

    def close(self) -> None:
        """Finish the current check."""
        self._closing.set()
        self._wake.set()
        if self.is_alive():
            self.join()

    def _keep_quota(self) -> None:
        self.used = stored_bytes(self._paths)
        if self.limit and self.used > self.limit:
            policy = RetentionPolicy(size=int(_LEAST * self.limit))
            sweep = sweep_traces(self._paths, policy, time.time())
            self.used = sweep.rest
            if sweep.traces:
                campaigns = list(dict.fromkeys(trace.campaign for trace in sweep.traces))
                self._log.write(
                    "traces removed", bytes=sweep.freed, traces=len(sweep.traces), of=campaigns[:20]
                )
        previous, self.trouble = self.trouble, self._trouble_text()
        if bool(previous) != bool(self.trouble):
            self._log.write("quota", trouble=self.trouble, bytes=self.used)

    def _trouble_text(self) -> str:
        if not self.limit or self.used <= self.limit:
            return ""
        return (
            f"traces of unfinished campaigns take {size_text(self.used)}, the quota is "
            f"{size_text(self.limit)}: no more runs start until there is space; start the daemon "
            "with a larger --quota, or cancel a campaign"
        )

    def _remove_strays(self) -> None:
        # By the wall clock, as the times of files.
        strays = remove_strays(self._paths, time.time())
        if strays:
            kinds = Counter(stray.what for stray in strays)
            self._log.write("strays removed", bytes=sum(s.bytes for s in strays), files=dict(kinds))


class TraceMover(threading.Thread):
    """Moves traces of finished runs to ``store``; removes each after the ledger has its URL."""

    def __init__(self, paths: StatePaths, log: EventLog, store: str, writer: WriterThread) -> None:
        super().__init__(name="trace-mover", daemon=True)
        self._paths, self._log, self._store, self._writer = paths, log, store, writer
        self._closing = threading.Event()

    def run(self) -> None:
        """Move traces periodically until closed."""
        pause = _MOVE_PERIOD
        while not self._closing.wait(pause):
            pause = _MOVE_PERIOD
            try:
                self._move_all()
            except (DaemonError, OSError) as error:
                self._log.write("traces not moved", problem=str(error))
                pause = _AFTER_PROBLEM

    def _move_all(self) -> None:
        with LedgerReader.open(self._paths) as ledger:
            for path in matching_paths(self._paths.traces, "*/*.mcap"):
                if self._closing.is_set():
                    return
                self._move(ledger, path)

    def _move(self, ledger: LedgerReader, path: Path) -> None:
        name = path.relative_to(self._paths.traces).as_posix()
        result = ledger.result_of_trace(name)
        # The result of a trace may not be recorded yet.
        if result is None or not matches_digest(path, result.trace.size, result.trace.sha256):
            return
        # Different traces have different URLs.
        url = f"{self._store}/{name.removesuffix('.mcap')}.{result.trace.sha256[:16]}.mcap"
        copy_between(str(path), url)
        record = partial(LedgerWriter.record_move, name=name, digest=result.digest, url=url)
        self._writer.put(LedgerJob(record, partial(_remove_moved, path)))

    def close(self) -> None:
        """Finish the current move."""
        self._closing.set()
        self.join()


def _remove_moved(path: Path, recorded: object) -> None:
    if recorded is True:
        path.unlink(missing_ok=True)
