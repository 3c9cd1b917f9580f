"""Delivering results: the trace goes where it belongs, then the ledger is told.

On the daemon's own file system the worker puts it there. To a store it goes directly. From any
other machine it travels over the bus, part by part between the agent's other duties, and goes on
where it was after whatever broke in between.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from daemon.batch import stores
from daemon.batch.errors import Unavailable, Unreachable
from daemon.batch.run_process import TRACE
from daemon.batch.worker._attempts import Attempt, TracePlacement
from daemon.batch.worker._connection import DaemonConnection, WorkerPaths
from daemon.model.messages import (
    LARGEST_CHUNK,
    Completion,
    LedgerAnswer,
    TraceUploadChunk,
    UploadProgress,
)
from daemon.model.spec import RunResult
from daemon.model.verbs import COMPLETE, UPLOAD

_LONGEST_TURN: Final = 0.5
"""Seconds of sending before the agent looks after its runs and leases again."""
_QUICK_ANSWER: Final = 0.1
_SMALLEST_CHUNK: Final = 16 * 2**10
_FIRST_CHUNK: Final = 64 * 2**10
_FAULTS: Final = 5


@dataclass(slots=True)
class _BusUpload(stores.FileUpload):
    """A trace on its way over the bus."""

    begun: float = field(default_factory=time.monotonic)


class _StoreUpload(threading.Thread):
    """A trace on its way into a store."""

    def __init__(self, source: Path, url: str) -> None:
        super().__init__(name=f"puts {source.parent.name}", daemon=True)
        self._source, self._url = source, url
        self.begun = time.monotonic()
        self.problem: OSError | None = None
        self.start()

    def run(self) -> None:
        """Put it; whoever started this looks at ``problem`` afterwards."""
        try:
            stores.put_in_store(self._source, self._url)
        except OSError as error:
            self.problem = error


class ResultUploader:
    """Hands finished attempts over; ``moved`` grows whenever something of a trace has arrived."""

    def __init__(
        self, link: DaemonConnection, worker: str, base: WorkerPaths, log: Callable[[str], None]
    ) -> None:
        self._link = link
        self._worker = worker
        self._base = base
        self._log = log
        self._chunk = _FIRST_CHUNK
        self._sending: dict[int, _BusUpload] = {}
        self._putting: dict[int, _StoreUpload] = {}
        self.moved = 0

    def hand_over(self, attempt: Attempt) -> bool:
        """Deliver an attempt, or go on with it for a moment; returns whether it is delivered.

        Raises :class:`daemon.batch.errors.Refused` or ``ValueError`` for what is never to be taken,
        ``OSError`` for what may be delivered later, and :class:`Unreachable`.
        """
        result = attempt.result()
        if attempt.grant.store:
            return self._by_store(attempt, result)
        if self._base.shared:
            self._by_path(attempt, result)
            return True
        return self._by_bus(attempt, result)

    def _complete(
        self, attempt: Attempt, result: RunResult, location: str = "", *, uploaded: bool = False
    ) -> LedgerAnswer:
        grant = attempt.grant
        completion = Completion(
            self._worker, grant.run, grant.attempt, grant.token, result, location, uploaded
        )
        return self._link.ask(COMPLETE, completion).answer

    def _by_path(self, attempt: Attempt, result: RunResult) -> None:
        placement = TracePlacement.of(attempt, self._base.places, result)
        placed = placement.put()
        answer = self._complete(attempt, result)
        if answer is LedgerAnswer.MISSING:
            raise OSError(f"the daemon does not find {placement.target}")
        if answer is LedgerAnswer.RECORDED and not placed:
            placement.replace()
        elif answer is LedgerAnswer.DROPPED:
            placement.withdraw()

    def _by_store(self, attempt: Attempt, result: RunResult) -> bool:
        grant, trace = attempt.grant, _checked_trace(attempt, result)
        url = stores.trace_url(grant.store, grant.trace, result.trace.sha256)
        putting = self._putting.get(grant.token)
        if putting is None:
            self._putting[grant.token] = _StoreUpload(trace, url)
            return False
        if putting.is_alive():
            return False
        if putting.problem is not None:
            del self._putting[grant.token]
            raise putting.problem
        answer = self._complete(attempt, result, url)
        del self._putting[grant.token]
        self.moved += result.trace.size
        self._tell(attempt, result, putting.begun, "kept in the store")
        if answer in (LedgerAnswer.DROPPED, LedgerAnswer.DIFFERS):
            with suppress(stores.StoreUnusable):  # it harms nobody there: nothing refers to it
                stores.remove_from_store(url)
        return True

    def _by_bus(self, attempt: Attempt, result: RunResult) -> bool:
        token = attempt.grant.token
        if token not in self._sending:
            self._sending[token] = _BusUpload(_checked_trace(attempt, result))
        sending, until = self._sending[token], time.monotonic() + _LONGEST_TURN
        try:
            while not sending.complete:
                self._send(attempt, result, sending)
                if time.monotonic() > until:
                    return False
        except Unreachable:
            sending.offset = None  # whoever answers next says how far it is
            self._chunk = max(self._chunk // 2, _SMALLEST_CHUNK)
            raise
        if self._complete(attempt, result, uploaded=True) is LedgerAnswer.MISSING:
            self._sending[token] = _BusUpload(sending.path)
            return False
        self._tell(attempt, result, sending.begun, "sent")
        del self._sending[token]
        return True

    def _send(self, attempt: Attempt, result: RunResult, sending: _BusUpload) -> None:
        """Send the next part, or ask where to go on."""
        grant, trace = attempt.grant, result.trace
        ours = (self._worker, grant.run, grant.token, trace.sha256, trace.size)

        def ask(offset: int, text: str, digest: str) -> UploadProgress:
            chunk = TraceUploadChunk(*ours, offset, text, digest)
            return self._link.ask(UPLOAD, chunk)

        asked = time.monotonic()
        try:
            self.moved += sending.send_next(ask, self._chunk)
        except Unavailable as error:
            # No room there just now. Everything else goes on: leases are renewed, say.
            raise OSError(str(error)) from error
        if time.monotonic() - asked < _QUICK_ANSWER:
            self._chunk = min(2 * self._chunk, LARGEST_CHUNK)
        if sending.faults >= _FAULTS:
            sending.faults, sending.offset = 0, None
            raise OSError(f"the trace of {grant.run} does not arrive: {sending.problem}")

    def _tell(self, attempt: Attempt, result: RunResult, begun: float, what: str) -> None:
        took = time.monotonic() - begun
        self._log(f"{attempt.grant.run}: {result.trace.size} bytes {what} in {took:.2f} s")


def _checked_trace(attempt: Attempt, result: RunResult) -> Path:
    """Return the trace in the spool; raises ``ValueError`` when it is not what the result says."""
    trace = attempt.folder / TRACE
    if not stores.matches_digest(trace, result.trace.size, result.trace.sha256):
        raise ValueError("its trace is gone or damaged in the spool")
    return trace
