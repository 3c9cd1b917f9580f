"""What a worker owes its daemon: results of finished attempts, and leases it gives back.

Both are asked in threads; the loop hands the answers in. A result stays in the spool until the
ledger has acknowledged it, or until the daemon has rejected it for good. Every other error means
that it is delivered later.
"""

from __future__ import annotations

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
from daemon.batch.worker._attempts import AdoptedWork, Attempt, Spool
from daemon.batch.worker._background import BackgroundAsks
from daemon.batch.worker._connection import DaemonConnection
from daemon.batch.worker._trouble import WorkerTrouble
from daemon.batch.worker._uploader import ResultUploader
from daemon.model.messages import Lease, Rejection, ReleaseRequest
from daemon.model.verbs import RELEASE

_LONGEST_PROBLEM: Final = 1000
"""Characters of an error that are told, on one line."""


class Deliveries:
    """Results and leases on their way from ``worker`` to its daemon.

    ``trouble`` is what keeps results from being taken. Results of another ledger than that of the
    daemon wait, without keeping others from being delivered.
    """

    def __init__(
        self,
        daemon: DaemonConnection,
        uploader: ResultUploader,
        asks: BackgroundAsks,
        spool: Spool,
        trouble: WorkerTrouble,
        worker: str,
        log: Callable[[str], None],
    ) -> None:
        self._daemon = daemon
        self._uploader = uploader
        self._asks = asks
        self._spool = spool
        self._worker = worker
        self._log = log
        self.trouble = trouble
        self.finished: list[Attempt] = []
        self.releases: list[ReleaseRequest] = []
        self._foreign: list[Attempt] = []

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
            if attempt.folder not in self._asks:
                self._asks.start(attempt.folder, partial(self._uploader.deliver, attempt))

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

        Raises :class:`Unreachable` when nobody answered.
        """
        attempt = next((one for one in self.finished if one.folder == folder), None)
        if attempt is None:
            return
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
            if delivered:  # else it is a large trace: the next turn of it comes
                self.trouble.clear()
                self.finished.remove(attempt)
                self._spool.discard(attempt)
