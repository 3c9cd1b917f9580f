"""Writing the ledger: what people may do with campaigns, and the transactions it is done in."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from daemon.batch.errors import DaemonError, Refused, Unavailable
from daemon.batch.ledger._connection import UNREADABLE, connect
from daemon.batch.ledger._deletion import hides_anything, remove_campaign, remove_hidden
from daemon.batch.ledger._results import note_of_result, remove_result, reuse_in_steps
from daemon.batch.ledger._search_updates import SearchUpdates
from daemon.batch.ledger._searches import search_state
from daemon.batch.ledger._staging import drop_rows, enter_rows, read_campaign, stage_rows
from daemon.batch.ledger._steps import STEP_ROWS, Steps, finish
from daemon.batch.ledger.transitions import Cancelled, Retried
from daemon.batch.paths import StatePaths
from daemon.model.deadline import was_stopped
from daemon.model.messages import RetryRequest
from daemon.model.packed_submission import pack_submission
from daemon.model.status import Submission, SubmissionReceipt
from daemon.model.verdicts import Outcome

T = TypeVar("T")


class LedgerWriter(SearchUpdates):
    """The write side of the ledger on one connection, used by one thread, in transactions.

    A run is lost after ``attempts`` leases that ended badly; a lease lasts ``lease`` seconds.
    Times given to the methods are wall clock seconds since the epoch.
    """

    @classmethod
    @contextmanager
    def open(
        cls, paths: StatePaths, *, attempts: int = 3, lease: float = 30.0
    ) -> Iterator[LedgerWriter]:
        """Open a ledger, creating it if need be.

        Raises :class:`DaemonError`, also for what is done in the block outside of a transaction.
        """
        try:
            with closing(connect(paths.ledger)) as connection:
                yield cls(connection, attempts=attempts, lease=lease, paths=paths)
        except UNREADABLE as error:
            raise DaemonError(f"{paths.ledger} is not a usable ledger: {error}") from error

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
            self._attachment.detach()
        except BaseException as error:
            self.events = []
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            self._attachment.detach()
            if isinstance(error, UNREADABLE):
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

    @property
    def changes(self) -> int:
        """A number that is another one after every change."""
        return self._db.total_changes

    def checkpoint(self) -> bool:
        """Bring what is only in the WAL into the database, and leave the WAL empty.

        Waits for nobody: returns ``False`` when somebody reads an older state just now, and all
        that can be done is done. Raises :class:`Unavailable` when the disk is full, say.
        """
        try:
            (waited,) = self._db.execute("PRAGMA busy_timeout").fetchone()
            self._db.execute("PRAGMA busy_timeout = 0")
            try:
                # TRUNCATE: in a WAL that is only copied, frames stay that would be used again
                # after a kill, up to a damaged one, and cover what is newer in the database.
                busy, *_ = self._db.execute("PRAGMA main.wal_checkpoint(TRUNCATE)").fetchone()
            finally:
                self._db.execute(f"PRAGMA busy_timeout = {waited}")
        except UNREADABLE as error:
            raise Unavailable(f"the ledger's WAL cannot be emptied: {error}") from error
        return not busy

    def submit(self, submission: Submission, now: float) -> SubmissionReceipt:
        """Enter a campaign and its runs at once; the same submission again changes nothing."""
        stage_rows(self._db, pack_submission(submission), "temp")
        try:
            return finish(self._enter(now))
        finally:
            drop_rows(self._db)

    def submit_in_steps(self, staged: Path, now: float) -> Steps[SubmissionReceipt]:
        """Enter what :func:`daemon.batch.ledger.stage_submission` has made ready.

        Nobody sees anything of it before the last step. Given up before, what there is of it is
        hidden, and removed by :meth:`remove_hidden_in_steps` or by the same once more.
        """
        with self._attachment.of(str(staged)):
            receipt: SubmissionReceipt = yield from self._enter(now)
        return receipt

    def _enter(self, now: float) -> Steps[SubmissionReceipt]:
        staged = read_campaign(self._db)
        row = self._db.execute(
            "SELECT digest, total, visible FROM campaign WHERE id = ?", (staged.id,)
        ).fetchone()
        if row is not None and row[2]:
            if row[0] != staged.digest:
                raise Refused(f"campaign id {staged.id} is taken by another campaign")
            return SubmissionReceipt(staged.id, row[1], known=True)
        if row is not None and self._paths is not None:
            # What is left of an earlier attempt, or being deleted.
            yield from remove_campaign(self._db, self._paths, staged.id)
        named = (staged.id, staged.name, staged.about, staged.source, staged.digest, staged.runs)
        self._db.execute(
            "INSERT INTO campaign (id, name, about, source, digest, total, submitted_at, declared,"
            " fresh, origin, visible) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 0)",
            (*named, now, staged.declared, staged.fresh, staged.origin),
        )
        yield
        yield from enter_rows(self._db, staged)
        cached = yield from reuse_in_steps(self._db, staged.id, staged.runs)
        self._db.execute("UPDATE campaign SET visible = 1 WHERE id = ?", (staged.id,))
        self.record_event(now, "campaign", staged.id, staged.id, "submitted")
        if cached:
            self._close_if_finished(staged.id, now)
        return SubmissionReceipt(staged.id, staged.runs, known=False, cached=cached)

    def cancel(self, campaign: str, now: float) -> int:
        """Cancel what is queued or running of a campaign at once; returns how many runs."""
        return finish(self.cancel_in_steps(campaign, now))

    def cancel_in_steps(self, campaign: str, now: float) -> Steps[int]:
        """Cancel what is queued or running of a campaign; returns how many runs.

        None of it is leased meanwhile. A search ends. Given up in the middle, it is done once more.
        """
        self._require_campaign(campaign)
        self._end_search(campaign, "cancelled", "", now)
        count, position = 0, -1
        with self._holding(campaign):
            while rows := self._rows_after(
                campaign, position, "id", "state IN ('queued', 'running')"
            ):
                position = rows[-1][0]
                for _, run in rows:
                    self._apply(run, Cancelled(), now, quiet=True)
                count += len(rows)
                yield
        # A search may have nothing that waits or runs.
        if count or self._is_open(campaign):
            self.record_event(now, "campaign", campaign, campaign, "cancelled")
            self._close(campaign, now)
        return count

    def _is_open(self, campaign: str) -> bool:
        query = "SELECT finished_at IS NULL FROM campaign WHERE id = ?"
        return bool(self._db.execute(query, (campaign,)).fetchone()[0])

    def _rows_after(
        self, campaign: str, position: int, columns: str, condition: str
    ) -> list[tuple[Any, ...]]:
        """Return position and ``columns`` of the next runs of a campaign that are meant."""
        return self._db.execute(
            f"SELECT position, {columns} FROM run WHERE campaign = ? AND position > ?"
            f" AND {condition} ORDER BY position LIMIT ?",
            (campaign, position, STEP_ROWS),
        ).fetchall()

    @contextmanager
    def _holding(self, campaign: str) -> Iterator[None]:
        """Lease no runs of a campaign in the block: others come between its steps."""
        self._held.add(campaign)
        try:
            yield
        finally:
            self._held.discard(campaign)

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
        """Queue runs again at once, as :meth:`retry_in_steps` does."""
        return finish(self.retry_in_steps(request, now))

    def retry_in_steps(self, request: RetryRequest, now: float) -> Steps[int]:
        """Queue runs again by state (lost, cancelled), by outcome, or ``all`` that rest.

        The result of a run that is not repeatable, or that the wall clock ended, is forgotten:
        the next one takes its place. None of the campaign is leased meanwhile. A search that was
        cancelled or has failed goes on, with what was cancelled.
        """
        campaign = request.campaign
        self._require_campaign(campaign)
        words = _retry_words(request.only)
        queued = self._retry_search(campaign, words, now)
        if queued is not None:
            return queued
        count, position = 0, -1
        with self._holding(campaign):
            while rows := self._rows_after(
                campaign,
                position,
                "id, state, outcome, repeatable",
                "state IN ('done', 'lost', 'cancelled')",
            ):
                position = rows[-1][0]
                chosen = [row[1:] for row in rows if {row[2], row[3]} & words or "all" in words]
                for run, _, outcome, repeatable in chosen:
                    self._retry_run(run, outcome, bool(repeatable), now)
                if chosen and not count:
                    self._db.execute(
                        "UPDATE campaign SET finished_at = NULL WHERE id = ?", (campaign,)
                    )
                count += len(chosen)
                yield
        if count:
            self.record_event(now, "campaign", campaign, campaign, "retried")
        return count

    def _retry_run(self, run: str, outcome: str, repeatable: bool, now: float) -> None:
        stopped = outcome == Outcome.ERROR and was_stopped(note_of_result(self._db, run))
        self._apply(run, Retried(stopped), now, quiet=True)
        if stopped or not repeatable:
            remove_result(self._db, run)

    def deletable(self, campaigns: Sequence[str]) -> tuple[int, ...]:
        """Return how many runs campaigns have that may be deleted; refuses while runs wait or run.

        Nor may a search that goes on, or one that is being changed in steps.
        """
        for campaign in campaigns:
            self._require_campaign(campaign)
            if search_state(self._db, campaign) == "running":
                raise Refused(
                    f"{campaign} is a search that goes on: cancel it first"
                    f" (`scenario cancel {campaign}`)"
                )
            if waiting := self._unfinished_runs(campaign):
                raise Refused(
                    f"{campaign} has {waiting} runs that wait or run: cancel it first"
                    f" (`scenario cancel {campaign}`)"
                )
            if campaign in self._held:
                raise Refused(f"{campaign} is being changed just now: try again in a moment")
        return tuple(map(self._total, campaigns))

    def delete(self, campaigns: Sequence[str], now: float) -> None:
        """Hide campaigns for good, all or none; refuses as :meth:`deletable` does.

        Their rows and traces go by :meth:`remove_hidden_in_steps`.
        """
        self.deletable(campaigns)
        for campaign in campaigns:
            self._db.execute("UPDATE campaign SET visible = 0 WHERE id = ?", (campaign,))
            self.record_event(now, "campaign", campaign, campaign, "deleted")

    @property
    def hides_anything(self) -> bool:
        """Whether there are campaigns to remove: deleted ones, and those not entered as a whole."""
        return hides_anything(self._db)

    def remove_hidden_in_steps(self) -> Steps[int]:
        """Remove what is hidden, with its traces; returns how many campaigns.

        Not while one is being entered. Given up in the middle, it is begun again.
        """
        if self._paths is None:
            return 0
        removed: int = yield from remove_hidden(self._db, self._paths)
        return removed


def _retry_words(only: Sequence[str]) -> frozenset[str]:
    allowed = {"lost", "cancelled", "all", *Outcome} - {Outcome.MEASURE}
    unknown = sorted(set(only) - allowed)
    if unknown:
        raise Refused(
            f"cannot retry {', '.join(unknown)}: choose among {', '.join(sorted(allowed))}"
        )
    return frozenset(only)
