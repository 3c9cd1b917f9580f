"""Writing the ledger: people's changes of campaigns, and transactions."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Final, TypeVar

from daemon.batch.errors import DaemonError, Refused, Unavailable
from daemon.batch.ledger._connection import UNREADABLE, connect
from daemon.batch.ledger._entry import enter_campaign, enter_runs
from daemon.batch.ledger._leases import RETRY
from daemon.batch.ledger._results import has_stopped_result, remove_result, reuse_results
from daemon.batch.ledger._search_updates import SearchUpdates
from daemon.batch.ledger._searches import search_state
from daemon.batch.paths import StatePaths
from daemon.model.messages import RetryRequest, SteerRequest
from daemon.model.run_state import RunState
from daemon.model.status import SubmissionReceipt
from daemon.model.submission import Submission
from daemon.model.verdicts import Outcome
from grammars.text.files import sync_directory

T = TypeVar("T")

# The effect of ``transitions.advance`` on the runs of a cancelled campaign, for up to 200,000.
_CANCEL: Final = (
    "UPDATE run SET state = CASE result WHEN '' THEN 'cancelled' ELSE 'done' END, token = 0,"
    " reason = 'cancelled', nondeterministic = 0"
    " WHERE campaign = ? AND state IN ('queued', 'running')"
)


class LedgerWriter(SearchUpdates):
    """The write side of the ledger on one connection, used by one thread, in transactions.

    A run is lost after ``attempts`` leases that ended badly. Times given to the methods are wall
    clock seconds since the epoch; ``paths`` are those of the state directory.
    """

    def __init__(
        self,
        connection: sqlite3.Connection,
        *,
        attempts: int = 3,
        paths: StatePaths | None = None,
    ) -> None:
        super().__init__(connection, attempts=attempts)
        self._paths = paths
        self._deleted: list[str] = []

    @classmethod
    @contextmanager
    def open(cls, paths: StatePaths, *, attempts: int = 3) -> Iterator[LedgerWriter]:
        """Open a ledger, creating it if necessary.

        Raises :class:`DaemonError`, also for statements in the block outside of a transaction.
        """
        try:
            with closing(connect(paths.ledger)) as connection:
                yield cls(connection, attempts=attempts, paths=paths)
        except UNREADABLE as error:
            raise DaemonError(f"{paths.ledger} is not a usable ledger: {error}") from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Commit everything in the block to the disk, or nothing.

        :attr:`events` are those of the block. Raises :class:`Unavailable` when the ledger cannot
        be written.
        """
        self.events = []
        self._deleted = []
        self._unsynced: set[Path] = set()
        try:
            # IMMEDIATE: a process that removes traces may hold the lock, and a transaction that
            # begins with a read cannot wait for it when it writes.
            self._db.execute("BEGIN IMMEDIATE")
            yield
            for folder in self._unsynced:
                sync_directory(folder)
            self._db.execute("COMMIT")
        except BaseException as error:
            self.events = []
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            if isinstance(error, (*UNREADABLE, OSError)):
                raise Unavailable(f"the ledger cannot be written: {error}") from error
            raise
        for campaign in self._deleted:
            # Unless it was submitted again in the meantime.
            if self._paths is not None and not self._is_known(campaign):
                _remove_files(self._paths, campaign)

    def sync_before_commit(self, folder: Path) -> None:
        """Sync new names in a folder before the commit of the transaction that refers to them."""
        self._unsynced.add(folder)

    def attempt(self, act: Callable[[LedgerWriter], T]) -> T | Exception:
        """Run a part of a transaction; return its exception, after which only it is undone."""
        events, deleted = len(self.events), len(self._deleted)
        self._db.execute("SAVEPOINT attempt")
        try:
            value: T | Exception = act(self)
        except sqlite3.OperationalError:
            # An error of the disk ends the whole transaction. SQLite may have rolled it back
            # already, and the savepoint with it.
            raise
        except Exception as error:
            self._db.execute("ROLLBACK TO attempt")
            del self.events[events:], self._deleted[deleted:]
            value = error
        self._db.execute("RELEASE attempt")
        return value

    @property
    def changes(self) -> int:
        """Counter of changes."""
        return self._db.total_changes

    def checkpoint(self) -> bool:
        """Copy the WAL into the database and empty it.

        Does not wait: returns ``False`` after a partial checkpoint, if somebody reads an older
        state. Raises :class:`Unavailable` on errors such as a full disk.
        """
        try:
            (timeout,) = self._db.execute("PRAGMA busy_timeout").fetchone()
            self._db.execute("PRAGMA busy_timeout = 0")
            try:
                # TRUNCATE: a WAL that is only copied keeps its frames. After a kill SQLite would
                # use these again, up to a damaged one, and hide newer data of the database.
                busy, *_ = self._db.execute("PRAGMA main.wal_checkpoint(TRUNCATE)").fetchone()
            finally:
                self._db.execute(f"PRAGMA busy_timeout = {timeout}")
        except UNREADABLE as error:
            raise Unavailable(f"the ledger's WAL cannot be emptied: {error}") from error
        return not busy

    def trace_location(self, run: str) -> tuple[str, str]:
        """Return the name of a run's trace, and its URL or an empty text."""
        query = "SELECT trace_name, trace_at FROM run WHERE id = ?"
        name, url = self._db.execute(query, (run,)).fetchone()
        return str(name), str(url)

    def record_move(self, name: str, digest: str, url: str) -> bool:
        """Record that the trace ``name`` of a result with that digest is at ``url`` now.

        This includes runs that reuse the result. Return whether the result is still the run's.
        """
        row = self._db.execute(
            "SELECT id FROM run WHERE trace_name = ? AND result = ?", (name, digest)
        ).fetchone()
        if row is None:
            return False
        self._db.execute("UPDATE run SET trace_at = ? WHERE id = ?", (url, row[0]))
        self._db.execute(
            "UPDATE run SET trace_at = ? WHERE cached = ? AND cached <> '' AND result = ?",
            (url, row[0], digest),
        )
        return True

    def submit(self, submission: Submission, now: float) -> SubmissionReceipt:
        """Enter a campaign and its runs; the same submission again changes nothing."""
        campaign, digest = submission.campaign, submission.digest
        row = self._db.execute(
            "SELECT digest, total FROM campaign WHERE id = ?", (campaign,)
        ).fetchone()
        if row is not None:
            if row[0] != digest:
                raise Refused(f"campaign id {campaign} belongs to another campaign")
            return SubmissionReceipt(campaign, row[1], known=True)
        enter_campaign(self._db, submission, digest, submission.declared, now)
        enter_runs(self._db, submission)
        cached = reuse_results(self._db, campaign)
        self.record_event(now, "campaign", campaign, campaign, "submitted")
        if cached:
            self._close_if_finished(campaign, now)
        return SubmissionReceipt(campaign, len(submission.runs), known=False, cached=cached)

    def cancel(self, campaign: str, now: float) -> int:
        """Cancel a campaign's queued and running runs; return their number. A search ends."""
        self._require_campaign(campaign)
        self._cancel_search(campaign, now)
        count = self._db.execute(_CANCEL, (campaign,)).rowcount
        # A search may be open without waiting or running runs.
        if count or self._is_open(campaign):
            self.record_event(now, "campaign", campaign, campaign, "cancelled")
            self._close(campaign, now)
        return count

    def _is_open(self, campaign: str) -> bool:
        query = "SELECT finished_at IS NULL FROM campaign WHERE id = ?"
        return bool(self._db.execute(query, (campaign,)).fetchone()[0])

    def steer(self, request: SteerRequest, now: float) -> int:
        """Pause or resume a campaign, or change its priority; return the number of waiting runs.

        Running runs go on. Repeating it changes nothing.
        """
        campaign, paused, priority = request.campaign, request.paused, request.priority
        self._require_campaign(campaign)
        if paused is not None and self._set(campaign, "paused", paused):
            state = "paused" if paused else "resumed"
            self.record_event(now, "campaign", campaign, campaign, state)
        if priority is not None and self._set(campaign, "priority", priority):
            self.record_event(now, "campaign", campaign, campaign, "prioritised", str(priority))
        return self._count_runs(campaign, RunState.QUEUED)

    def _set(self, campaign: str, column: str, value: int) -> bool:
        """Set a column of a campaign; return whether its value has changed."""
        query = f"UPDATE campaign SET {column} = ?1 WHERE id = ?2 AND {column} <> ?1"
        return self._db.execute(query, (value, campaign)).rowcount > 0

    def acknowledge(self, campaign: str, now: float) -> int:
        """Acknowledge the bad runs of a campaign; return the number of runs that did not pass.

        New ones reset this: see the trigger in ``schema.sql``.
        """
        self._require_campaign(campaign)
        if self._set(campaign, "acknowledged", True):
            self.record_event(now, "campaign", campaign, campaign, "acknowledged")
        query = (
            "SELECT total(runs) FROM tally WHERE campaign = ? AND (state = 'lost'"
            " OR (state = 'done' AND outcome IN ('fail', 'error', 'inconclusive')))"
        )
        return int(self._db.execute(query, (campaign,)).fetchone()[0])

    def retry(self, request: RetryRequest, now: float) -> int:
        """Queue runs again by state (lost, cancelled), by outcome, or ``all`` that have ended.

        The next result replaces that of a run that is not repeatable, or that the wall clock ended.
        Refuses unfinished searches, which only their client resumes.
        """
        campaign = request.campaign
        self._require_campaign(campaign)
        words = _retry_words(request.only)
        self._refuse_unfinished_search(campaign)
        rows = self._db.execute(
            "SELECT id, state, outcome, repeatable FROM run WHERE campaign = ?"
            " AND state IN ('done', 'lost', 'cancelled')",
            (campaign,),
        ).fetchall()
        rows = [row for row in rows if {row[1], row[2]} & words or "all" in words]
        if not rows:
            return 0
        self._db.executemany(RETRY, ((run,) for run, *_ in rows))
        for run, _, outcome, repeatable in rows:
            # Only errors can be stopped runs, and reading a result takes time.
            stopped = outcome == Outcome.ERROR and has_stopped_result(self._db, run)
            if stopped or not repeatable:
                remove_result(self._db, run)
        self._db.execute("UPDATE campaign SET finished_at = NULL WHERE id = ?", (campaign,))
        self.record_event(now, "campaign", campaign, campaign, "retried")
        return len(rows)

    def deletable(self, campaigns: Sequence[str]) -> tuple[int, ...]:
        """Return the numbers of runs of campaigns; refuse unfinished campaigns and searches."""
        for campaign in campaigns:
            self._require_campaign(campaign)
            if search_state(self._db, campaign) == "waiting":
                raise Refused(
                    f"{campaign} is an unfinished search: cancel it first"
                    f" (`scenario cancel {campaign}`)"
                )
            if waiting := self._count_runs(campaign, RunState.QUEUED, RunState.RUNNING):
                raise Refused(
                    f"{campaign} has {waiting} waiting or running runs: cancel it first"
                    f" (`scenario cancel {campaign}`)"
                )
        return tuple(map(self._total, campaigns))

    def delete(self, campaigns: Sequence[str], now: float) -> None:
        """Remove campaigns for good, all or none; refuse as :meth:`deletable`.

        Their traces are removed after the commit.
        """
        self.deletable(campaigns)
        assert self._paths is not None
        for campaign in campaigns:
            _remove_campaign(self._db, self._paths, campaign)
            # This event stays, so that absent clients learn of the deletion.
            self.record_event(now, "campaign", campaign, campaign, "deleted")
        _shorten_file(self._db)
        self._deleted += campaigns


