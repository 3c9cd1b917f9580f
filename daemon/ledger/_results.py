"""Results that workers bring: whether one is that of a run of ours, and writing it down."""

from __future__ import annotations

import sqlite3

from daemon.errors import Refused
from daemon.messages import Completion
from daemon.places import is_digest
from daemon.spec import RunResult
from daemon.store import stored_url
from daemon.verdict import Outcome, Verdict
from grammars import codec


def check_result(db: sqlite3.Connection, completion: Completion) -> str:
    """Refuse what is no result of a run of ours; returns the run's campaign."""
    known = db.execute(
        "SELECT digest, campaign, CASE granted WHEN 0 THEN"
        " (SELECT value FROM meta WHERE key = 'token') ELSE granted END FROM run WHERE id = ?",
        (completion.run,),
    ).fetchone()
    if known is None:
        raise Refused(f"there is no run {completion.run}")
    if not 0 < completion.token <= known[2]:
        raise Refused(f"run {completion.run} was never leased under token {completion.token}")
    if known[0] != completion.result.spec:
        raise Refused(f"the result is not of run {completion.run}: its specification differs")
    if not is_digest(completion.result.trace.sha256):
        raise Refused(f"the trace of {completion.run} has no digest")
    _check_location(db, completion)
    return str(known[1])


def _check_location(db: sqlite3.Connection, completion: Completion) -> None:
    """Refuse a trace that is said to lie where no store of ours would have it."""
    if not completion.location:
        return
    name, _ = trace_of(db, completion.run)
    stores = db.execute("SELECT url FROM store").fetchall()
    sha256 = completion.result.trace.sha256
    if all(stored_url(url, name, sha256) != completion.location for (url,) in stores):
        raise Refused(f"{completion.location} is not where the trace of {completion.run} goes")


def trace_of(db: sqlite3.Connection, run: str) -> tuple[str, str]:
    """Return the name of a run's trace and its URL, empty when it has none."""
    row = db.execute("SELECT trace_name, trace_at FROM run WHERE id = ?", (run,))
    found = row.fetchone()
    if found is None:
        raise Refused(f"there is no run {run}")
    return str(found[0]), str(found[1])


def keep_result(db: sqlite3.Connection, completion: Completion, digest: str, now: float) -> None:
    """Write down what a run gave, for good."""
    db.execute(
        "INSERT OR IGNORE INTO result (run, attempt, worker, digest, at, body)"
        " VALUES (?, ?, ?, ?, ?, ?)",
        (
            completion.run,
            completion.attempt,
            completion.worker,
            digest,
            now,
            codec.to_json(completion.result),
        ),
    )
    result, verdict = completion.result, deciding(completion.result)
    db.execute(
        "UPDATE run SET outcome = ?, oracle = ?, margin = ?, unit = ?, simulated = ?, wall = ?,"
        " finished_at = ?, trace_at = ? WHERE id = ?",
        (
            result.outcome,
            verdict.oracle if verdict else "",
            verdict.margin if verdict else None,
            verdict.unit if verdict else "",
            result.timing.simulated,
            result.timing.wall,
            now,
            completion.location,
            completion.run,
        ),
    )


def deciding(result: RunResult) -> Verdict | None:
    """The verdict a list shows: the first failing one, else the one with the smallest margin."""
    judged = [v for v in result.verdicts if v.outcome is not Outcome.MEASURE]
    for verdict in judged:
        if verdict.outcome is Outcome.FAIL:
            return verdict
    measured = [v for v in judged if v.margin is not None]
    return min(measured, key=lambda v: v.margin or 0.0, default=judged[0] if judged else None)
