"""Results in the ledger: storing and reusing them, holds of campaigns, checks of leases."""

from __future__ import annotations

import sqlite3
from typing import Any, Final

from daemon.batch.errors import OtherLedger, Refused, Rejected
from daemon.batch.ledger._entry import RESERVE
from daemon.batch.ledger._queries import run_row, select_runs
from daemon.judging.assessment import undecided_cells
from daemon.model.assessments import AssessmentRules
from daemon.model.messages import Completion, Rejection
from daemon.model.spec import ENGINE_VERSION, RunResult
from daemon.model.verdicts import deciding_verdict
from grammars.text import codec


def read_campaign(db: sqlite3.Connection, campaign: str, columns: str) -> Any:
    """Return columns of a campaign; raises :class:`Refused` if it does not exist."""
    row = db.execute(f"SELECT {columns} FROM campaign WHERE id = ?", (campaign,)).fetchone()
    if row is None:
        raise Refused(f"there is no campaign {campaign}")
    return row


def read_declared(db: sqlite3.Connection, campaign: str) -> AssessmentRules:
    """Return the rules of a campaign; raises :class:`Refused` if it does not exist."""
    return codec.from_json(AssessmentRules, read_campaign(db, campaign, "declared")[0])


# Only of repeatable systems: others might give another result. Of several results the latest one.
# The old run must be at rest: a running repetition may still put its result in doubt.
_FIND_RESULTS: Final = (
    "SELECT new.id, max(old.serial) FROM run AS new JOIN run AS old"
    " ON old.digest = new.digest AND old.result <> ''"
    " WHERE new.campaign = ? AND new.position >= ?"
    " AND new.state = 'queued' AND new.result = ''"
    " AND new.repeatable AND old.state = 'done' AND old.outcome <> 'error'"
    " AND NOT EXISTS (SELECT 1 FROM run AS alarm WHERE alarm.digest = new.digest"
    " AND alarm.doubted = 1)"
    # A search learns from leading margins, which only runs of searches have.
    " AND (NOT EXISTS (SELECT 1 FROM search WHERE search.campaign = new.campaign)"
    " OR EXISTS (SELECT 1 FROM search WHERE search.campaign = old.campaign)) GROUP BY new.id"
)
# A reused result refers to the executed run, so that its trace is found in one step.
_TAKE_RESULT: Final = (
    "UPDATE run SET (state, result, outcome, oracle, margin, unit, simulated, wall, trace_at,"
    " cached) = (SELECT 'done', result, outcome, oracle, margin, unit, simulated, wall, trace_at,"
    " CASE cached WHEN '' THEN id ELSE cached END FROM run WHERE serial = ?) WHERE id = ?"
)
_COPY_RESULT: Final = (
    "INSERT INTO result (run, attempt, worker, digest, at, body)"
    " SELECT ?, attempt, worker, digest, at, body FROM result"
    " WHERE run = (SELECT id FROM run WHERE serial = ?)"
)


def read_holds(db: sqlite3.Connection) -> tuple[str, ...]:
    """Return the missing inputs of waiting campaigns, for :func:`hold_text`."""
    query = "SELECT DISTINCT lacks FROM campaign WHERE finished_at IS NULL AND lacks <> ''"
    return tuple(lacks for (lacks,) in db.execute(query))


def hold_text(lacks: str) -> str:
    """Return a message for a lack (``engine N``, ``scene DIGEST`` or ``file DIGEST``)."""
    kind, _, name = lacks.partition(" ")
    if kind == "engine":
        return (
            f"runs of engine {name} wait, this version has engine {ENGINE_VERSION}: cancel their"
            " campaign and submit it again, or use the version it was submitted with"
        )
    return f"the {kind} {name[:12]} is gone or was damaged: submit its campaign again"


def read_other_engines(db: sqlite3.Connection) -> tuple[tuple[str, str], ...]:
    """Return unfinished campaigns of other engines, each with its lack."""
    return tuple(
        db.execute(
            "SELECT DISTINCT campaign, 'engine ' || json_extract(body, '$.engine') FROM"
            " (SELECT cell.campaign, CAST(body AS TEXT) AS body FROM cell JOIN campaign"
            " ON campaign.id = cell.campaign WHERE finished_at IS NULL)"
            " WHERE json_valid(body) AND json_extract(body, '$.engine') <> ?",
            (ENGINE_VERSION,),
        )
    )


def require_era(db: sqlite3.Connection, era: str, token: int = 0) -> None:
    """Raise :class:`OtherLedger` unless a lease ``token`` of that ``era`` may be of this ledger.

    A copy of the ledger from before the lease does not count.
    """
    row = db.execute(
        "SELECT (SELECT min(later.token) FROM era AS later WHERE later.serial > era.serial)"
        " FROM era WHERE id = ?",
        (era,),
    ).fetchone()
    if row is None or (row[0] is not None and token > row[0]):
        raise OtherLedger("this daemon keeps another ledger, or an older copy of it")


