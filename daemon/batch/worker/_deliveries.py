"""Delivery of results and of returned leases from a worker to its daemon.

Threads send the requests; the loop passes on the answers. The trace goes first, then the result. On
the daemon's own file system the worker links the trace into the daemon's folder. From other
machines it travels in parts, and goes on after interruptions. A result stays in the spool until the
ledger has acknowledged it, or until the daemon has rejected it for good. After any other error it
is delivered later.
"""

from __future__ import annotations

import os
import random
import shutil
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any, Final

from daemon.batch.errors import (
    DaemonError,
    Failed,
    OtherLedger,
    Refused,
    Rejected,
    Unavailable,
    Unreachable,
)
from daemon.batch.run_process import TRACE
from daemon.batch.stores import file_sha256, upload
from daemon.batch.worker._attempts import Attempt, Spool, log
from daemon.batch.worker._connection import DaemonConnection, WorkerPaths
from daemon.batch.worker._wakeups import BackgroundAsks
from daemon.model.messages import (
    LONGEST_TROUBLE,
    Completion,
    Lease,
    LeaseRef,
    LedgerAnswer,
    PutRequest,
    Rejection,
    ReleaseRequest,
)
from daemon.model.spec import RunResult, TraceInfo
from daemon.model.verbs import COMPLETE, PUT, RELEASE
from grammars.text.files import replacing

_FIRST_PAUSE: Final = 1.0
_LONGEST_PAUSE: Final = 60.0
"""Pauses after the first trouble, and after many without a success [s]."""
_SPREAD: Final = 0.25
"""Random spread of pauses, so that workers with a shared full disk do not retry together."""
_LONGEST_PROBLEM: Final = 1000
"""Longest error in a message [characters], on one line."""


