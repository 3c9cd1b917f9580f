"""Delivering results: the trace goes where it belongs, then the ledger is told.

On the daemon's own file system the worker puts it there. From any other machine it travels over
the bus, part by part between the worker's other duties. It goes on where it was after whatever
broke in between.
"""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from daemon.batch import stores
from daemon.batch.errors import Rejected, Unreachable
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import TRACE
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._connection import DaemonConnection, WorkerPaths
from daemon.model.messages import (
    Completion,
    LedgerAnswer,
    Rejection,
    TraceUploadChunk,
    UploadProgress,
)
from daemon.model.spec import RunResult
from daemon.model.verbs import COMPLETE, UPLOAD
from grammars.text.files import move_durably, sync_directory

LONGEST_TURN: Final = 0.5
"""Seconds of sending before the worker looks after its runs and leases again."""
_FAULTS: Final = 5
"""Parts refused in a row before a trace is put aside: others may still arrive."""


@dataclass(slots=True)
class _BusUpload(stores.FileUpload):
    """A trace on its way over the bus."""

    begun: float = field(default_factory=time.monotonic)
    again: bool = False
    """Whether all of it was sent before, and was gone at the daemon."""


@dataclass(frozen=True, slots=True)
class TracePlacement:
    """A trace on its way from the spool to where its lease says.

    The first trace to arrive stays; the one the ledger recorded may replace it.
    """

    source: Path
    target: Path
    sha256: str

    @classmethod
    def of(cls, attempt: Attempt, paths: StatePaths, result: RunResult) -> TracePlacement:
        """Plan it; raises ``ValueError`` when the lease's trace name leaves the directory."""
        target = paths.trace(attempt.lease.trace)
        return cls(attempt.folder / TRACE, target, result.trace.sha256)

    def put(self) -> bool:
        """Put the trace there unless there is one; returns whether it is one like this now.

        It is put there before the ledger is told, so that a recorded run always has its trace; the
        first stays, since another worker may have recorded the run with it in the meantime.
        """
        stores.make_folder(self.target.parent)
        with self._prepared() as temporary:
            try:
                # Not a look and then a rename: another worker may come in between.
                os.link(temporary, self.target)
            except FileExistsError:
                same = stores.file_sha256(self.target) == self.sha256
                if same:
                    # Of this attempt from now on: whoever withdraws the other leaves it.
                    move_durably(temporary, self.target)
                return same
            except OSError:  # a file system without hard links
                if self.target.exists():
                    return stores.file_sha256(self.target) == self.sha256
                move_durably(temporary, self.target)
        sync_directory(self.target.parent)
        return True

    def replace(self) -> None:
        """Put the trace there whatever is there; the spool keeps its own."""
        with self._prepared() as temporary:
            move_durably(temporary, self.target)

    def withdraw(self) -> None:
        """Remove the trace from there if it is that of this attempt."""
        with suppress(FileNotFoundError):
            if self.source.samefile(self.target):
                self.target.unlink()

    @contextmanager
    def _prepared(self) -> Iterator[Path]:
        """Give the trace, on the disk, another name in the folder of the target."""
        temporary = self.target.with_name(f".{self.target.name}.{os.urandom(4).hex()}.tmp")
        try:
            try:
                os.link(self.source, temporary)
            except OSError:  # another file system
                shutil.copyfile(self.source, temporary)
            with temporary.open("rb") as file:
                os.fsync(file.fileno())
            yield temporary
        finally:
            # Also when all went well: of two hard links to one file, rename(2) removes neither.
            temporary.unlink(missing_ok=True)


