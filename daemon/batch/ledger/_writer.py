"""Writing the ledger: what people and workers may do with campaigns and runs.

A :class:`LedgerWriter` is used by one thread, inside transactions its owner opens and commits. Every change of a run goes through the pure transition function. Events to publish after the commit collect in :attr:`LedgerWriter.events`.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Sequence
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger._records import SpecReader
from daemon.batch.ledger._results import (
    check_result,
    insert_runs,
    queue_reserve,
    read_trace_location,
    reuse_results,
    store_reserve,
    store_result,
)
from daemon.batch.ledger._transitions import (
    Cancelled,
    Completed,
    ExecutionState,
    Leased,
    Released,
    Renewed,
    Retried,
    RunEvent,
    RunTransition,
    advance,
)
from daemon.model.messages import (
    Completion,
    Lease,
    LeaseRef,
    LedgerAnswer,
    ReleaseRequest,
    RetryRequest,
)
from daemon.model.packed_submission import Fingerprint, fingerprint
from daemon.model.status import ChangeEvent, RunState, Submission, SubmissionReceipt
from daemon.model.verdicts import Outcome
from grammars.text import codec

_RECORD: Final = "state, attempt, strikes, worker, token, lease_until, result, reason"
_KEPT_EVENTS: Final = 10_000


class RunUpdates:
    """Changes of runs on one connection, what follows for their campaigns, and what to tell.

    A run is lost after ``attempts`` leases that ended badly. What must be told to others after
    the commit collects in :attr:`events`.
    """

    def __init__(self, connection: sqlite3.Connection, attempts: int) -> None:
        self._db = connection
        self._attempts = attempts
        self.events: list[ChangeEvent] = []

    def _execution_state(self, run: str) -> ExecutionState | None:
        row = self._db.execute(f"SELECT {_RECORD} FROM run WHERE id = ?", (run,)).fetchone()
        return None if row is None else ExecutionState(RunState(row[0]), *row[1:])

    def _apply(
        self,
        run: str,
        event: RunEvent,
        now: float,
        before: ExecutionState | None = None,
        *,
        quiet: bool = False,
    ) -> RunTransition:
        before = before or self._execution_state(run)
        if before is None:
            raise Refused(f"there is no run {run}")
        change = advance(before, event, attempts=self._attempts)
        after = change.run
        if after != before:
            self._db.execute(
                "UPDATE run SET state = ?, attempt = ?, strikes = ?, worker = ?, token = ?,"
                " lease_until = ?, result = ?, reason = ? WHERE id = ?",
                (
                    after.state,
                    after.attempt,
                    after.strikes,
                    after.worker,
                    after.token,
                    after.lease_until,
                    after.result,
                    after.reason,
                    run,
                ),
            )
        if after.state is not before.state and not quiet:
            campaign = self._db.execute("SELECT campaign FROM run WHERE id = ?", (run,)).fetchone()
            self.record_event(now, "run", run, campaign[0], after.state, after.reason)
            if after.state not in (RunState.QUEUED, RunState.RUNNING):
                self._close_if_finished(campaign[0], now)
        return change

    def _close_if_finished(self, campaign: str, now: float) -> None:
        """Close a campaign of which nothing waits, unless cells need the repeats in reserve."""
        while not self._has_unfinished_runs(campaign):
            if not queue_reserve(self._db, campaign):
                self._close(campaign, now)
                return
            reuse_results(self._db, campaign)
            self.record_event(now, "campaign", campaign, campaign, "extended")

    def _close(self, campaign: str, now: float) -> None:
        self._db.execute("UPDATE campaign SET finished_at = ? WHERE id = ?", (now, campaign))
        self.record_event(now, "campaign", campaign, campaign, "finished")

    def _has_unfinished_runs(self, campaign: str) -> bool:
        found = self._db.execute(
            "SELECT total(runs) FROM tally WHERE campaign = ? AND state IN ('queued', 'running')",
            (campaign,),
        ).fetchone()
        return bool(found[0])

    def record_event(
        self, now: float, kind: str, name: str, campaign: str = "", state: str = "", note: str = ""
    ) -> None:
        """Write an event down and keep it for telling others after the commit."""
        cursor = self._db.execute(
            "INSERT INTO event (at, kind, id, campaign, state, note) VALUES (?, ?, ?, ?, ?, ?)",
            (now, kind, name, campaign, state, note),
        )
        seq = cursor.lastrowid or 0
        if seq % 1000 == 0:
            self._db.execute(
                "DELETE FROM event WHERE seq <= ? AND kind <> 'alarm'", (seq - _KEPT_EVENTS,)
            )
        self.events.append(ChangeEvent(seq, kind, name, campaign, state))


_NEXT_RUN: Final = (
    "SELECT run.id, run.campaign, trace_name, spec.body FROM run JOIN spec ON spec.run = run.id"
    " WHERE state = 'queued'{able} AND run.campaign = (SELECT id FROM campaign AS c"
    " WHERE finished_at IS NULL AND paused = 0 AND EXISTS"
    " (SELECT 1 FROM run WHERE run.campaign = c.id AND state = 'queued'{able})"
    " ORDER BY priority DESC, served, serial LIMIT 1) ORDER BY run.serial LIMIT 1"
)
_ABLE: Final = " AND kind NOT IN (SELECT value FROM json_each(?1))"
_LONGEST_REASON: Final = 4000


class LedgerWriter(RunUpdates):
    """The write side of the ledger on one connection.

    A run is lost after ``attempts`` leases that ended badly; a lease lasts ``lease`` seconds.
    Times given to the methods are wall clock seconds since the epoch.
    """

    def __init__(
        self, connection: sqlite3.Connection, *, attempts: int = 3, lease: float = 30.0
    ) -> None:
        super().__init__(connection, attempts)
        self._lease = lease
        self._specs = SpecReader(connection)

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

    def lease(
        self, worker: str, count: int, now: float, *, store: str = "", lacks: Sequence[str] = ()
    ) -> tuple[Lease, ...]:
        """Give up to ``count`` queued runs to ``worker``, whose traces belong into ``store``.

        Campaigns of the highest priority take turns, run by run; paused ones are passed over.
        Within a campaign the first submitted run goes first. Runs of systems under test whose
        kind the worker ``lacks`` wait for another one.
        """
        grants: list[Lease] = []
        query = _NEXT_RUN.format(able=_ABLE if lacks else "")
        while len(grants) < count:
            row = self._db.execute(query, (json.dumps(lacks),) if lacks else ()).fetchone()
            if row is None:
                break
            run, campaign, trace, body = row
            token = self._next_token()
            change = self._apply(run, Leased(worker, token, now + self._lease), now)
            self._db.execute("UPDATE campaign SET served = ? WHERE id = ?", (token, campaign))
            self._db.execute("UPDATE run SET granted = ? WHERE id = ?", (token, run))
            spec = self._specs.read(body)
            grants.append(Lease(run, campaign, change.run.attempt, token, trace, spec, store))
        return tuple(grants)

    def add_store(self, url: str) -> None:
        """Remember a store: completions may say that a trace lies there, also much later."""
        self._db.execute("INSERT OR IGNORE INTO store VALUES (?)", (url,))

    def awaits_result(self, run: str) -> bool:
        """Whether a result of the run would be recorded now, its first."""
        record = self._execution_state(run)
        return record is not None and not record.result and record.state is not RunState.CANCELLED

    def trace_location(self, run: str) -> tuple[str, str]:
        """Return the name of a run's trace and its URL, empty when it has none."""
        return read_trace_location(self._db, run)

    def set_trace_location(self, run: str, location: str) -> None:
        """Record that the trace of a run lies at a URL now, empty for the state directory."""
        self._db.execute("UPDATE run SET trace_at = ? WHERE id = ?", (location, run))

    def _next_token(self) -> int:
        row = self._db.execute(
            "UPDATE meta SET value = value + 1 WHERE key = 'token' RETURNING value"
        ).fetchone()
        return int(row[0])

    def renew(self, worker: str, holds: Iterable[LeaseRef], now: float) -> tuple[LeaseRef, ...]:
        """Extend the leases a worker holds and return those that are not its own any more.

        Runs leased to the worker that it does not claim were granted in an answer it never got:
        they are queued again without blame.
        """
        claimed = tuple(holds)
        gone = tuple(h for h in claimed if not self._renew_lease(h, now))
        tokens = {hold.token for hold in claimed}
        for run, token in self._leases_of(worker):
            if token not in tokens:
                self._apply(run, Released(token, "", blame=False), now)
        return gone

    def _renew_lease(self, hold: LeaseRef, now: float) -> bool:
        record = self._execution_state(hold.run)
        if record is None:
            return False
        change = self._apply(hold.run, Renewed(hold.token, now + self._lease), now, record)
        return change.answer is LedgerAnswer.DONE

    def check_completion(self, completion: Completion) -> str:
        """Refuse what is no result of a run of ours; returns the run's campaign."""
        return check_result(self._db, completion)

    def complete(self, completion: Completion, now: float) -> LedgerAnswer:
        """Record a result, exactly one per run, whoever brings it and however late."""
        campaign = self.check_completion(completion)
        digest = completion.result.digest
        event, before = Completed(completion.token, digest), self._execution_state(completion.run)
        # The last result of a campaign must be there before it is asked what the results decide.
        if before is not None and advance(before, event, attempts=self._attempts).record:
            store_result(self._db, completion, digest, now)
        change = self._apply(completion.run, event, now, before)
        if change.record:
            self._check_determinism(completion.run, completion.result.spec, digest, now)
        if change.answer is LedgerAnswer.DIFFERS:
            note = change.run.reason
            self.record_event(now, "alarm", completion.run, campaign, "nondeterministic", note)
        return change.answer

    def _check_determinism(self, run: str, spec: str, digest: str, now: float) -> None:
        """Raise an alarm when another run of the same specification came out differently."""
        other = self._db.execute(
            "SELECT id, result FROM run WHERE digest = ? AND result <> '' AND result <> ?"
            " ORDER BY serial DESC LIMIT 1",
            (spec, digest),
        ).fetchone()
        if other is None:
            return
        reason = f"nondeterministic: this gave {digest[:12]}, {other[0]} gave {other[1][:12]}"
        self._db.execute("UPDATE run SET reason = ? WHERE id = ?", (reason, run))
        campaign = self._db.execute("SELECT campaign FROM run WHERE id = ?", (run,)).fetchone()[0]
        self.record_event(now, "alarm", run, campaign, "nondeterministic", reason)

    def release(self, release: ReleaseRequest, now: float) -> LedgerAnswer:
        """Take a run back without a result."""
        if self._execution_state(release.run) is None:
            raise Refused(f"there is no run {release.run}")
        event = Released(release.token, release.reason[-_LONGEST_REASON:], release.blame)
        return self._apply(release.run, event, now).answer

    def expire_leases(self, now: float) -> int:
        """Take back every run whose lease is over; returns how many."""
        rows = self._db.execute(
            "SELECT id, token FROM run WHERE state = 'running' AND lease_until < ?", (now,)
        ).fetchall()
        for run, token in rows:
            self._apply(run, Released(token, "the worker fell silent", blame=True), now)
        return len(rows)

    def release_worker(self, worker: str, now: float) -> int:
        """Take back every run of a worker that is gone; returns how many."""
        leases = self._leases_of(worker)
        for run, token in leases:
            self._apply(run, Released(token, "the worker is gone", blame=True), now)
        return len(leases)

    def _leases_of(self, worker: str) -> list[tuple[str, int]]:
        return self._db.execute(
            "SELECT id, token FROM run WHERE state = 'running' AND worker = ?", (worker,)
        ).fetchall()

    def extend_leases(self, now: float) -> int:
        """Let all leases last one period, for a daemon that starts: it was away, not they.

        Returns how many there are.
        """
        # Not the later of both: the clock may have been set back while no daemon ran.
        return self._db.execute(
            "UPDATE run SET lease_until = ? WHERE state = 'running'", (now + self._lease,)
        ).rowcount

    def shift_leases(self, seconds: float) -> None:
        """Move all leases along with a clock that was set: they last as long as before."""
        self._db.execute(
            "UPDATE run SET lease_until = lease_until + ? WHERE state = 'running'", (seconds,)
        )

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
        """Queue runs again by state (lost, cancelled), by outcome, or ``all`` that rest."""
        self._require_campaign(request.campaign)
        words = _retry_words(request.only)
        rows = self._db.execute(
            "SELECT id, state, outcome FROM run WHERE campaign = ?"
            " AND state IN ('done', 'lost', 'cancelled') ORDER BY serial",
            (request.campaign,),
        ).fetchall()
        chosen = [run for run, state, outcome in rows if {state, outcome} & words or "all" in words]
        for run in chosen:
            self._apply(run, Retried(), now, quiet=True)
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
