"""Writing the ledger: transactions, campaigns, searches, and the leases of workers.

A search begins without runs. Its client appends them a few at a time, by position, and repeats this
after a crash: runs at occupied positions must then be equal.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from typing import Final, TypeVar

from daemon.batch.errors import DaemonError, Refused, Rejected, Unavailable
from daemon.batch.ledger._connection import UNREADABLE, connect
from daemon.batch.ledger._entry import enter_campaign, enter_runs, read_spec
from daemon.batch.ledger._queries import no_search, search_state
from daemon.batch.ledger._results import (
    has_stopped_result,
    hold_text,
    queue_reserve,
    read_campaign,
    read_holds,
    read_other_engines,
    remove_result,
    require_era,
    require_lease,
    reuse_results,
    store_result,
)
from daemon.batch.ledger.transitions import (
    Completed,
    ExecutionState,
    Lapsed,
    Leased,
    Released,
    Renewed,
    RunEvent,
    RunTransition,
    advance,
)
from daemon.batch.paths import StatePaths
from daemon.model.assessments import AssessmentRules
from daemon.model.ids import is_digest
from daemon.model.messages import (
    Completion,
    Lease,
    LeaseRef,
    LedgerAnswer,
    Rejection,
    ReleaseRequest,
    RetryRequest,
    SteerRequest,
)
from daemon.model.search import MOST_SEARCH_RUNS, Proposal, SearchSubmission
from daemon.model.search_answer import SearchProgress
from daemon.model.spec import ENGINE_VERSION, LARGEST_RESULT, RunSpec
from daemon.model.status import NONDETERMINISTIC, ChangeEvent, SubmissionReceipt
from daemon.model.submission import Submission
from daemon.model.verdicts import Outcome, RunState
from grammars.text import codec
from grammars.text.files import sync_directory
from grammars.text.words import command_line

T = TypeVar("T")

_FIELDS: Final = tuple(field.name for field in fields(ExecutionState))
"""Fields of a state, which are also columns of the table ``run``."""
_READ_STATE: Final = f"SELECT {', '.join(_FIELDS)} FROM run WHERE id = ?"
_WRITE_STATE: Final = f"UPDATE run SET {' = ?, '.join(_FIELDS)} = ? WHERE id = ?"
# The effects of ``transitions.advance`` on cancelled and retried runs, for up to 200,000 at once.
_CANCEL: Final = (
    "UPDATE run SET state = CASE result WHEN '' THEN 'cancelled' ELSE 'done' END, token = 0,"
    " reason = 'cancelled', nondeterministic = 0"
    " WHERE campaign = ? AND state IN ('queued', 'running')"
)
_RETRY: Final = (
    "UPDATE run SET state = 'queued', token = 0, reason = '', strikes = 0,"
    " lapses = 0, nondeterministic = 0,"
    " outdated = CASE state WHEN 'done' THEN granted ELSE outdated END WHERE id = ?"
)
_KEPT_EVENTS: Final = 10_000
_PRUNED_EVERY: Final = 1000
# The first run of the next campaign. ``served`` is the token of a campaign's latest lease, and
# tokens only grow: the campaign served longest ago goes first, which is round robin without a list.
# Both conditions check the worker's systems under test, so that it skips campaigns without a run
# for it. Runs with fewer leases go first, so a run that fails repeatedly goes last.
_NEXT_RUN: Final = (
    "SELECT run.id, run.campaign, trace_name,"
    " EXISTS (SELECT 1 FROM search WHERE search.campaign = run.campaign)"
    " FROM run WHERE state = 'queued'{able} AND run.campaign = (SELECT id FROM campaign"
    " AS c WHERE finished_at IS NULL AND paused = 0 AND lacks = '' AND EXISTS (SELECT 1 FROM run"
    " WHERE run.campaign = c.id AND state = 'queued'{able})"
    " ORDER BY priority DESC, served, serial LIMIT 1) ORDER BY run.attempt, run.serial LIMIT 1"
)
_ABLE: Final = " AND kind NOT IN (SELECT value FROM json_each(:lacks))"
_LONGEST_REASON: Final = 4000


class LedgerWriter:
    """The write side of the ledger on one connection, used by one thread, in transactions.

    Every change of a run goes through the pure transition function; a run is lost after
    ``attempts`` leases that ended badly. The ledger stores the holders of leases, the daemon's
    memory their deadlines. Any worker may present a lease: the next worker of a machine takes over
    the runs of a dead one. Times given to the methods are wall clock seconds since the epoch;
    ``paths`` are those of the state directory. :attr:`events` collects the events to publish after
    the commit.
    """

    def __init__(
        self,
        connection: sqlite3.Connection,
        *,
        attempts: int = 3,
        paths: StatePaths | None = None,
    ) -> None:
        self._db = connection
        self._attempts = attempts
        self._paths = paths
        self._era = ""
        # Runs executed by two workers, as far as renewals show; only used for hints.
        self._contested: set[str] = set()
        self._deleted: list[str] = []
        self._unsynced: set[Path] = set()
        self.events: list[ChangeEvent] = []

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
        self.events, self._deleted, self._unsynced = [], [], set()
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

    def record_event(
        self, now: float, kind: str, name: str, campaign: str = "", state: str = "", note: str = ""
    ) -> None:
        """Record an event, and keep it for publication after the commit."""
        cursor = self._db.execute(
            "INSERT INTO event (at, kind, id, campaign, state, note) VALUES (?, ?, ?, ?, ?, ?)",
            (now, kind, name, campaign, state, note),
        )
        seq = cursor.lastrowid or 0
        if seq % _PRUNED_EVERY == 0:
            # Alarms stay for good: the doctor counts all of them.
            self._db.execute(
                "DELETE FROM event WHERE seq <= ? AND kind <> 'alarm'", (seq - _KEPT_EVENTS,)
            )
        self.events.append(ChangeEvent(seq, kind, name, campaign, state))

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
        (finished_at,) = read_campaign(self._db, campaign, "finished_at")
        ended = self._db.execute(
            "UPDATE search SET state = 'cancelled' WHERE campaign = ? AND state = 'waiting'",
            (campaign,),
        ).rowcount
        if ended:
            self.record_event(now, "search", campaign, campaign, "cancelled")
        count = self._db.execute(_CANCEL, (campaign,)).rowcount
        # A search may be open without waiting or running runs.
        if count or finished_at is None:
            self.record_event(now, "campaign", campaign, campaign, "cancelled")
            self._close(campaign, now)
        return count

    def steer(self, request: SteerRequest, now: float) -> int:
        """Pause or resume a campaign, or change its priority; return the number of waiting runs.

        Running runs go on. Repeating it changes nothing.
        """
        campaign, paused, priority = request.campaign, request.paused, request.priority
        read_campaign(self._db, campaign, "id")
        if paused is not None and self._set(campaign, "paused", paused):
            state = "paused" if paused else "resumed"
            self.record_event(now, "campaign", campaign, campaign, state)
        if priority is not None and self._set(campaign, "priority", priority):
            self.record_event(now, "campaign", campaign, campaign, "prioritised", str(priority))
        return self._count_runs(campaign, RunState.QUEUED)

    def _set(self, campaign: str, column: str, value: int) -> bool:
        """Set a column of a campaign; return whether its value has changed."""
        query = f"UPDATE campaign SET {column} = :new WHERE id = :id AND {column} <> :new"
        return self._db.execute(query, {"new": value, "id": campaign}).rowcount > 0

    def acknowledge(self, campaign: str, now: float) -> int:
        """Acknowledge the bad runs of a campaign; return the number of runs that did not pass.

        New ones reset this: see the trigger in ``schema.sql``.
        """
        read_campaign(self._db, campaign, "id")
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
        read_campaign(self._db, campaign, "id")
        words = _retry_words(request.only)
        search = self._db.execute(
            "SELECT file FROM search WHERE campaign = ? AND state <> 'finished'", (campaign,)
        ).fetchone()
        if search is not None:
            command = command_line("search", search[0], campaign)
            raise Refused(f"{campaign} is a search: `{command}` goes on with it")
        rows = self._db.execute(
            "SELECT id, state, outcome, repeatable FROM run WHERE campaign = ?"
            " AND state IN ('done', 'lost', 'cancelled')",
            (campaign,),
        ).fetchall()
        rows = [row for row in rows if {row[1], row[2]} & words or "all" in words]
        if not rows:
            return 0
        self._queue_again(campaign, [row[:1] for row in rows], now)
        for run, _, outcome, repeatable in rows:
            # Only errors can be stopped runs, and reading a result takes time.
            stopped = outcome == Outcome.ERROR and has_stopped_result(self._db, run)
            if stopped or not repeatable:
                remove_result(self._db, run)
        return len(rows)

    def _queue_again(self, campaign: str, runs: Iterable[tuple[str]], now: float) -> None:
        self._db.executemany(_RETRY, runs)
        self._db.execute("UPDATE campaign SET finished_at = NULL WHERE id = ?", (campaign,))
        self.record_event(now, "campaign", campaign, campaign, "retried")

    def deletable(self, campaigns: Sequence[str]) -> tuple[int, ...]:
        """Return the numbers of runs of campaigns; refuse unfinished campaigns and searches."""
        totals = [read_campaign(self._db, one, "total")[0] for one in campaigns]
        for campaign in campaigns:
            is_search = search_state(self._db, campaign) == "waiting"
            waiting = self._count_runs(campaign, RunState.QUEUED, RunState.RUNNING)
            if is_search or waiting:
                runs = f"has {waiting} waiting or running runs"
                reason = "is an unfinished search" if is_search else runs
                raise Refused(
                    f"{campaign} {reason}: cancel it first (`scenario cancel {campaign}`)"
                )
        return tuple(totals)

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

    def _is_known(self, campaign: str) -> bool:
        query = "SELECT 1 FROM campaign WHERE id = ?"
        return self._db.execute(query, (campaign,)).fetchone() is not None

    def _count_runs(self, campaign: str, *states: RunState) -> int:
        query = "SELECT state, runs FROM tally WHERE campaign = ?"
        return sum(runs for state, runs in self._db.execute(query, (campaign,)) if state in states)

    def _close_if_finished(self, campaign: str, now: float) -> None:
        """Close a campaign without unfinished runs, unless cells need repeats of the reserve.

        An unfinished search stays open, since it will have more runs.
        """
        if search_state(self._db, campaign) == "waiting":
            return
        # Repeat: the ledger may already have the results of new repeats, and then the next look at
        # the cells is due at once.
        while not self._count_runs(campaign, RunState.QUEUED, RunState.RUNNING):
            if not queue_reserve(self._db, campaign):
                self._close(campaign, now)
                return
            reuse_results(self._db, campaign)
            self.record_event(now, "campaign", campaign, campaign, "extended")

    def _close(self, campaign: str, now: float) -> None:
        self._db.execute("UPDATE campaign SET finished_at = ? WHERE id = ?", (now, campaign))
        self.record_event(now, "campaign", campaign, campaign, "finished")

    def begin_search(self, search: SearchSubmission, now: float) -> None:
        """Enter a search, or resume a known one; a finished one stays unchanged."""
        campaign, task = search.campaign, codec.to_json(search.task)
        row = self._db.execute(
            "SELECT task, state FROM campaign LEFT JOIN search ON campaign = id WHERE id = ?",
            (campaign,),
        ).fetchone()
        if row is not None:
            if row[0] is None:
                raise Refused(f"campaign id {campaign} belongs to another campaign")
            if row[0] != task:
                raise Refused(f"{campaign} has other options: go on with it without options")
            if row[1] in ("cancelled", "failed"):
                self._resume_search(campaign, now)
            return
        digest = hashlib.sha256(task).hexdigest()
        enter_campaign(self._db, search, digest, AssessmentRules(), now)
        progress = SearchProgress(campaign, search.client, "explore")
        self._db.execute(
            "INSERT INTO search (campaign, task, file, progress) VALUES (?, ?, ?, ?)",
            (campaign, task, search.file, codec.to_json(progress)),
        )
        self.record_event(now, "campaign", campaign, campaign, "submitted")

    def extend(self, proposals: tuple[Proposal, ...], runs: Submission, now: float) -> int:
        """Add runs to a search, one for each proposal; return the number of new ones.

        Refuses runs that differ from those at their positions, and gaps between positions.
        """
        campaign, specs = runs.campaign, runs.specs
        state = search_state(self._db, campaign)
        if state != "waiting":
            raise Refused(f"the search {campaign} is {state}" if state else no_search(campaign))
        first = proposals[0].position
        (total,) = read_campaign(self._db, campaign, "total")
        if first > total or first + len(proposals) > MOST_SEARCH_RUNS:
            raise Refused(
                f"{campaign} has {total} runs of at most {MOST_SEARCH_RUNS}:"
                f" {len(proposals)} cannot be added at {first}"
            )
        (parameters,) = self._db.execute(
            "SELECT json_array_length(CAST(task AS TEXT), '$.parameters') FROM search"
            " WHERE campaign = ?",
            (campaign,),
        ).fetchone()
        if any(len(proposal.values) != parameters for proposal in proposals):
            raise Refused(f"the runs do not have the {parameters} parameters of {campaign}")
        rows = self._db.execute(
            "SELECT digest FROM run WHERE campaign = ? AND position >= ? ORDER BY position LIMIT ?",
            (campaign, first, len(proposals)),
        ).fetchall()
        if any(spec.digest != digest for spec, (digest,) in zip(specs, rows, strict=False)):
            raise Refused(f"the runs of {campaign} from {first} on differ from those proposed")
        new = proposals[len(rows) :]
        if new:
            try:
                enter_runs(self._db, Submission.of(campaign, specs[len(rows) :], ()))
            except sqlite3.IntegrityError as error:
                raise Refused(f"{campaign} has a run of that scenario and repeat") from error
            self._db.executemany(
                "INSERT INTO proposal (run, body) VALUES (?, ?)",
                ((f"{campaign}.{one.position}", codec.to_json(one)) for one in new),
            )
            reuse_results(self._db, campaign, total)
            self.record_event(now, "campaign", campaign, campaign, "extended")
        return len(new)

    def note_progress(self, progress: SearchProgress, now: float) -> None:
        """Record the progress or the end of a search.

        After its end, the client that ended it may still send the answer.
        """
        campaign = progress.campaign
        before = search_state(self._db, campaign)
        if not before:
            raise Refused(no_search(campaign))
        after = "waiting" if progress.state == "running" else progress.state
        if before not in ("waiting", after):
            raise Refused(f"the search {campaign} is {before}")
        if before == "waiting" and after == "cancelled":
            # Somebody has resumed it before this last message came.
            raise Refused(f"the search {campaign} goes on")
        changed = self._db.execute(
            "UPDATE search SET state = :after, progress = :progress"
            " WHERE campaign = :id AND (state <> :after OR progress <> :progress)",
            {"after": after, "progress": codec.to_json(progress), "id": campaign},
        ).rowcount
        if changed:
            self.record_event(now, "search", campaign, campaign, progress.phase, progress.note)
        if before != after:
            self._close_if_finished(campaign, now)

    def _resume_search(self, campaign: str, now: float) -> None:
        """Resume a cancelled or failed search: queue its cancelled runs.

        Lost runs stay: the search has used them, and must propose the same after any crash.
        """
        self._db.execute("UPDATE search SET state = 'waiting' WHERE campaign = ?", (campaign,))
        rows = self._db.execute(
            "SELECT id FROM run WHERE campaign = ? AND state = 'cancelled'", (campaign,)
        ).fetchall()
        self._queue_again(campaign, rows, now)

    def lease(
        self,
        worker: str,
        count: int,
        now: float,
        *,
        lacks: Sequence[str] = (),
        missing: Callable[[RunSpec], str] = lambda _: "",
    ) -> tuple[Lease, ...]:
        """Lease up to ``count`` queued runs to ``worker``.

        Campaigns of the highest priority take turns, run by run, without paused ones. Within a
        campaign runs go in order of submission, returned ones after all others. Runs of kinds of
        systems under test that the worker ``lacks`` wait for another worker. If ``missing`` returns
        a missing scene or file of a run, in the form of :func:`hold_text`, its whole campaign
        waits.
        """
        leases: list[Lease] = []
        query = _NEXT_RUN.format(able=_ABLE if lacks else "")
        values = {"lacks": json.dumps(lacks)}
        while len(leases) < count:
            row = self._db.execute(query, values).fetchone()
            if row is None:
                break
            run, campaign, trace, leads = row
            spec = read_spec(self._db, run)
            other_engine = f"engine {spec.engine}" if spec.engine != ENGINE_VERSION else ""
            if lacking := other_engine or missing(spec):
                self._hold(campaign, run, lacking, now)
                continue
            token = self._next_token()
            change = self._apply(run, Leased(worker, token), now)
            self._db.execute("UPDATE campaign SET served = ? WHERE id = ?", (token, campaign))
            self._db.execute("UPDATE run SET leased_at = ? WHERE id = ?", (now, run))
            attempt = change.run.attempt
            lease = Lease(run, campaign, attempt, token, trace, spec, bool(leads), self._era)
            leases.append(lease)
        return tuple(leases)

    def _hold(self, campaign: str, run: str, lacking: str, now: float) -> None:
        """Hold a campaign while it lacks something; the reason is noted at a run of it."""
        why = hold_text(lacking)
        self._db.execute("UPDATE campaign SET lacks = ? WHERE id = ?", (lacking, campaign))
        self._db.execute("UPDATE run SET reason = ?, nondeterministic = 0 WHERE id = ?", (why, run))
        self.record_event(now, "campaign", campaign, campaign, "held", why)

    def end_holds(self, is_there: Callable[[str], bool], now: float) -> None:
        """Resume the campaigns whose missing scene or file is there again."""
        for lacking in filter(is_there, read_holds(self._db)):
            campaigns = self._db.execute(
                "UPDATE campaign SET lacks = '' WHERE lacks = ? RETURNING id", (lacking,)
            ).fetchall()
            for (campaign,) in campaigns:
                self._db.execute(
                    "UPDATE run SET reason = ''"
                    " WHERE campaign = ? AND state = 'queued' AND reason = ?",
                    (campaign, hold_text(lacking)),
                )
                self.record_event(now, "campaign", campaign, campaign, "resumed")

    def holds(self) -> tuple[str, ...]:
        """Return the missing inputs of waiting campaigns, in words for people."""
        return tuple(map(hold_text, read_holds(self._db)))

    def begin_era(self) -> str:
        """Begin and return a new era of this ledger, to which its leases belong from now on.

        Missing inputs may have come while no daemon ran: they are checked anew. Campaigns of
        another engine wait for a daemon with that engine.
        """
        self._db.execute("UPDATE campaign SET lacks = '' WHERE lacks <> ''")
        for campaign, lacking in read_other_engines(self._db):
            self._db.execute("UPDATE campaign SET lacks = ? WHERE id = ?", (lacking, campaign))
        self._era = secrets.token_hex(8)
        query = "INSERT INTO era (id, token) SELECT ?, value FROM meta WHERE key = 'token'"
        self._db.execute(query, (self._era,))
        return self._era

    def require_era(self, era: str, token: int = 0) -> None:
        """Raise :class:`daemon.batch.errors.OtherLedger` for a lease of another ledger."""
        require_era(self._db, era, token)

    def _next_token(self) -> int:
        """Return a new, unique token, which distinguishes the holder from earlier ones."""
        row = self._db.execute(
            "UPDATE meta SET value = value + 1 WHERE key = 'token' RETURNING value"
        ).fetchone()
        return int(row[0])

    def renew(self, worker: str, holds: Iterable[LeaseRef], now: float) -> tuple[LeaseRef, ...]:
        """Renew the leases a worker holds and return those whose runs it must stop.

        A lapsed lease becomes valid again while its run waits; if another worker has the run by
        now, both go on. Leases of the worker that it does not present were in an answer it never
        got: their runs are queued again without blame.
        """
        claims = tuple(holds)
        refused = tuple(h for h in claims if not self._renew_lease(worker, h, now))
        tokens = {hold.token for hold in claims}
        running = self._db.execute(
            "SELECT id, token FROM run WHERE state = 'running' AND worker = ?", (worker,)
        ).fetchall()
        for run, token in running:
            if token not in tokens:
                self._apply(run, Released(token, "", blame=False), now)
        return refused

    def _renew_lease(self, worker: str, hold: LeaseRef, now: float) -> bool:
        try:
            require_lease(self._db, hold.run, hold.token)
        except Rejected:
            return False
        change = self._apply(hold.run, Renewed(worker, hold.token), now)
        is_valid = change.answer is LedgerAnswer.DONE
        if is_valid and change.run.token not in (0, hold.token):
            self._contested.add(hold.run)
        return is_valid

    def leases(self) -> tuple[LeaseRef, ...]:
        """Return the leases of running runs."""
        rows = self._db.execute("SELECT id, token FROM run WHERE state = 'running'")
        return tuple(LeaseRef(run, token) for run, token in rows)

    def lapse(self, leases: Iterable[LeaseRef], now: float) -> None:
        """Queue the runs of lapsed leases again, or give them up."""
        for lease in leases:
            self._apply(lease.run, Lapsed(lease.token), now)

    def release(self, release: ReleaseRequest, now: float) -> LedgerAnswer:
        """Take back a run without a result."""
        require_lease(self._db, release.run, release.token)
        reason = release.reason[-_LONGEST_REASON:]
        event = Released(release.token, reason, release.blame, release.died)
        return self._apply(release.run, event, now).answer

    def busy_workers(self) -> frozenset[str]:
        """Return the ids of workers with leases."""
        rows = self._db.execute("SELECT DISTINCT worker FROM run WHERE state = 'running'")
        return frozenset(row[0] for row in rows)

    def check_completion(self, completion: Completion) -> str:
        """Refuse anything but a result of one of our runs; return the run's campaign."""
        run, result = completion.run, completion.result
        require_lease(self._db, run, completion.token)
        digest, campaign = self._db.execute(
            "SELECT digest, campaign FROM run WHERE id = ?", (run,)
        ).fetchone()
        if digest != result.spec:
            words = f"the result is not of run {run}: its specification differs"
            raise Rejected(words, Rejection.OTHER_SPECIFICATION)
        if not is_digest(result.trace.sha256):
            raise Rejected(f"the trace of {run} has no digest", Rejection.DAMAGED)
        size = len(codec.to_json(result))
        if size > LARGEST_RESULT:
            words = f"the result of {run} has {size} bytes: the limit is {LARGEST_RESULT}"
            raise Rejected(words, Rejection.TOO_LARGE)
        return str(campaign)

    def awaits_result(self, run: str, token: int) -> bool:
        """Return whether a result under that lease would be recorded as the run's first."""
        state = self._execution_state(run)
        return advance(state, Completed(token, "new"), attempts=1).record

    def complete(self, completion: Completion, now: float) -> LedgerAnswer:
        """Record a result, exactly one per run, under any of its leases and however late."""
        campaign = self.check_completion(completion)
        digest = completion.result.digest
        stopped = completion.result.stopped
        comparable = not (stopped or has_stopped_result(self._db, completion.run))
        event = Completed(completion.token, digest, completion.worker, comparable=comparable)
        before = self._execution_state(completion.run)
        # Store the last result of a campaign before the results decide about its reserve.
        if advance(before, event, attempts=self._attempts).record:
            store_result(self._db, completion, digest, now)
        change = self._apply(completion.run, event, now)
        if change.run.state is RunState.DONE:
            self._stop_others(completion, before, campaign, now)
        if change.record and change.run.repeatable and not stopped:
            self._check_determinism(completion, digest, campaign, now)
        if change.answer is LedgerAnswer.DIFFERS:
            reason = change.run.reason
            self._doubt(completion.run)
            self.record_event(now, "alarm", completion.run, campaign, NONDETERMINISTIC, reason)
        return change.answer

    def _stop_others(
        self, completion: Completion, before: ExecutionState, campaign: str, now: float
    ) -> None:
        """Publish that other executions of a run may stop; they also learn it by renewing."""
        run, contested = completion.run, completion.run in self._contested
        self._contested.discard(run)
        if contested or before.token not in (0, completion.token):
            note = f"attempt {completion.attempt} was first"
            self.record_event(now, "lease", run, campaign, "superseded", note)

    def _check_determinism(
        self, completion: Completion, digest: str, campaign: str, now: float
    ) -> None:
        """Raise an alarm if another run of the same specification has another result.

        Runs that the wall clock ended do not count.
        """
        others = self._db.execute(
            "SELECT id, result FROM run WHERE digest = ? AND result <> '' AND result <> ?"
            " ORDER BY serial DESC",
            (completion.result.spec, digest),
        )
        other = next(
            (other for other in others if not has_stopped_result(self._db, other[0])), None
        )
        if other is None:
            return
        run = completion.run
        reason = f"{NONDETERMINISTIC}: it gave {digest[:12]}, {other[0]} gave {other[1][:12]}"
        self._db.execute(
            "UPDATE run SET reason = ?, nondeterministic = 1 WHERE id = ?", (reason, run)
        )
        self._doubt(run, other[0])
        self.record_event(now, "alarm", run, campaign, NONDETERMINISTIC, reason)

    def _doubt(self, *runs: str) -> None:
        """Prevent the reuse of results of these runs' specification: they differ."""
        self._db.executemany("UPDATE run SET doubted = 1 WHERE id = ?", ((run,) for run in runs))

    def _execution_state(self, run: str) -> ExecutionState:
        row = self._db.execute(_READ_STATE, (run,)).fetchone()
        if row is None:
            raise Refused(f"there is no run {run}")
        return ExecutionState(RunState(row[0]), *row[1:])

    def _apply(self, run: str, event: RunEvent, now: float) -> RunTransition:
        """Apply an event to a run, and record it."""
        before = self._execution_state(run)
        change = advance(before, event, attempts=self._attempts)
        after = change.run
        if after != before:
            values = (getattr(after, name) for name in _FIELDS)
            self._db.execute(_WRITE_STATE, (*values, run))
        if after.state is not before.state:
            query = "SELECT campaign FROM run WHERE id = ?"
            (campaign,) = self._db.execute(query, (run,)).fetchone()
            # The end of the attempt before has already recorded this reason.
            stale = after.state is RunState.RUNNING and after.reason == before.reason
            note = "" if stale else after.reason
            self.record_event(now, "run", run, campaign, after.state, note)
            if after.state not in (RunState.QUEUED, RunState.RUNNING):
                self._close_if_finished(campaign, now)
        return change

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
        " WHERE run.cached <> '' AND source.campaign = :id AND run.campaign <> :id"
        " ORDER BY run.serial",
        {"id": campaign},
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
