"""Changes of runs, one at a time, what follows for their campaigns, and the events to publish."""

from __future__ import annotations

import sqlite3
from dataclasses import fields
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger._results import queue_reserve, reuse_results
from daemon.batch.ledger.transitions import ExecutionState, RunEvent, RunTransition, advance
from daemon.model.status import ChangeEvent, RunState

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
