"""Leases of runs: workers take them, renew them, bring results, give them back or fall silent."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Sequence
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger._records import SpecReader
from daemon.batch.ledger._results import check_result, read_trace_location, store_result
from daemon.batch.ledger._updates import RunUpdates
from daemon.batch.ledger.transitions import Completed, Leased, Released, Renewed, advance
from daemon.model.messages import Completion, Lease, LeaseRef, LedgerAnswer, ReleaseRequest
from daemon.model.status import NONDETERMINISTIC, RunState

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

    def __init__(self, connection: sqlite3.Connection, attempts: int, lease: float) -> None:
        super().__init__(connection, attempts)
        self._lease = lease
        self._specs = SpecReader(connection)

    def lease(
        self, worker: str, count: int, now: float, *, store: str = "", lacks: Sequence[str] = ()
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
            spec = self._specs.read(body)
            leases.append(Lease(run, campaign, change.run.attempt, token, trace, spec, store))
        return tuple(leases)

    def _next_token(self) -> int:
        """Return a token no lease ever had: who comes with an old one is told from the holder."""
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
            self._check_determinism(completion, digest, campaign, now)
        if change.answer is LedgerAnswer.DIFFERS:
            reason = change.run.reason
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
        self.record_event(now, "alarm", run, campaign, NONDETERMINISTIC, reason)

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