def _retry_words(only: Sequence[str]) -> frozenset[str]:
    allowed = {"lost", "cancelled", "all", *Outcome} - {Outcome.MEASURE}
    unknown = sorted(set(only) - allowed)
    if unknown:
        raise Refused(
            f"cannot retry {', '.join(unknown)}: choose among {', '.join(sorted(allowed))}"
        )
    return frozenset(only)


def _remove_campaign(db: sqlite3.Connection, paths: StatePaths, campaign: str) -> None:
    """Remove the rows of a campaign; runs elsewhere that reuse its results get their traces.

    :func:`_remove_files` removes the files after the commit.
    """
    _hand_over(db, paths, campaign)
    db.execute("DELETE FROM event WHERE campaign = ?", (campaign,))
    # Runs before cells: SQLite looks for runs of each removed cell.
    db.execute("DELETE FROM run WHERE campaign = ?", (campaign,))
    db.execute("DELETE FROM campaign WHERE id = ?", (campaign,))


def _shorten_file(db: sqlite3.Connection) -> None:
    """Shorten the file by its free pages."""
    (free,) = db.execute("PRAGMA freelist_count").fetchone()
    for _ in range(free):
        # Python's SQLite frees one page each time, whatever number it gets.
        db.execute("PRAGMA incremental_vacuum(1)")


