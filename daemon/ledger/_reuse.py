"""Runs that need not be executed, and runs that must be after all.

A run whose specification has a result in the ledger gets that result: equal digests mean equal
traces. Results of runs that broke are not used again, since the machine may have been at fault.
Repeats in reserve become runs when their cell is still undecided after all repeats before.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Sequence
from typing import Final

from daemon.assessment import undecided
from daemon.ledger._records import read_declared, read_records
from daemon.ledger._specs import Specs, SpecWriter
from daemon.places import trace_name
from daemon.spec import RunSpec

_INSERT_RUN: Final = (
    "INSERT INTO run (id, campaign, position, scenario, sut, repeat, time_limit, digest,"
    " trace_name, seed, kind) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
)
_FIND_RESULTS: Final = (
    "SELECT new.id, max(old.serial) FROM run AS new JOIN run AS old"
    " ON old.digest = new.digest AND old.result <> ''"
    " WHERE new.campaign = ? AND new.state = 'queued' AND new.result = ''"
    " AND old.state = 'done' AND old.outcome <> 'error' GROUP BY new.id"
)
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


def enter_runs(
    db: sqlite3.Connection,
    campaign: str,
    runs: Sequence[RunSpec],
    digests: Sequence[str],
    first: int = 0,
) -> None:
    """Enter runs of a campaign and their digests as queued, at positions from ``first``."""
    specs, placed = SpecWriter(db), list(enumerate(runs, start=first))
    rows = zip(placed, digests, strict=True)
    db.executemany(
        _INSERT_RUN,
        (_run_row(campaign, position, run, digest) for (position, run), digest in rows),
    )
    db.executemany(
        "INSERT INTO spec (run, body) VALUES (?, ?)",
        ((f"{campaign}.{position}", specs.body(run)) for position, run in placed),
    )


def _run_row(campaign: str, position: int, run: RunSpec, digest: str) -> tuple[object, ...]:
    sut = run.sut.name
    trace = trace_name(campaign, run.scenario, sut, run.repeat)
    name = f"{campaign}.{position}"
    known = (name, campaign, position, run.scenario, sut, run.repeat, run.limit, digest)
    return (*known, trace, str(run.seed), run.sut.kind)


def keep_reserve(db: sqlite3.Connection, campaign: str, reserve: Iterable[RunSpec]) -> None:
    """Put repeats aside that may be needed later."""
    specs = SpecWriter(db)
    db.executemany(
        "INSERT INTO reserve (campaign, position, scenario, sut, repeat, body)"
        " VALUES (?, ?, ?, ?, ?, ?)",
        (
            (campaign, i, run.scenario, run.sut.name, run.repeat, specs.body(run))
            for i, run in enumerate(reserve)
        ),
    )


def use_results(db: sqlite3.Connection, campaign: str) -> int:
    """Give queued runs of a campaign the results their specifications have; returns how many.

    Does nothing for a campaign that was submitted to run everything anew.
    """
    fresh = db.execute("SELECT fresh FROM campaign WHERE id = ?", (campaign,)).fetchone()[0]
    found = [] if fresh else db.execute(_FIND_RESULTS, (campaign,)).fetchall()
    for run, source in found:
        db.execute(_TAKE_RESULT, (source, run))
        db.execute(_COPY_RESULT, (run, source))
    db.execute("UPDATE campaign SET cached = cached + ? WHERE id = ?", (len(found), campaign))
    return len(found)


def call_reserve(db: sqlite3.Connection, campaign: str) -> int:
    """Make runs of the repeats that undecided cells get next; returns how many.

    A cell gets as many as bring it to its next look (see :class:`daemon.assessment.Policy`).
    """
    if not db.execute("SELECT 1 FROM reserve WHERE campaign = ?", (campaign,)).fetchone():
        return 0
    declared, records = read_declared(db, campaign), read_records(db, campaign)
    chosen: list[tuple[int, bytes]] = []
    for scenario, sut in undecided(declared, records):
        so_far = sum((r.scenario, r.sut) == (scenario, sut) for r in records)
        upto = _next_look(declared.policy.looks, so_far)
        chosen += db.execute(
            "SELECT position, body FROM reserve WHERE campaign = ? AND scenario = ? AND sut = ?"
            " AND repeat < ? ORDER BY position",
            (campaign, scenario, sut, upto),
        ).fetchall()
    if chosen:
        specs = Specs(db)
        runs = [specs.read(body) for _, body in chosen]
        enter_runs(db, campaign, runs, [run.digest for run in runs], first=len(records))
        gone = ((campaign, position) for position, _ in chosen)
        db.executemany("DELETE FROM reserve WHERE campaign = ? AND position = ?", gone)
        db.execute("UPDATE campaign SET total = total + ? WHERE id = ?", (len(runs), campaign))
    return len(chosen)


def _next_look(looks: Sequence[int], so_far: int) -> int:
    return next((look for look in looks if look > so_far), so_far)
