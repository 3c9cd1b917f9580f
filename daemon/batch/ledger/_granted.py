"""Leases that were granted: of which run each is, to whom, and under whose name it may be used."""

from __future__ import annotations

import sqlite3
from typing import Final

from daemon.batch.errors import Refused

_FIND: Final = (
    "SELECT lease.token, holder FROM run"
    " LEFT JOIN lease ON lease.run = run.id AND lease.token = ?2 WHERE id = ?1"
)


def record_lease(
    db: sqlite3.Connection, token: int, run: str, attempt: int, worker: str, holder: str, now: float
) -> None:
    """Write a lease down: granted at ``now`` [s] to a worker whose key is called ``holder``."""
    db.execute(
        "INSERT INTO lease (token, run, attempt, worker, holder, granted_at)"
        " VALUES (?, ?, ?, ?, ?, ?)",
        (token, run, attempt, worker, holder, now),
    )


def require_lease(db: sqlite3.Connection, run: str, token: int, holder: str) -> None:
    """Refuse what comes under a lease that ``holder`` never got of this run.

    Whether the lease is over is another question: late results are welcome.
    """
    problem = _problem(db, run, token, holder)
    if problem:
        raise Refused(problem)


def may_use_lease(db: sqlite3.Connection, run: str, token: int, holder: str) -> bool:
    """Whether ``holder`` ever got that lease of the run."""
    return not _problem(db, run, token, holder)


def leases_of_worker(db: sqlite3.Connection, worker: str, holder: str) -> list[tuple[str, int]]:
    """Return runs and tokens of what a worker has now, as far as it was granted to ``holder``.

    A name of a worker is what anybody may say; that of a key is not.
    """
    return db.execute(
        "SELECT run.id, run.token FROM run JOIN lease ON lease.token = run.token"
        " WHERE run.state = 'running' AND run.worker = ? AND lease.holder = ?",
        (worker, holder),
    ).fetchall()


def _problem(db: sqlite3.Connection, run: str, token: int, holder: str) -> str:
    row = db.execute(_FIND, (run, token)).fetchone()
    if row is None:
        return f"there is no run {run}"
    granted, name = row
    if granted is None:
        return f"run {run} was never leased under token {token}"
    return "" if name == holder else f"the lease {token} of {run} was granted under another key"
