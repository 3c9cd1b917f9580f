"""The mover of traces: those of finished runs go from the state directory into a store."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._threads import LedgerJob, WriterThread
from daemon.batch.stores import copy_between, matches_digest, trace_url
from daemon.model.spec import RunResult

_PERIOD: Final = 2.0
"""Seconds between two looks at the traces of the state directory."""
_AFTER_PROBLEM: Final = 60.0


class TraceMover(threading.Thread):
    """Moves traces to ``store`` until closed; one leaves the disk once the ledger says where."""

    def __init__(self, paths: StatePaths, log: EventLog, store: str, writer: WriterThread) -> None:
        super().__init__(name="trace-mover", daemon=True)
        self._paths, self._log, self._store, self._writer = paths, log, store, writer
        self._closing = threading.Event()

    def run(self) -> None:
        """Look now and then until closed."""
        pause = _PERIOD
        while not self._closing.wait(pause):
            pause = _PERIOD
            try:
                self._move_all()
            except (DaemonError, OSError) as error:
                self._log.write("traces not moved", problem=str(error))
                pause = _AFTER_PROBLEM

    def _move_all(self) -> None:
        copied: list[tuple[Path, str, str, str]] = []
        try:
            with LedgerReader.open(self._paths) as ledger:
                for path in self._paths.traces.glob("*/*.mcap"):
                    if self._closing.is_set():
                        break
                    name = path.relative_to(self._paths.traces).as_posix()
                    result = ledger.result_of_trace(name)
                    # Another attempt's trace may lie there until its worker has replaced it.
                    if result is None or not _is_trace_of(path, result):
                        continue
                    url = trace_url(self._store, name, result.trace.sha256)
                    copy_between(str(path), url)
                    copied.append((path, name, result.digest, url))
        finally:
            if copied:
                os.sync()  # a trace leaves the disk when its copy is certainly on one
            for copy in copied:
                self._record(*copy)

    def _record(self, path: Path, name: str, digest: str, url: str) -> None:
        def record(book: LedgerWriter) -> bool:
            return book.record_move(name, digest, url)

        def remove(recorded: object) -> None:
            if recorded is True:
                path.unlink(missing_ok=True)

        self._writer.put(LedgerJob(record, remove))

    def close(self) -> None:
        """Finish the trace that is on its way."""
        self._closing.set()
        self.join()


def _is_trace_of(path: Path, result: RunResult) -> bool:
    return matches_digest(path, result.trace.size, result.trace.sha256)