def _remove_files(paths: StatePaths, campaign: str) -> None:
    """Remove the traces of a deleted campaign."""
    folder = paths.traces / campaign
    for trace in folder.glob("*.mcap"):
        trace.unlink(missing_ok=True)
    with suppress(OSError):  # it has other files, or is gone
        folder.rmdir()


def _hand_over(db: sqlite3.Connection, paths: StatePaths, campaign: str) -> None:
    """Give the traces of a campaign to runs elsewhere that reuse its results.

    The first user of a result gets its trace; all others refer to the first.
    """
    users = db.execute(
        "SELECT source.id, source.trace_name, run.id, run.trace_name FROM run"
        " JOIN run AS source ON source.id = run.cached"
        " WHERE run.cached <> '' AND source.campaign = ?1 AND run.campaign <> ?1"
        " ORDER BY run.serial",
        (campaign,),
    ).fetchall()
    heirs: dict[str, str] = {}
    for source, old, run, new in users:
        if source in heirs:
            db.execute("UPDATE run SET cached = ? WHERE id = ?", (heirs[source], run))
            continue
        heirs[source] = run
        db.execute("UPDATE run SET cached = '' WHERE id = ?", (run,))
        _move_trace(paths, old, new)


def _move_trace(paths: StatePaths, old: str, new: str) -> None:
    source, target = paths.trace(old), paths.trace(new)
    if target.exists() or not source.exists():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    # Link it, since the transaction may still fail: the original must stay.
    try:
        os.link(source, target)
    except OSError:
        source.replace(target)
