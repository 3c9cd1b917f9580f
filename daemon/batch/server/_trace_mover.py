"""The mover of traces: those of finished runs go from the state directory into a store."""

from __future__ import annotations

import threading
from functools import partial
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._threads import LedgerJob, WriterThread
from daemon.batch.stores import copy_between, matches_digest
from grammars.text.files import matching_paths

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
        with LedgerReader.open(self._paths) as ledger:
            for path in matching_paths(self._paths.traces, "*/*.mcap"):
                if self._closing.is_set():
                    return
                self._move(ledger, path)

    def _move(self, ledger: LedgerReader, path: Path) -> None:
        name = path.relative_to(self._paths.traces).as_posix()
        result = ledger.result_of_trace(name)
        # A trace whose result is not recorded yet may lie there.
        if result is None or not matches_digest(path, result.trace.size, result.trace.sha256):
            return
        # Traces that differ have different URLs.
        url = f"{self._store}/{name.removesuffix('.mcap')}.{result.trace.sha256[:16]}.mcap"
        copy_between(str(path), url)
        record = partial(LedgerWriter.record_move, name=name, digest=result.digest, url=url)
        self._writer.put(LedgerJob(record, partial(_remove_moved, path)))

    def close(self) -> None:
        """Finish the trace that is on its way."""
        self._closing.set()
        self.join()


def _remove_moved(path: Path, recorded: object) -> None:
    if recorded is True:
        path.unlink(missing_ok=True)
