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
from typing import TYPE_CHECKING, Final

from daemon import store
from daemon.child import TRACE
from daemon.errors import Troubled, Unreachable
from daemon.messages import (
    LARGEST_CHUNK,
    Acknowledgement,
    Answer,
    Chunk,
    Completion,
    Received,
    Verb,
)
from daemon.spec import RunResult
from daemon.worker._spool import Attempt, Placement

if TYPE_CHECKING:
    from daemon.worker._agent import Link
    from daemon.worker._base import Base

_TURN: Final = 0.5
"""Seconds of sending before the agent looks after its runs and leases again."""
_QUICK: Final = 0.1
_SMALLEST_CHUNK: Final = 16 * 2**10
_FIRST_CHUNK: Final = 64 * 2**10
_FAULTS: Final = 5


@dataclass(slots=True)
class _Sending:
    """A trace on its way over the bus; ``offset`` is unknown until the daemon says it."""

    begun: float = field(default_factory=time.monotonic)
    offset: int | None = None
    complete: bool = False
    faults: int = 0


class _Putting(threading.Thread):
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
            store.put(self._source, self._url)
        except OSError as error:
            self.problem = error


class Courier:
    """Hands finished attempts over; ``moved`` grows whenever something of a trace has arrived."""

    def __init__(self, link: Link, worker: str, base: Base, log: Callable[[str], None]) -> None:
        self._link = link
        self._worker = worker
        self._base = base
        self._log = log
        self._chunk = _FIRST_CHUNK
        self._sending: dict[int, _Sending] = {}
        self._putting: dict[int, _Putting] = {}
        self.moved = 0

    def hand_over(self, attempt: Attempt) -> bool:
        """Deliver an attempt, or go on with it for a moment; returns whether it is delivered.

        Raises :class:`daemon.errors.Refused` or ``ValueError`` for what is never to be taken,
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
    ) -> Answer:
        grant = attempt.grant
        completion = Completion(
            self._worker, grant.run, grant.attempt, grant.token, result, location, uploaded
        )
        return self._link.ask(Verb.COMPLETE, completion, Acknowledgement).answer

    def _by_path(self, attempt: Attempt, result: RunResult) -> None:
        placement = Placement.of(attempt, self._base.places, result)
        placed = placement.put()
        answer = self._complete(attempt, result)
        if answer is Answer.MISSING:
            raise OSError(f"the daemon does not find {placement.target}")
        if answer is Answer.RECORDED and not placed:
            placement.replace()
        elif answer is Answer.DROPPED:
            placement.withdraw()

    def _by_store(self, attempt: Attempt, result: RunResult) -> bool:
        grant, trace = attempt.grant, _undamaged(attempt, result)
        url = store.stored_url(grant.store, grant.trace, result.trace.sha256)
        putting = self._putting.get(grant.token)
        if putting is None:
            self._putting[grant.token] = _Putting(trace, url)
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
        if answer in (Answer.DROPPED, Answer.DIFFERS):
            with suppress(store.StoreUnusable):  # it harms nobody there: nothing refers to it
                store.remove(url)
        return True

    def _by_bus(self, attempt: Attempt, result: RunResult) -> bool:
        token = attempt.grant.token
        if token not in self._sending:
            _undamaged(attempt, result)
            self._sending[token] = _Sending()
        sending, until = self._sending[token], time.monotonic() + _TURN
        try:
            while not sending.complete:
                self._send(attempt, result, sending)
                if time.monotonic() > until:
                    return False
        except Unreachable:
            sending.offset = None  # whoever answers next says how far it is
            self._chunk = max(self._chunk // 2, _SMALLEST_CHUNK)
            raise
        if self._complete(attempt, result, uploaded=True) is Answer.MISSING:
            self._sending[token] = _Sending()
            return False
        self._tell(attempt, result, sending.begun, "sent")
        del self._sending[token]
        return True

    def _send(self, attempt: Attempt, result: RunResult, sending: _Sending) -> None:
        """Send the next part, or ask where to go on."""
        grant, trace = attempt.grant, result.trace
        data = b""
        if sending.offset is not None:
            data = store.read_part(attempt.folder / TRACE, sending.offset, self._chunk)
        text, digest = store.packed(data)
        chunk = Chunk(
            self._worker, grant.run, grant.token, trace.sha256, trace.size,
            sending.offset or 0, text, digest,
        )  # fmt: skip
        asked = time.monotonic()
        try:
            received = self._link.ask(Verb.UPLOAD, chunk, Received)
        except Troubled as error:
            # No room there just now. Everything else goes on: leases are renewed, say.
            raise OSError(str(error)) from error
        if time.monotonic() - asked < _QUICK:
            self._chunk = min(2 * self._chunk, LARGEST_CHUNK)
        if received.problem:
            self._count_fault(grant.run, sending, received)
        self.moved += len(data)
        sending.offset, sending.complete = received.offset, received.complete

    def _count_fault(self, run: str, sending: _Sending, received: Received) -> None:
        sending.faults += 1
        if sending.faults >= _FAULTS:
            sending.faults, sending.offset = 0, None
            raise OSError(f"the trace of {run} does not arrive: {received.problem}")

    def _tell(self, attempt: Attempt, result: RunResult, begun: float, what: str) -> None:
        took = time.monotonic() - begun
        self._log(f"{attempt.grant.run}: {result.trace.size} bytes {what} in {took:.2f} s")


def _undamaged(attempt: Attempt, result: RunResult) -> Path:
    """Return the trace in the spool; raises ``ValueError`` when it is not what the result says."""
    trace = attempt.folder / TRACE
    if not store.is_file_of(trace, result.trace.size, result.trace.sha256):
        raise ValueError("its trace is gone or damaged in the spool")
    return trace
