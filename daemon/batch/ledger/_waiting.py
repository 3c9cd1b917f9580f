"""Runs that wait after an attempt that left no result.

A run that was given back is not leased again at once, but after a delay that doubles with each
such attempt in a row: what fails at once would otherwise be tried hundreds of times in a minute. A
result, or a retry by a person, begins anew.

Runs ready to be leased have ``not_before`` 0, so that one index finds the next of 100,000; those
whose time has come are made ready by :func:`end_waits`.
"""

from __future__ import annotations

import hashlib
import sqlite3
from typing import Final

from daemon.batch.ledger.transitions import (
    Completed,
    Lapsed,
    Released,
    Renewed,
    Retried,
    RunEvent,
    RunTransition,
)
from daemon.model.messages import LedgerAnswer

FIRST_DELAY: Final = 1.0
LONGEST_DELAY: Final = 300.0
"""Seconds: after the first attempt without a result, and after many."""
SPREAD: Final = 0.25
"""The delay is up to this part shorter or longer: runs that failed together come back apart."""
_READY_AT_A_TIME: Final = 1000
"""Runs made ready by one look: none of them holds the ledger for long."""

# By name: SQLite would rather look through all queued runs.
_DELAYED: Final = "FROM run INDEXED BY run_delayed WHERE state = 'queued' AND not_before > 0"


def retry_delay(run: str, setbacks: int) -> float:
    """Return how long a run waits after ``setbacks`` attempts in a row without a result [s].

    The jitter comes of the run and the number alone, so that the ledger can be replayed.
    """
    whole = min(FIRST_DELAY * 2.0 ** min(setbacks - 1, 30), LONGEST_DELAY)
    drawn = int.from_bytes(hashlib.sha256(f"{run} {setbacks}".encode()).digest()[:4], "big")
    return whole * (1.0 + SPREAD * (2.0 * drawn / (2**32 - 1) - 1.0))


def note_attempt(
    db: sqlite3.Connection, run: str, event: RunEvent, change: RunTransition, now: float
) -> None:
    """Count an attempt that left no result, or forget those before when there is one."""
    match event:
        case Released(_, reason, blame) if change.answer is LedgerAnswer.DONE:
            # A lease that nobody ever heard of, or that was not begun, is no attempt.
            if reason or blame:
                _count_setback(db, run, now)
        case Lapsed() if change.answer is LedgerAnswer.DONE:
            _count_setback(db, run, now)
        case Renewed() if change.answer is LedgerAnswer.DONE:
            # Waiting and running: its worker is back, and the lapse was no failed attempt.
            db.execute(
                "UPDATE run SET setbacks = setbacks - 1, not_before = 0"
                " WHERE id = ? AND state = 'running' AND not_before > 0 AND setbacks > 0",
                (run,),
            )
        case Completed() | Retried():
            db.execute(
                "UPDATE run SET setbacks = 0, not_before = 0 WHERE id = ? AND setbacks > 0", (run,)
            )


def _count_setback(db: sqlite3.Connection, run: str, now: float) -> None:
    (setbacks,) = db.execute(
        "UPDATE run SET setbacks = setbacks + 1 WHERE id = ? RETURNING setbacks", (run,)
    ).fetchone()
    db.execute(
        "UPDATE run SET not_before = ? WHERE id = ? AND state = 'queued'",
        (now + retry_delay(run, setbacks), run),
    )


def end_waits(db: sqlite3.Connection, now: float) -> int:
    """Make ready whose time has come; returns how many runs that are.

    A clock that was set back while nobody looked must not let anybody wait for longer than the
    longest delay.
    """
    furthest = db.execute(
        f"SELECT not_before {_DELAYED} ORDER BY not_before DESC LIMIT 1"
    ).fetchone()
    if furthest is None:
        return 0
    latest = now + (1.0 + SPREAD) * LONGEST_DELAY
    when, limit = ("> ?", latest) if furthest[0] > latest else ("<= ?", now)
    return db.execute(
        f"UPDATE run SET not_before = 0 WHERE serial IN (SELECT serial {_DELAYED}"
        f" AND not_before {when} LIMIT ?)",
        (limit, _READY_AT_A_TIME),
    ).rowcount


def shift_waits(db: sqlite3.Connection, seconds: float) -> None:
    """Move all waits along with a clock that was set."""
    db.execute(
        f"UPDATE run SET not_before = not_before + ? WHERE serial IN (SELECT serial {_DELAYED})",
        (seconds,),
    )
