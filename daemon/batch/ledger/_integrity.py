"""Whether a ledger is whole: by SQLite's own checks and by the rules its tables must keep."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.ledger._connection import SCHEMA_VERSION, connect_reader, schema_version

_MOST_SHOWN: Final = 3
_RULES: Final = {
    "runs are counted as done and have no result": (
        "SELECT count(*) FROM run LEFT JOIN result ON result.run = run.id"
        " WHERE run.result <> '' AND result.run IS NULL"
    ),
    "results differ from what their run says": (
        "SELECT count(*) FROM result JOIN run ON run.id = result.run"
        " WHERE run.result <> result.digest"
    ),
    "runs have no specification": (
        "SELECT count(*) FROM run LEFT JOIN spec ON spec.run = run.id WHERE spec.run IS NULL"
    ),
    "runs are queued in campaigns that are closed": (
        "SELECT count(*) FROM run JOIN campaign ON campaign.id = run.campaign"
        " WHERE state IN ('queued', 'running') AND campaign.finished_at IS NOT NULL"
    ),
    # The tally is kept by triggers; a row of it may count no run, so it stands on the right side.
    "counts differ from the runs": (
        "SELECT count(*) FROM (SELECT campaign, state, outcome, count(*) AS runs FROM run"
        " GROUP BY campaign, state, outcome) AS found LEFT JOIN tally USING"
        " (campaign, state, outcome) WHERE tally.runs IS NOT found.runs"
    ),
}


@dataclass(frozen=True, slots=True)
class LedgerIntegrity:
    """A ledger under examination: ``damage`` of the file, ``violations`` of the ledger's rules.

    The rules and all numbers are of ledgers of this version only. ``alarms`` are executions that
    came out differently, ``newest_event`` is in seconds since the epoch.
    """

    version: int
    damage: tuple[str, ...] = ()
    violations: tuple[str, ...] = ()
    runs: int = 0
    results: int = 0
    alarms: int = 0
    newest_event: float = 0.0


def check_integrity(path: Path) -> LedgerIntegrity:
    """Examine a ledger, which a daemon may be writing; changes nothing.

    Raises :class:`DaemonError` when it cannot be read at all.
    """
    try:
        with closing(connect_reader(path)) as db:
            db.execute("BEGIN")  # one snapshot: numbers that must agree are counted one by one
            return _examine(db)
    except sqlite3.Error as error:
        raise DaemonError(f"{path} cannot be read: {error}") from error


def _examine(db: sqlite3.Connection) -> LedgerIntegrity:
    version = schema_version(db)
    if version > SCHEMA_VERSION:
        return LedgerIntegrity(version)
    check = db.execute(f"PRAGMA integrity_check({_MOST_SHOWN})")
    damage = [row[0] for row in check if row[0] != "ok"]
    dangling = db.execute("PRAGMA foreign_key_check").fetchall()
    damage += [f"{row[0]} refers to nothing" for row in dangling[:_MOST_SHOWN]]
    if damage or version < SCHEMA_VERSION:
        return LedgerIntegrity(version, tuple(damage))
    counts = {words: _count(db, rule) for words, rule in _RULES.items()}
    newest = db.execute("SELECT max(at) FROM event").fetchone()[0]
    return LedgerIntegrity(
        version,
        violations=tuple(f"{count} {words}" for words, count in counts.items() if count),
        runs=_count(db, "SELECT count(*) FROM run"),
        results=_count(db, "SELECT count(*) FROM result"),
        alarms=_count(db, "SELECT count(*) FROM event WHERE kind = 'alarm'"),
        newest_event=newest or 0.0,
    )


def _count(db: sqlite3.Connection, query: str) -> int:
    return int(db.execute(query).fetchone()[0])
