"""Writing the ledger: what people may do with campaigns, and the transactions it is done in."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TypeVar

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.ledger._connection import connect
from daemon.batch.ledger._keys import KeyUpdates
from daemon.batch.ledger._results import (
    insert_runs,
    note_of_result,
    remove_result,
    reuse_results,
    store_reserve,
)
from daemon.batch.ledger.transitions import Cancelled, Retried
from daemon.model.deadline import was_stopped
from daemon.model.messages import RetryRequest
from daemon.model.packed_submission import Fingerprint, fingerprint
from daemon.model.status import Submission, SubmissionReceipt
from daemon.model.verdicts import Outcome
from grammars.text import codec

T = TypeVar("T")


class LedgerWriter(KeyUpdates):
    """The write side of the ledger on one connection, used by one thread, in transactions.

    A run is lost after ``attempts`` leases that ended badly; a lease lasts ``lease`` seconds.
    Times given to the methods are wall clock seconds since the epoch.
    """

    @classmethod
    @contextmanager
    def open(cls, path: Path, *, attempts: int = 3, lease: float = 30.0) -> Iterator[LedgerWriter]:
        """Open a ledger, creating or upgrading it if need be; raises :class:`DaemonError`."""
        with closing(connect(path)) as connection:
            yield cls(connection, attempts=attempts, lease=lease)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Do everything in the block or nothing; afterwards it is on the disk.

        :attr:`events` are those of the block. Raises :class:`Unavailable` when the ledger cannot
        be written.
        """
        self.events = []
        try:
            # IMMEDIATE: whoever removes traces may hold the lock, and a transaction that begins by
            # reading could not wait for it when it comes to writing.
            self._db.execute("BEGIN IMMEDIATE")
            yield
            self._db.execute("COMMIT")
        except BaseException as error:
            self.events = []
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            if isinstance(error, sqlite3.Error):
                raise Unavailable(f"the ledger cannot be written: {error}") from error
            raise

    def attempt(self, act: Callable[[LedgerWriter], T]) -> T | Exception:
        """Do something within a transaction; what it raises is returned and undoes only itself."""
        kept = len(self.events)
        self._db.execute("SAVEPOINT attempt")
        try:
            value: T | Exception = act(self)
        except sqlite3.OperationalError:
            # A full disk, a failing one: that is about the file and ends the whole transaction.
            # SQLite may have rolled it back already, and then the savepoint is gone too.
            raise
        except Exception as error:
            self._db.execute("ROLLBACK TO attempt")
            del self.events[kept:]
            value = error
        self._db.execute("RELEASE attempt")
        return value

    def submit(
        self, submission: Submission, now: float, known: Fingerprint | None = None
    ) -> SubmissionReceipt:
        """Enter a campaign and its runs; the same submission again changes nothing.

        ``known`` is its fingerprint, when somebody has taken it already.
        """
        digest, digests = known or fingerprint(submission)
        row = self._db.execute(
            "SELECT digest, total FROM campaign WHERE id = ?", (submission.campaign,)
        ).fetchone()
        if row is not None:
            if row[0] != digest:
                raise Refused(f"campaign id {submission.campaign} is taken by another campaign")
            return SubmissionReceipt(submission.campaign, row[1], known=True)
        campaign = submission.campaign
        self._enter(submission, digest, digests, now)
        cached = reuse_results(self._db, campaign)
        self.record_event(now, "campaign", campaign, campaign, "submitted")
        if cached:
            self._close_if_finished(campaign, now)
        return SubmissionReceipt(campaign, len(submission.runs), known=False, cached=cached)

    def _enter(
        self, submission: Submission, digest: str, digests: Sequence[str], now: float
    ) -> None:
        campaign = submission.campaign
        self._db.execute(
            "INSERT INTO campaign (id, name, about, source, digest, total, submitted_at, declared,"
            " fresh) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                campaign,
                submission.name,
                submission.about,
                submission.source,
                digest,
                len(submission.runs),
                now,
                codec.to_json(submission.declared),
                submission.fresh,
            ),
        )
        insert_runs(self._db, campaign, submission.runs, digests)
        store_reserve(self._db, campaign, submission.reserve)

    def cancel(self, campaign: str, now: float) -> int:
        """Cancel what is queued or running of a campaign; returns how many runs."""
        self._require_campaign(campaign)
        rows = self._db.execute(
            "SELECT id FROM run WHERE campaign = ? AND state IN ('queued', 'running')", (campaign,)
        ).fetchall()
        for (run,) in rows:
            self._apply(run, Cancelled(), now, quiet=True)
        if rows:
            self.record_event(now, "campaign", campaign, campaign, "cancelled")
            self._close(campaign, now)
        return len(rows)

    def pause(self, campaign: str, now: float, *, paused: bool) -> int:
        """Lease no more runs of a campaign, or go on; returns how many are queued.

        What is running goes on. Doing it twice changes nothing.
        """
        self._require_campaign(campaign)
        changed = self._db.execute(
            "UPDATE campaign SET paused = ?1 WHERE id = ?2 AND paused <> ?1", (paused, campaign)
        ).rowcount
        if changed:
            self.record_event(
                now, "campaign", campaign, campaign, "paused" if paused else "resumed"
            )
        found = self._db.execute(
            "SELECT total(runs) FROM tally WHERE campaign = ? AND state = 'queued'", (campaign,)
        ).fetchone()
        return int(found[0])

    def set_priority(self, campaign: str, priority: int, now: float) -> None:
        """Let a campaign go before those of lower priority, from the next lease on."""
        self._require_campaign(campaign)
        self._db.execute("UPDATE campaign SET priority = ? WHERE id = ?", (priority, campaign))
        self.record_event(now, "campaign", campaign, campaign, "prioritised", str(priority))

    def retry(self, request: RetryRequest, now: float) -> int:
        """Queue runs again by state (lost, cancelled), by outcome, or ``all`` that rest.

        The result of a run that is not repeatable, or that the wall clock ended, is forgotten:
        the next one takes its place.
        """
        self._require_campaign(request.campaign)
        words = _retry_words(request.only)
        rows = self._db.execute(
            "SELECT id, state, outcome, repeatable FROM run WHERE campaign = ?"
            " AND state IN ('done', 'lost', 'cancelled') ORDER BY serial",
            (request.campaign,),
        ).fetchall()
        chosen = [row for row in rows if {row[1], row[2]} & words or "all" in words]
        for run, _, outcome, repeatable in chosen:
            stopped = outcome == Outcome.ERROR and was_stopped(note_of_result(self._db, run))
            self._apply(run, Retried(stopped), now, quiet=True)
            if stopped or not repeatable:
                remove_result(self._db, run)
        if chosen:
            self._db.execute(
                "UPDATE campaign SET finished_at = NULL WHERE id = ?", (request.campaign,)
            )
            self.record_event(now, "campaign", request.campaign, request.campaign, "retried")
        return len(chosen)

    def _require_campaign(self, campaign: str) -> None:
        if not self._db.execute("SELECT 1 FROM campaign WHERE id = ?", (campaign,)).fetchone():
            raise Refused(f"there is no campaign {campaign}")


def _retry_words(only: Sequence[str]) -> frozenset[str]:
    allowed = {"lost", "cancelled", "all", *Outcome} - {Outcome.MEASURE}
    unknown = sorted(set(only) - allowed)
    if unknown:
        raise Refused(
            f"cannot retry {', '.join(unknown)}: choose among {', '.join(sorted(allowed))}"
        )
    return frozenset(only)
