"""Changing runs in the ledger: every change goes through the pure transition function."""

from __future__ import annotations

import sqlite3
from typing import Final

from daemon.errors import Refused
from daemon.ledger._reuse import call_reserve, use_results
from daemon.ledger._transition import Change, Happening, Record, advance
from daemon.protocol import Event, RunState

_RECORD: Final = "state, attempt, strikes, worker, token, lease_until, result, reason"
_KEPT_EVENTS: Final = 10_000


class Changes:
    """Changes of runs on one connection, what follows for their campaigns, and what to tell.

    A run is lost after ``attempts`` leases that ended badly. What must be told to others after
    the commit collects in :attr:`events`.
    """

    def __init__(self, connection: sqlite3.Connection, attempts: int) -> None:
        self._db = connection
        self._attempts = attempts
        self.events: list[Event] = []

    def _record(self, run: str) -> Record | None:
        row = self._db.execute(f"SELECT {_RECORD} FROM run WHERE id = ?", (run,)).fetchone()
        return None if row is None else Record(RunState(row[0]), *row[1:])

    def _apply(
        self,
        run: str,
        event: Happening,
        now: float,
        before: Record | None = None,
        *,
        quiet: bool = False,
    ) -> Change:
        before = before or self._record(run)
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
            self.note(now, "run", run, campaign[0], after.state, after.reason)
            if after.state not in (RunState.QUEUED, RunState.RUNNING):
                self._close_if_finished(campaign[0], now)
        return change

    def _close_if_finished(self, campaign: str, now: float) -> None:
        """Close a campaign of which nothing waits, unless cells need the repeats in reserve."""
        while not self._waiting(campaign):
            if not call_reserve(self._db, campaign):
                self._close(campaign, now)
                return
            use_results(self._db, campaign)
            self.note(now, "campaign", campaign, campaign, "extended")

    def _close(self, campaign: str, now: float) -> None:
        self._db.execute("UPDATE campaign SET finished_at = ? WHERE id = ?", (now, campaign))
        self.note(now, "campaign", campaign, campaign, "finished")

    def _waiting(self, campaign: str) -> bool:
        found = self._db.execute(
            "SELECT total(runs) FROM tally WHERE campaign = ? AND state IN ('queued', 'running')",
            (campaign,),
        ).fetchone()
        return bool(found[0])

    def note(
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
        self.events.append(Event(seq, kind, name, campaign, state))
