"""Changes of runs in the ledger: transitions, and the leases of workers."""

from __future__ import annotations

import json
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from typing import Final

from daemon.batch.errors import Refused, Rejected
from daemon.batch.ledger._entry import read_spec
from daemon.batch.ledger._results import (
    has_stopped_result,
    hold_text,
    queue_reserve,
    read_holds,
    read_other_engines,
    require_era,
    require_lease,
    reuse_results,
    store_result,
)
from daemon.batch.ledger._searches import search_state
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
from daemon.model.ids import is_digest
from daemon.model.messages import (
    Completion,
    Lease,
    LeaseRef,
    LedgerAnswer,
    Rejection,
    ReleaseRequest,
)
from daemon.model.run_state import RunState
from daemon.model.spec import ENGINE_VERSION, LARGEST_RESULT, RunSpec
from daemon.model.status import NONDETERMINISTIC, ChangeEvent
from grammars.text import codec

_FIELDS: Final = tuple(field.name for field in fields(ExecutionState))
"""Fields of a state, which are also columns of the table ``run``."""
_READ_STATE: Final = f"SELECT {', '.join(_FIELDS)} FROM run WHERE id = ?"
_WRITE_STATE: Final = f"UPDATE run SET {' = ?, '.join(_FIELDS)} = ? WHERE id = ?"
# The effect of ``transitions.advance`` on a retried run, for up to 200,000 at once.
RETRY: Final = (
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
_ABLE: Final = " AND kind NOT IN (SELECT value FROM json_each(?1))"
_LONGEST_REASON: Final = 4000


class RunUpdates:
    """Changes of runs on one connection; each goes through the pure transition function.

    A run is lost after ``attempts`` leases that ended badly. The ledger stores the holders of
    leases, the daemon's memory their deadlines. Any worker may present a lease: the next worker of
    a machine takes over the runs of a dead one. :attr:`events` collects the events to publish after
    the commit.
    """

    def __init__(self, connection: sqlite3.Connection, *, attempts: int = 3) -> None:
        self._db = connection
        self._attempts = attempts
        self._era = ""
        # Runs executed by two workers, as far as renewals show; only used for hints.
        self._contested: set[str] = set()
        self.events: list[ChangeEvent] = []

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

    def _is_known(self, campaign: str) -> bool:
        query = "SELECT 1 FROM campaign WHERE id = ?"
        return self._db.execute(query, (campaign,)).fetchone() is not None

    def _require_campaign(self, campaign: str) -> None:
        if not self._is_known(campaign):
            raise Refused(f"there is no campaign {campaign}")

    def _total(self, campaign: str) -> int:
        row = self._db.execute("SELECT total FROM campaign WHERE id = ?", (campaign,)).fetchone()
        return int(row[0])

    def _count_runs(self, campaign: str, *states: RunState) -> int:
        query = "SELECT state, runs FROM tally WHERE campaign = ?"
        return sum(runs for state, runs in self._db.execute(query, (campaign,)) if state in states)

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
        values = (json.dumps(lacks),) if lacks else ()
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

    def holds(self) -> tuple[str, ...]:
        """Return the missing inputs of waiting campaigns, in words for people."""
        return tuple(map(hold_text, read_holds(self._db)))

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

    def awaits_result(self, run: str, token: int) -> bool:
        """Return whether a result under that lease would be recorded as the run's first."""
        state = self._execution_state(run)
        return advance(state, Completed(token, "new"), attempts=1).record

    def release(self, release: ReleaseRequest, now: float) -> LedgerAnswer:
        """Take back a run without a result."""
        require_lease(self._db, release.run, release.token)
        reason = release.reason[-_LONGEST_REASON:]
        event = Released(release.token, reason, release.blame, release.died)
        return self._apply(release.run, event, now).answer

    def leases(self) -> tuple[LeaseRef, ...]:
        """Return the leases of running runs."""
        rows = self._db.execute("SELECT id, token FROM run WHERE state = 'running'")
        return tuple(LeaseRef(run, token) for run, token in rows)

    def lapse(self, leases: Iterable[LeaseRef], now: float) -> None:
        """Queue the runs of lapsed leases again, or give them up."""
        for lease in leases:
            self._apply(lease.run, Lapsed(lease.token), now)

    def busy_workers(self) -> frozenset[str]:
        """Return the ids of workers with leases."""
        rows = self._db.execute("SELECT DISTINCT worker FROM run WHERE state = 'running'")
        return frozenset(row[0] for row in rows)