class ResultUploader:
    """Hands finished attempts over, several at a time, each in a thread.

    ``moved`` grows whenever something of a trace has arrived.
    """

    def __init__(
        self,
        daemon: DaemonConnection,
        worker: str,
        paths: WorkerPaths,
        log: Callable[[str], None],
        *,
        turn: float = LONGEST_TURN,
    ) -> None:
        self._daemon = daemon
        self._worker = worker
        self._paths = paths
        self._log = log
        self._turn = turn
        # By folder: another ledger may have granted the same tokens.
        self._sending: dict[Path, _BusUpload] = {}
        self._counting = threading.Lock()
        self.moved = 0

    def deliver(self, attempt: Attempt) -> bool:
        """Deliver an attempt, or go on with it for a moment; returns whether it is delivered.

        Raises :class:`daemon.batch.errors.Rejected` for what is never to be taken. Everything else
        is delivered later: other errors of the daemon, ``OSError`` and :class:`Unreachable`.
        """
        result = _read_result(attempt)
        if self._paths.shared:
            self._by_path(attempt, result)
            return True
        return self._by_bus(attempt, result)

    def _complete(
        self,
        attempt: Attempt,
        result: RunResult,
        *,
        uploaded: bool = False,
    ) -> LedgerAnswer:
        lease = attempt.lease
        ours = (self._worker, lease.run, lease.attempt, lease.token)
        completion = Completion(*ours, result, uploaded, lease.era)
        return self._daemon.ask(COMPLETE, completion).answer

    def _moved(self, count: int) -> None:
        with self._counting:
            self.moved += count

    def _by_path(self, attempt: Attempt, result: RunResult) -> None:
        placement = TracePlacement.of(attempt, self._paths.state, result)
        placed = placement.put()
        answer = self._complete(attempt, result)
        if answer is LedgerAnswer.MISSING:
            raise OSError(f"the daemon does not find {placement.target}")
        if answer is LedgerAnswer.RECORDED and not placed:
            # The trace there is of an attempt whose result did not count: the ledger says so.
            placement.replace()
        elif answer in (LedgerAnswer.DROPPED, LedgerAnswer.REDUNDANT):
            placement.withdraw()

    def _by_bus(self, attempt: Attempt, result: RunResult) -> bool:
        if attempt.folder not in self._sending:
            self._sending[attempt.folder] = _BusUpload(_checked_trace(attempt, result))
        sending, until = self._sending[attempt.folder], time.monotonic() + self._turn
        try:
            while not sending.complete:
                self._send(attempt, result, sending)
                if time.monotonic() > until:
                    return False
        except Unreachable:
            sending.offset = None  # whoever answers next says how far it is
            raise
        # Missing: the parts are gone from the daemon's folder since it acknowledged the last one.
        if self._complete(attempt, result, uploaded=True) is LedgerAnswer.MISSING:
            self._sending[attempt.folder] = _BusUpload(sending.path, again=True)
            if sending.again:
                raise OSError(f"the daemon does not find the trace of {attempt.lease.run}")
            return False
        self._tell(attempt, result, sending.begun, "sent")
        del self._sending[attempt.folder]
        return True

    def _send(self, attempt: Attempt, result: RunResult, sending: _BusUpload) -> None:
        """Send the next part, or ask where to go on."""
        lease, trace = attempt.lease, result.trace
        ours = (self._worker, lease.run, lease.token, trace.sha256, trace.size)

        def ask(offset: int, text: str, digest: str) -> UploadProgress:
            chunk = TraceUploadChunk(*ours, offset, text, digest, lease.era)
            return self._daemon.ask(UPLOAD, chunk)

        self._moved(sending.send_next(ask))
        if sending.faults >= _FAULTS:
            sending.faults, sending.offset = 0, None
            raise OSError(f"the trace of {lease.run} does not arrive: {sending.problem}")

    def _tell(self, attempt: Attempt, result: RunResult, begun: float, what: str) -> None:
        took = time.monotonic() - begun
        self._log(f"{attempt.lease.run}: {result.trace.size} bytes {what} in {took:.2f} s")


def _read_result(attempt: Attempt) -> RunResult:
    """Return the result in the spool; raises :class:`Rejected` when it is damaged."""
    try:
        return attempt.result()
    except ValueError as error:
        words = f"its result is damaged in the spool: {error}"
        raise Rejected(words, Rejection.DAMAGED) from error


def _checked_trace(attempt: Attempt, result: RunResult) -> Path:
    """Return the trace in the spool.

    Raises :class:`Rejected` when it is not the trace of the result, and ``OSError`` when it cannot
    be read just now.
    """
    trace = attempt.folder / TRACE
    try:
        size, sha256 = trace.stat().st_size, stores.file_sha256(trace)
    except FileNotFoundError as error:
        raise Rejected("its trace is gone from the spool", Rejection.DAMAGED) from error
    if (size, sha256) != (result.trace.size, result.trace.sha256):
        raise Rejected("its trace is damaged in the spool", Rejection.DAMAGED)
    return trace