def require_lease(db: sqlite3.Connection, run: str, token: int) -> None:
    """Raise :class:`Rejected` for a lease that the run never had.

    Ended leases are accepted: late results are welcome.
    """
    row = db.execute("SELECT granted FROM run WHERE id = ?", (run,)).fetchone()
    if row is None:
        raise Rejected(f"there is no run {run}", Rejection.UNKNOWN_RUN)
    # Tokens only grow, and ``granted`` is the latest one of the run.
    if not 0 < token <= row[0]:
        words = f"run {run} was never leased under token {token}"
        raise Rejected(words, Rejection.UNKNOWN_LEASE)


def store_result(db: sqlite3.Connection, completion: Completion, digest: str, now: float) -> None:
    """Store the result of a run for good."""
    result = completion.result
    # The primary key keeps the first result and ignores all others.
    db.execute(
        "INSERT OR IGNORE INTO result (run, attempt, worker, digest, at, body)"
        " VALUES (?, ?, ?, ?, ?, ?)",
        (completion.run, completion.attempt, completion.worker, digest, now, codec.to_json(result)),
    )
    db.execute(
        "UPDATE run SET outcome = ?, oracle = ?, margin = ?, unit = ?, simulated = ?, wall = ?,"
        " finished_at = ? WHERE id = ?",
        (*result_columns(result), result.timing.wall, now, completion.run),
    )


def result_columns(result: RunResult) -> tuple[str, str, float | None, str, float]:
    """Return the columns of a run that copy parts of its result, for lists.

    Outcome, deciding oracle, margin, unit, and simulated time [s].
    """
    verdict, simulated = deciding_verdict(result.verdicts), result.timing.simulated
    if verdict is None:
        return (str(result.outcome), "", None, "", simulated)
    return (str(result.outcome), verdict.oracle, verdict.margin, verdict.unit, simulated)


def remove_result(db: sqlite3.Connection, run: str) -> None:
    """Remove the result of a run, before a new execution replaces it."""
    db.execute("DELETE FROM result WHERE run = ?", (run,))
    db.execute(
        "UPDATE run SET result = '', outcome = '', oracle = '', margin = NULL, unit = '',"
        " simulated = 0, wall = 0, finished_at = NULL, trace_at = '' WHERE id = ?",
        (run,),
    )


def has_stopped_result(db: sqlite3.Connection, run: str) -> bool:
    """Return whether a run has a result that the wall clock ended."""
    row = db.execute("SELECT body FROM result WHERE run = ?", (run,)).fetchone()
    return row is not None and codec.from_json(RunResult, row[0]).stopped


def reuse_results(db: sqlite3.Connection, campaign: str, first: int = 0) -> int:
    """Give queued runs of a campaign the results of equal specifications; return their number.

    Begins at position ``first``. Skips ``fresh`` campaigns, and systems that are not repeatable.
    Runs of searches reuse only results of searches.
    """
    if read_campaign(db, campaign, "fresh")[0]:
        return 0
    sources = db.execute(_FIND_RESULTS, (campaign, first)).fetchall()
    for run, source in sources:
        db.execute(_TAKE_RESULT, (source, run))
        db.execute(_COPY_RESULT, (run, source))
    if sources:
        db.execute("UPDATE campaign SET cached = cached + ? WHERE id = ?", (len(sources), campaign))
    return len(sources)


def queue_reserve(db: sqlite3.Connection, campaign: str) -> int:
    """Queue the next repeats of undecided cells; return their number.

    A cell gets the repeats up to its next look (see
    :class:`daemon.model.assessments.RepeatPolicy`): stopping at other times would spoil the error
    rates.
    """
    waiting = "SELECT total(runs) FROM tally WHERE campaign = ? AND state = ?"
    if not db.execute(waiting, (campaign, RESERVE)).fetchone()[0]:
        return 0
    where = "WHERE campaign = ? AND state <> ? ORDER BY position"
    rows = select_runs(db, where, (campaign, RESERVE), results=True)
    declared, records = read_declared(db, campaign), [run_row(db, row) for row in rows]
    queued = 0
    for scenario, sut in undecided_cells(declared, records):
        so_far = sum((r.scenario, r.sut) == (scenario, sut) for r in records)
        upto = next((look for look in declared.policy.looks if look > so_far), so_far)
        queued += db.execute(
            "UPDATE run SET state = 'queued' WHERE campaign = ? AND state = ? AND scenario = ?"
            " AND sut = ? AND repeat < ?",
            (campaign, RESERVE, scenario, sut, upto),
        ).rowcount
    db.execute("UPDATE campaign SET total = total + ? WHERE id = ?", (queued, campaign))
    return queued