class WorkerTrouble:
    """A trouble of the worker's environment: a full disk, no processes, a damaged scene.

    Each repetition after a pause doubles the next pause; one success ends it. ``changed`` is called
    at its beginning and end.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self.words = ""
        """Its description, empty without one."""
        self.until = 0.0
        """End of the pause by the monotonic clock [s]; no run begins before."""
        self._pause = 0.0

    def note(self, words: str) -> None:
        """Note an occurrence; the last line of ``words`` is the description."""
        if not self.words:
            self._changed()
        last = (words.strip() or "a run was not executed").splitlines()[-1]
        self.words = last[-LONGEST_TROUBLE:]
        now = time.monotonic()
        if now < self.until:
            return  # from a run that began before the pause
        self._pause = min(2.0 * self._pause, _LONGEST_PAUSE) if self._pause else _FIRST_PAUSE
        self.until = now + self._pause * random.uniform(1.0 - _SPREAD, 1.0 + _SPREAD)

    def clear(self) -> None:
        """Note a success."""
        if self.words:
            log(f"over: {self.words}")
            self._changed()
        self.words, self.until, self._pause = "", 0.0, 0.0


class Deliveries:
    """Deliveries of results and leases from ``worker`` to its daemon.

    ``trouble`` is the reason why results are not accepted. Results of another ledger wait, without
    blocking others. Traces travel in ``uploads``, all other requests in ``asks``. ``moved`` counts
    the bytes of traces that have arrived.
    """

    def __init__(
        self,
        daemon: DaemonConnection,
        paths: WorkerPaths,
        asks: BackgroundAsks,
        uploads: BackgroundAsks,
        spool: Spool,
        trouble: WorkerTrouble,
        worker: str,
    ) -> None:
        self._daemon = daemon
        self._paths = paths
        self._asks = asks
        self._uploads = uploads
        self._spool = spool
        self._worker = worker
        self.trouble = trouble
        self.finished: list[Attempt] = []
        self.releases: list[ReleaseRequest] = []
        self._foreign: list[Attempt] = []
        self._arrived: set[Path] = set()
        self._counting = threading.Lock()
        self.moved = 0

    @property
    def pending(self) -> bool:
        """True if a result or lease is not yet delivered."""
        return bool(self.finished or self.releases)

    @property
    def foreign_words(self) -> str:
        """Notice about results that wait for another ledger, or an empty text."""
        count = len(self._foreign)
        words = f"{count} finished runs wait for another ledger than this daemon's"
        return f"{words}: start the daemon that keeps it" if count else ""

    def offer_again(self) -> None:
        """Retry the results for another ledger, which may have returned."""
        self.finished += self._foreign
        self._foreign.clear()

    def adopt(self) -> None:
        """Take over the work of dead workers."""
        finished, unfinished = self._spool.adopt()
        self.finished += finished
        for lease in unfinished:
            # Certain, unlike a lost connection: the lock of its spool is free.
            self.give_back(lease, "its worker died", died=True)

    def give_back(
        self,
        lease: Lease,
        why: str,
        *,
        blame: bool = False,
        damaged: str = "",
        died: bool = False,
    ) -> None:
        """Return a lease; ``damaged`` is the digest of a damaged scene or file.

        With ``died`` it is the lease of a dead worker.
        """
        release = ReleaseRequest(
            self._worker, lease.run, lease.token, why, blame, damaged, lease.era, died
        )
        self.releases.append(release)

    def give_back_attempt(self, attempt: Attempt, why: str, *, blame: bool) -> None:
        """Return the lease of an attempt without a result, and remove the attempt."""
        lease = attempt.lease
        log(f"{lease.run} attempt {lease.attempt}: {why}")
        self.give_back(lease, why, blame=blame)
        self._spool.discard(attempt)

    def send_releases(self) -> None:
        """Send the releases that are not in progress."""
        for release in self.releases:
            if release not in self._asks:
                self._asks.start(release, partial(self._daemon.ask, RELEASE, release))

    def send_results(self) -> None:
        """Deliver the results that are not in progress, in trouble only one as a test."""
        for attempt in self.finished[: 1 if self.trouble.words else None]:
            folder = attempt.folder
            if folder in self._asks or folder in self._uploads:
                continue
            if self._paths.shared or folder in self._arrived:
                self._asks.start(folder, partial(self._complete, attempt))
            else:
                self._uploads.start(folder, partial(self._send_trace, attempt))

    def _send_trace(self, attempt: Attempt) -> bool:
        """Send the trace; return false, since the result is not delivered yet.

        Raises :class:`Rejected` for damaged files in the spool, ``OSError``, and errors of the
        daemon.
        """
        lease, info = attempt.lease, _read_result(attempt).trace
        trace, start = _checked_trace(attempt, info), time.monotonic()
        ref = LeaseRef(lease.run, lease.token)

        def put(offset: int, data: bytes) -> int:
            request = PutRequest(info.sha256, info.size, offset, data, ref, lease.era)
            return self._daemon.ask(PUT, request).count

        upload(trace, put, self._count_moved)
        seconds = time.monotonic() - start
        log(f"{lease.run}: {info.size} bytes sent in {seconds:.2f} s")
        return False

    def _count_moved(self, count: int) -> None:
        with self._counting:
            self.moved += count

    def _complete(self, attempt: Attempt) -> bool:
        """Deliver the result; return true, raises as :meth:`_send_trace`."""
        lease, result = attempt.lease, _read_result(attempt)
        if self._paths.shared:
            self._link_trace(attempt, result.trace)
        completion = Completion(
            self._worker, lease.run, lease.attempt, lease.token, result, lease.era
        )
        if self._daemon.ask(COMPLETE, completion).answer is LedgerAnswer.MISSING:
            raise OSError(f"the daemon does not find the trace of {lease.run}")
        return True

    def _link_trace(self, attempt: Attempt, info: TraceInfo) -> None:
        """Link the trace to the path where the daemon takes it."""
        trace, lease = _checked_trace(attempt, info), attempt.lease
        whole = self._paths.state.uploaded_trace(lease.run, lease.token, info.sha256)
        os.utime(trace)  # after a long time without the daemon it would look like a stray
        try:
            os.link(trace, whole)
        except FileExistsError:
            return  # delivered before, but the answer was lost
        except OSError:  # another file system, or one without hard links
            with replacing(whole) as temporary:
                shutil.copyfile(trace, temporary)

    def take_release_answer(self, release: ReleaseRequest, answer: Future[Any]) -> None:
        """Forget a returned lease; raises :class:`Unreachable`."""
        try:
            answer.result()
        except (Refused, Failed, OtherLedger) as error:
            # The lease is another worker's by now, or unknown. A failing daemon must not block
            # renewals and deliveries: without a renewal the lease lapses anyway.
            log(f"{release.run}: not given back, {error}")
        if release in self.releases:  # it may have been sent twice
            self.releases.remove(release)

    def take_result_answer(self, folder: Path, answer: Future[Any]) -> None:
        """Remove an attempt whose result was accepted or rejected; keep it after other errors.

        ``answer`` is that to its trace or to its result. Raises :class:`Unreachable`.
        """
        attempt = next((one for one in self.finished if one.folder == folder), None)
        if attempt is None:
            return
        self._arrived.discard(folder)
        try:
            delivered = answer.result()
        except Rejected as error:
            self.finished.remove(attempt)
            # Only a too large result is the run's fault: it would come again.
            blame = error.rejection is Rejection.TOO_LARGE
            self.give_back_attempt(attempt, f"the result was not accepted: {error}", blame=blame)
        except OtherLedger as error:
            self.finished.remove(attempt)
            self._foreign.append(attempt)
            log(f"{attempt.lease.run}: kept in {attempt.folder}, {error}")
        except (DaemonError, OSError, ValueError) as error:
            if isinstance(error, Unreachable) and not isinstance(error, Unavailable):
                raise
            # For example a full disk, a failing daemon, a malformed answer: the spool keeps it.
            words = " ".join(str(error).split())[:_LONGEST_PROBLEM]
            log(f"{attempt.lease.run}: delivered later, {words}")
            self.trouble.note(f"results cannot be delivered: {words}")
        else:
            if not delivered:
                self._arrived.add(folder)
                return
            self.trouble.clear()
            self.finished.remove(attempt)
            self._spool.discard(attempt)


def _read_result(attempt: Attempt) -> RunResult:
    """Return the result in the spool; raises :class:`Rejected` if it is damaged."""
    try:
        return attempt.result()
    except ValueError as error:
        words = f"its result is damaged in the spool: {error}"
        raise Rejected(words, Rejection.DAMAGED) from error


def _checked_trace(attempt: Attempt, info: TraceInfo) -> Path:
    """Return the trace in the spool.

    Raises :class:`Rejected` if it does not match the result, and ``OSError`` if it cannot be read
    now.
    """
    trace = attempt.folder / TRACE
    try:
        size, sha256 = trace.stat().st_size, file_sha256(trace)
    except FileNotFoundError as error:
        raise Rejected("its trace is gone from the spool", Rejection.DAMAGED) from error
    if (size, sha256) != (info.size, info.sha256):
        raise Rejected("its trace is damaged in the spool", Rejection.DAMAGED)
    return trace
