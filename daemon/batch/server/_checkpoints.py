"""When the ledger's write-ahead log goes into the database: in every pause, and now and then."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import LedgerWriter

_PAUSE: Final = 0.4
"""Seconds without a change after which what was acknowledged goes into the database."""
_LONGEST: Final = 5.0
"""Seconds after a change when it does so all the same, between two batches of jobs."""
_AGAIN: Final = 0.4
"""Seconds until the next try while somebody reads an older state, or the disk is full."""


class IdleCheckpoints:
    """Empties the WAL of a ledger soon after its last change; used by the writer's thread.

    A single wrong bit in a WAL makes SQLite drop all that stands behind it.
    """

    def __init__(self, ledger: LedgerWriter, report: Callable[[str], None]) -> None:
        self._ledger = ledger
        self._report = report
        self._problem = ""
        self._changes = -1
        # What a daemon that was killed has left in the WAL goes first of all.
        self._since: float | None = time.monotonic()
        self._due = time.monotonic()

    @property
    def patience(self) -> float | None:
        """Seconds to wait for a job until :meth:`act` is due, ``None`` when nothing is to do."""
        return None if self._since is None else max(0.0, self._due - time.monotonic())

    def note_changes(self) -> None:
        """Look whether the ledger was changed; acts when there was no pause for long."""
        now, changes = time.monotonic(), self._ledger.changes
        if changes != self._changes:
            self._changes = changes
            self._due = now + _PAUSE
            self._since = now if self._since is None else self._since
        if self._since is not None and now - self._since > _LONGEST:
            self.act()

    def act(self) -> None:
        """Bring all there is into the database, as far as readers let us."""
        now, problem = time.monotonic(), ""
        try:
            done = self._ledger.checkpoint()
        except DaemonError as error:
            done, problem = False, str(error)
        if problem != self._problem:
            self._problem = problem
            self._report(problem)
        self._since = None if done else now
        self._due = now + _AGAIN
