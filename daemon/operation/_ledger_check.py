"""Whether the ledger is whole, found without writing to it."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from typing import Final
from urllib.parse import quote

from daemon.ledger import SCHEMA_VERSION
from daemon.operation._findings import Finding, ok, problem, warning
from daemon.places import Places

_SKEW: Final = 5.0
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
    "counts differ from the runs": (
        "SELECT count(*) FROM (SELECT campaign, state, outcome, count(*) AS runs FROM run"
        " GROUP BY campaign, state, outcome) AS found LEFT JOIN tally USING"
        " (campaign, state, outcome) WHERE tally.runs IS NOT found.runs"
    ),
}
_BACKUP: Final = (
    "stop the daemon, keep a copy of the directory, restore the ledger from a backup "
    "or save what is readable with `sqlite3 ledger.db .recover`"
)


def check_ledger(places: Places, now: float) -> Iterator[Finding]:
    """Check the file, the references in it, its own rules, and that ``now`` is not in its past."""
    if not places.ledger.exists():
        yield ok("ledger", "none yet: the first daemon makes it")
        return
    try:
        uri = f"file:{quote(str(places.ledger))}?mode=ro"
        with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as db:
            db.execute("BEGIN")
            yield from _findings(db, now)
    except sqlite3.Error as error:
        yield problem("ledger", f"{places.ledger} cannot be read: {error}", _BACKUP)


def _findings(db: sqlite3.Connection, now: float) -> Iterator[Finding]:
    version = db.execute("PRAGMA user_version").fetchone()[0]
    if version > SCHEMA_VERSION:
        yield problem(
            "ledger",
            f"has schema {version}, this version knows {SCHEMA_VERSION}",
            "use the version that made it, or another state directory",
        )
        return
    broken = [row[0] for row in db.execute("PRAGMA integrity_check(3)") if row[0] != "ok"]
    broken += [f"{row[0]} refers to nothing" for row in db.execute("PRAGMA foreign_key_check")][:3]
    if broken:
        yield problem("ledger", f"is damaged: {'; '.join(broken)}", _BACKUP)
        return
    if version < SCHEMA_VERSION:
        yield warning(
            "ledger",
            f"whole, schema {version} of an earlier version",
            "the next daemon brings it up to date; copy it if you may go back",
        )
        return
    yield from _content(db, now)


def _content(db: sqlite3.Connection, now: float) -> Iterator[Finding]:
    wrong = [f"{n} {words}" for words, rule in _RULES.items() if (n := _number(db, rule))]
    if wrong:
        yield problem("ledger", "; ".join(wrong), "please report it, with a copy of the ledger")
    else:
        runs, results = (_number(db, f"SELECT count(*) FROM {t}") for t in ("run", "result"))
        yield ok("ledger", f"whole, schema {SCHEMA_VERSION}, {runs} runs, {results} results")
    alarms = _number(db, "SELECT count(*) FROM event WHERE kind = 'alarm'")
    if alarms:
        yield warning(
            "determinism",
            f"{alarms} times another execution of a run came out differently",
            "see `scenario results --runs --filter nondeterministic`",
        )
    last = db.execute("SELECT max(at) FROM event").fetchone()[0] or 0.0
    if last > now + _SKEW:
        yield problem(
            "clock",
            f"it is {last - now:.0f} s before the ledger's newest event",
            "set the clock (timedatectl); leases end late until it has caught up",
        )
    else:
        yield ok("clock", "not before the ledger's newest event")


def _number(db: sqlite3.Connection, query: str) -> int:
    return int(db.execute(query).fetchone()[0])
