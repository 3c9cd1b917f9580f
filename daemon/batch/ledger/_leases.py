"""Changes of runs in the ledger: how a transition is written, and the leases of workers."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger._results import (
    SpecReader,
    check_result,
    queue_reserve,
    read_trace_location,
    reuse_results,
    store_result,
)
from daemon.batch.ledger.transitions import (
    Completed,
    ExecutionState,
    Leased,
    Released,
    Renewed,
    RunEvent,
    RunTransition,
    advance,
)
from daemon.model.messages import Completion, Lease, LeaseRef, LedgerAnswer, ReleaseRequest
from daemon.model.status import NONDETERMINISTIC, ChangeEvent, RunState

_FIELDS: Final = tuple(field.name for field in fields(ExecutionState))
"""Also names of columns of the table ``run``."""
_READ_STATE: Final = f"SELECT {', '.join(_FIELDS)} FROM run WHERE id = ?"
_WRITE_STATE: Final = f"UPDATE run SET {' = ?, '.join(_FIELDS)} = ? WHERE id = ?"
_KEPT_EVENTS: Final = 10_000
_PRUNED_EVERY: Final = 1000


class RunUpdates:
    """Changes of runs on one connection; each goes through the pure transition function.

    A run is lost after ``attempts`` leases that ended badly. What must be told to others after
    the commit collects in :attr:`events`.
    """

    def __init__(self, connection: sqlite3.Connection, attempts: int) -> None:
        self._db = connection
        self._attempts = attempts
        self.events: list[ChangeEvent] = []

    def _execution_state(self, run: str) -> ExecutionState | None:
        row = self._db.execute(_READ_STATE, (run,)).fetchone()
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
        """Let an event happen to a run; ``quiet`` leaves telling and closing to the caller.

        Whoever changes all runs of a campaign is quiet: one event says it, not 100,000.
        """
        before = before or self._execution_state(run)
        if before is None:
            raise Refused(f"there is no run {run}")
        change = advance(before, event, attempts=self._attempts)
        after = change.run
        if after != before:
            values = (getattr(after, name) for name in _FIELDS)
            self._db.execute(_WRITE_STATE, (*values, run))
        if after.state is not before.state and not quiet:
            campaign = self._campaign_of(run)
            self.record_event(now, "run", run, campaign, after.state, after.reason)
            if after.state not in (RunState.QUEUED, RunState.RUNNING):
                self._close_if_finished(campaign, now)
        return change

    def _campaign_of(self, run: str) -> str:
        row = self._db.execute("SELECT campaign FROM run WHERE id = ?", (run,)).fetchone()
        return str(row[0])

    def _close_if_finished(self, campaign: str, now: float) -> None:
        """Close a campaign of which nothing waits, unless cells need the repeats in reserve."""
        # Again and again: the results of new repeats may be in the ledger already, and then the
        # next look at the cells is due at once.
        while not self._unfinished_runs(campaign):
            if not queue_reserve(self._db, campaign):
                self._close(campaign, now)
                return
            reuse_results(self._db, campaign)
            self.record_event(now, "campaign", campaign, campaign, "extended")

    def _close(self, campaign: str, now: float) -> None:
        self._db.execute("UPDATE campaign SET finished_at = ? WHERE id = ?", (now, campaign))
        self.record_event(now, "campaign", campaign, campaign, "finished")

    def _unfinished_runs(self, campaign: str) -> int:
        found = self._db.execute(
            "SELECT total(runs) FROM tally WHERE campaign = ? AND state IN ('queued', 'running')",
            (campaign,),
        ).fetchone()
        return int(found[0])

    def record_event(
        self, now: float, kind: str, name: str, campaign: str = "", state: str = "", note: str = ""
    ) -> None:
        """Write an event down and keep it for telling others after the commit."""
        cursor = self._db.execute(
            "INSERT INTO event (at, kind, id, campaign, state, note) VALUES (?, ?, ?, ?, ?, ?)",
            (now, kind, name, campaign, state, note),
        )
        seq = cursor.lastrowid or 0
        if seq % _PRUNED_EVERY == 0:
            # Alarms stay for good: the doctor counts them however long ago they were.
            self._db.execute(
                "DELETE FROM event WHERE seq <= ? AND kind <> 'alarm'", (seq - _KEPT_EVENTS,)
            )
        self.events.append(ChangeEvent(seq, kind, name, campaign, state))


# The first run of the campaign whose turn it is. ``served`` is the token of a campaign's latest
# lease and tokens only grow: who was served longest ago goes first, which is round robin without
# a list of turns. A worker that lacks systems under test must not get stuck at a campaign that has
# nothing else for it: what it is able to run is asked for in both places.
_NEXT_RUN: Final = (
    "SELECT run.id, run.campaign, trace_name, spec.body FROM run JOIN spec ON spec.run = run.id"
    " WHERE state = 'queued'{able} AND run.campaign = (SELECT id FROM campaign AS c"
    " WHERE finished_at IS NULL AND paused = 0 AND EXISTS"
    " (SELECT 1 FROM run WHERE run.campaign = c.id AND state = 'queued'{able})"
    " ORDER BY priority DESC, served, serial LIMIT 1) ORDER BY run.serial LIMIT 1"
)
_ABLE: Final = " AND kind NOT IN (SELECT value FROM json_each(?1))"
_LONGEST_REASON: Final = 4000


class LeaseUpdates(RunUpdates):
    """What workers may do with runs; a lease lasts ``lease`` seconds."""

    def __init__(
        self, connection: sqlite3.Connection, *, attempts: int = 3, lease: float = 30.0
    ) -> None:
        super().__init__(connection, attempts)
        self._lease = lease
        self._specs = SpecReader(connection)

    def lease(
        self,
        worker: str,
        count: int,
        now: float,
        *,
        store: str = "",
        lacks: Sequence[str] = (),
        holder: str = "",
    ) -> tuple[Lease, ...]:
        """Give up to ``count`` queued runs to ``worker``, whose traces belong into ``store``.

        Campaigns of the highest priority take turns, run by run; paused ones are passed over.
        Within a campaign the first submitted run goes first. Runs of systems under test whose
        kind the worker ``lacks`` wait for another one.
        """
        leases: list[Lease] = []
        query = _NEXT_RUN.format(able=_ABLE if lacks else "")
        while len(leases) < count:
            row = self._db.execute(query, (json.dumps(lacks),) if lacks else ()).fetchone()
            if row is None:
                break
            run, campaign, trace, body = row
            token = self._next_token()
            change = self._apply(run, Leased(worker, token, now + self._lease), now)
            self._db.execute("UPDATE campaign SET served = ? WHERE id = ?", (token, campaign))
            self._db.execute("UPDATE run SET granted = ? WHERE id = ?", (token, run))
            attempt, spec = change.run.attempt, self._specs.read(body)
            self._db.execute(
                "INSERT INTO lease VALUES (?, ?, ?, ?, ?, ?)",
                (token, run, attempt, worker, holder, now),
            )
            leases.append(Lease(run, campaign, attempt, token, trace, spec, store))
        return tuple(leases)

    def _next_token(self) -> int:
        """Return a token no lease ever had: who comes with an old one is told from the holder."""
        row = self._db.execute(
            "UPDATE meta SET value = value + 1 WHERE key = 'token' RETURNING value"
        ).fetchone()
        return int(row[0])

    def renew(
        self, worker: str, holds: Iterable[LeaseRef], now: float, *, holder: str = ""
    ) -> tuple[LeaseRef, ...]:
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
        state = self._execution_state(hold.run)
        if state is None:
            return False
        change = self._apply(hold.run, Renewed(hold.token, now + self._lease), now, state)
        return change.answer is LedgerAnswer.DONE

    def _leases_of(self, worker: str) -> list[tuple[str, int]]:
        return self._db.execute(
            "SELECT id, token FROM run WHERE state = 'running' AND worker = ?", (worker,)
        ).fetchall()

    def check_completion(self, completion: Completion) -> str:
        """Refuse what is no result of a run of ours; returns the run's campaign."""
        return check_result(self._db, completion)

    def complete(self, completion: Completion, now: float, *, holder: str = "") -> LedgerAnswer:
        """Record a result, exactly one per run, whoever brings it and however late."""
        campaign = self.check_completion(completion)
        digest = completion.result.digest
        event, before = Completed(completion.token, digest), self._execution_state(completion.run)
        # The last result of a campaign must be there before it is asked what the results decide.
        if before is not None and advance(before, event, attempts=self._attempts).record:
            store_result(self._db, completion, digest, now, holder)
        change = self._apply(completion.run, event, now, before)
        if change.record and change.run.repeatable:
            self._check_determinism(completion, digest, campaign, now)
        if change.answer is LedgerAnswer.DIFFERS:
            reason = change.run.reason
            self._doubt(completion.run)
            self.record_event(now, "alarm", completion.run, campaign, NONDETERMINISTIC, reason)
        return change.answer

    def _check_determinism(
        self, completion: Completion, digest: str, campaign: str, now: float
    ) -> None:
        """Raise an alarm when another run of the same specification came out differently."""
        other = self._db.execute(
            "SELECT id, result FROM run WHERE digest = ? AND result <> '' AND result <> ?"
            " ORDER BY serial DESC LIMIT 1",
            (completion.result.spec, digest),
        ).fetchone()
        if other is None:
            return
        run = completion.run
        reason = f"{NONDETERMINISTIC}: this gave {digest[:12]}, {other[0]} gave {other[1][:12]}"
        self._db.execute("UPDATE run SET reason = ? WHERE id = ?", (reason, run))
        self._doubt(run, other[0])
        self.record_event(now, "alarm", run, campaign, NONDETERMINISTIC, reason)

    def _doubt(self, *runs: str) -> None:
        """Let no result of these runs' specification be used again: it came out differently."""
        self._db.executemany("UPDATE run SET doubted = 1 WHERE id = ?", ((run,) for run in runs))

    def awaits_result(self, run: str) -> bool:
        """Whether a result of the run would be recorded now, its first."""
        state = self._execution_state(run)
        return state is not None and not state.result and state.state is not RunState.CANCELLED

    def add_store(self, url: str) -> None:
        """Remember a store: completions may say that a trace lies there, also much later."""
        self._db.execute("INSERT OR IGNORE INTO store VALUES (?)", (url,))

    def trace_location(self, run: str) -> tuple[str, str]:
        """Return the name of a run's trace and its URL, empty when it has none."""
        return read_trace_location(self._db, run)

    def set_trace_location(self, run: str, location: str) -> None:
        """Record that the trace of a run lies at a URL now, empty for the state directory."""
        self._db.execute("UPDATE run SET trace_at = ? WHERE id = ?", (location, run))

    def release(self, release: ReleaseRequest, now: float, *, holder: str = "") -> LedgerAnswer:
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
