"""Results of finished attempts and leases given back, on their way from a worker to its daemon.

Both are asked in threads; the loop hands the answers in. The trace goes first, then the ledger gets
the result. On the daemon's own file system the worker links the trace to where the daemon takes it
from. From any other machine it travels part by part, and goes on where it was after whatever broke
in between. A result stays in the spool until the ledger has acknowledged it, or until the daemon
has rejected it for good. Every other error means that it is delivered later.
"""

from __future__ import annotations

import os
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
from daemon.batch.worker._attempts import AdoptedWork, Attempt, Spool
from daemon.batch.worker._connection import DaemonConnection, WorkerPaths
from daemon.batch.worker._trouble import WorkerTrouble
from daemon.batch.worker._wakeups import BackgroundAsks
from daemon.model.messages import (
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

_LONGEST_PROBLEM: Final = 1000
"""Characters of an error that are told, on one line."""


class Deliveries:
    """Results and leases on their way from ``worker`` to its daemon.

    ``trouble`` is what keeps results from being taken. Results of another ledger than that of the
    daemon wait, without keeping others from being delivered. Traces travel in ``uploads``, all else
    in ``asks``. ``moved`` grows whenever something of a trace has arrived.
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
        log: Callable[[str], None],
    ) -> None:
        self._daemon = daemon
        self._paths = paths
        self._asks = asks
        self._uploads = uploads
        self._spool = spool
        self._worker = worker
        self._log = log
        self.trouble = trouble
        self.finished: list[Attempt] = []
        self.releases: list[ReleaseRequest] = []
        self._foreign: list[Attempt] = []
        self._arrived: set[Path] = set()
        self._counting = threading.Lock()
        self.moved = 0

    @property
    def pending(self) -> bool:
        """Whether something was not taken yet."""
        return bool(self.finished or self.releases)

    @property
    def foreign_words(self) -> str:
        """What waits for another ledger, in words; empty when nothing does."""
        count = len(self._foreign)
        words = f"{count} finished runs wait for another ledger than this daemon's"
        return f"{words}: start the daemon that keeps it" if count else ""

    def offer_again(self) -> None:
        """Deliver what has waited for another ledger: that one may have returned."""
        self.finished += self._foreign
        self._foreign.clear()

    def adopt(self, left: AdoptedWork) -> None:
        """Take over what dead workers left."""
        self.finished += left.finished
        for lease in left.unfinished:
            # Certain, unlike a connection that is lost: nobody holds the lock of that spool.
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
        """Give a lease back; ``damaged`` is the digest of the scene or file that was no good.

        With ``died`` it is that of a dead worker.
        """
        release = ReleaseRequest(
            self._worker, lease.run, lease.token, why, blame, damaged, lease.era, died
        )
        self.releases.append(release)

    def give_back_attempt(self, attempt: Attempt, why: str, *, blame: bool) -> None:
        """Give back the lease of an attempt that left no result, and forget the attempt."""
        lease = attempt.lease
        self._log(f"{lease.run} attempt {lease.attempt}: {why}")
        self.give_back(lease, why, blame=blame)
        self._spool.discard(attempt)

    def send_releases(self) -> None:
        """Ask the daemon to take back the leases it was not asked to yet."""
        for release in self.releases:
            if release not in self._asks:
                self._asks.start(release, partial(self._daemon.ask, RELEASE, release))

    def send_results(self) -> None:
        """Deliver the results that are not on their way; after trouble one tries."""
        for attempt in self.finished[: 1 if self.trouble.words else None]:
            folder = attempt.folder
            if folder in self._asks or folder in self._uploads:
                continue
            if self._paths.shared or folder in self._arrived:
                self._asks.start(folder, partial(self._complete, attempt))
            else:
                self._uploads.start(folder, partial(self._send_trace, attempt))

    def _send_trace(self, attempt: Attempt) -> bool:
        """Send the trace; returns that the result is not delivered with it.

        Raises :class:`Rejected` for what is damaged in the spool, ``OSError``, and errors of the
        daemon.
        """
        lease, info = attempt.lease, _read_result(attempt).trace
        trace, begun = _checked_trace(attempt, info), time.monotonic()
        ref = LeaseRef(lease.run, lease.token)

        def put(offset: int, data: bytes) -> int:
            request = PutRequest(info.sha256, info.size, offset, data, ref, lease.era)
            return self._daemon.ask(PUT, request).count

        upload(trace, put, self._count_moved)
        took = time.monotonic() - begun
        self._log(f"{lease.run}: {info.size} bytes sent in {took:.2f} s")
        return False

    def _count_moved(self, count: int) -> None:
        with self._counting:
            self.moved += count

    def _complete(self, attempt: Attempt) -> bool:
        """Hand the result over; returns that it is delivered, raises as :meth:`_send_trace`."""
        lease, result = attempt.lease, _read_result(attempt)
        if self._paths.shared:
            self._leave_trace(attempt, result.trace)
        completion = Completion(
            self._worker, lease.run, lease.attempt, lease.token, result, lease.era
        )
        if self._daemon.ask(COMPLETE, completion).answer is LedgerAnswer.MISSING:
            raise OSError(f"the daemon does not find the trace of {lease.run}")
        return True

    def _leave_trace(self, attempt: Attempt, info: TraceInfo) -> None:
        """Give the trace, which is on the disk, the name under which the daemon takes it."""
        trace, lease = _checked_trace(attempt, info), attempt.lease
        whole = self._paths.state.uploaded_trace(lease.run, lease.token, info.sha256)
        os.utime(trace)  # for long without its daemon, it must not look like a stray there
        try:
            os.link(trace, whole)
        except FileExistsError:
            return  # the result was handed over before, and the answer was lost
        except OSError:  # another file system, or one without hard links
            with replacing(whole) as temporary:
                shutil.copyfile(trace, temporary)

    def take_release_answer(self, release: ReleaseRequest, answer: Future[Any]) -> None:
        """Forget a lease that was taken back; raises :class:`Unreachable`."""
        try:
            answer.result()
        except (Refused, Failed, OtherLedger) as error:
            # Of somebody else by now, or forgotten. A daemon that fails at it must not keep this
            # worker from renewing and delivering: a lease that nobody renews lapses.
            self._log(f"{release.run}: not given back, {error}")
        if release in self.releases:  # else it was sent twice, while something was fetched
            self.releases.remove(release)

    def take_result_answer(self, folder: Path, answer: Future[Any]) -> None:
        """Forget an attempt whose result was taken or rejected; keep it after any other error.

        The answer is that to its trace, or to its result.

        Raises :class:`Unreachable` when nobody answered.
        """
        attempt = next((one for one in self.finished if one.folder == folder), None)
        if attempt is None:
            return
        self._arrived.discard(folder)
        try:
            delivered = answer.result()
        except Rejected as error:
            self.finished.remove(attempt)
            # The next execution would give the same again; nothing else is the doing of the run.
            blame = error.rejection is Rejection.TOO_LARGE
            self.give_back_attempt(attempt, f"the result was not taken: {error}", blame=blame)
        except OtherLedger as error:
            self.finished.remove(attempt)
            self._foreign.append(attempt)
            self._log(f"{attempt.lease.run}: kept in {attempt.folder}, {error}")
        except (DaemonError, OSError, ValueError) as error:
            if isinstance(error, Unreachable) and not isinstance(error, Unavailable):
                raise
            # A full disk, a daemon that fails, an answer nobody understands: the spool keeps it.
            words = " ".join(str(error).split())[:_LONGEST_PROBLEM]
            self._log(f"{attempt.lease.run}: delivered later, {words}")
            self.trouble.note(f"results cannot be delivered: {words}")
        else:
            if not delivered:
                self._arrived.add(folder)
                return
            self.trouble.clear()
            self.finished.remove(attempt)
            self._spool.discard(attempt)


def _read_result(attempt: Attempt) -> RunResult:
    """Return the result in the spool; raises :class:`Rejected` when it is damaged."""
    try:
        return attempt.result()
    except ValueError as error:
        words = f"its result is damaged in the spool: {error}"
        raise Rejected(words, Rejection.DAMAGED) from error


def _checked_trace(attempt: Attempt, info: TraceInfo) -> Path:
    """Return the trace in the spool.

    Raises :class:`Rejected` when it is not the trace of the result, and ``OSError`` when it cannot
    be read just now.
    """
    trace = attempt.folder / TRACE
    try:
        size, sha256 = trace.stat().st_size, file_sha256(trace)
    except FileNotFoundError as error:
        raise Rejected("its trace is gone from the spool", Rejection.DAMAGED) from error
    if (size, sha256) != (info.size, info.sha256):
        raise Rejected("its trace is damaged in the spool", Rejection.DAMAGED)
    return trace
