"""Entering runs into the ledger with their shared cells and scripts, and reading them back.

Also the scenes and files that they need.
"""

from __future__ import annotations

import functools
import sqlite3
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain, repeat
from typing import Final, NamedTuple

from daemon.model.assessments import AssessmentRules
from daemon.model.ids import trace_name
from daemon.model.search import SearchSubmission
from daemon.model.spec import RunSpec, Script, run_digest, text_digest
from daemon.model.submission import Submission
from grammars.text import codec

RESERVE: Final = "reserve"
"""State of repeats that stay hidden until they are queued."""
_INSERT_RUN: Final = (
    "INSERT INTO run (id, campaign, position, cell, script, scenario, sut, repeat, time_limit,"
    " digest, trace_name, state, seed, kind, repeatable)"
    " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
)
_READ_SPEC: Final = (
    "SELECT cell.body, script.body, repeat, seed FROM run"
    " JOIN cell ON cell.campaign = run.campaign AND cell.number = run.cell"
    " JOIN script ON script.campaign = run.campaign AND script.number = run.script"
    " WHERE run.id = ?"
)
_MOST_CACHED: Final = 1024
# Read as JSON, not as specifications: an unknown field must not make a needed input look
# superfluous.
_NAMED: Final = (
    "WITH text (body) AS (SELECT CAST(body AS TEXT) FROM cell {cells})"
    " SELECT json_extract(body, '$.scene') FROM text"
    " UNION SELECT json_extract(body, '$.map.file') FROM text"
    " UNION SELECT value FROM text, json_each(body, '$.sut.files')"
)
_WAITING: Final = (
    "WHERE (campaign, number) IN"
    " (SELECT campaign, cell FROM run WHERE state IN ('queued', 'running'))"
)


class _Text(NamedTuple):
    """An entered cell or script."""

    number: int
    digest: str


def enter_campaign(
    db: sqlite3.Connection,
    submission: Submission | SearchSubmission,
    digest: str,
    declared: AssessmentRules,
    now: float,
) -> None:
    """Enter a campaign without its runs."""
    db.execute(
        "INSERT INTO campaign (id, name, about, source, digest, total, submitted_at, declared,"
        " fresh, origin) VALUES (?, ?, ?, ?, ?, 0, ?, ?, ?, ?)",
        (
            submission.campaign,
            submission.name,
            submission.about,
            submission.source,
            digest,
            now,
            codec.to_json(declared),
            submission.fresh,
            codec.to_json(submission.origin),
        ),
    )


def enter_runs(db: sqlite3.Connection, submission: Submission) -> None:
    """Enter the runs of a submission after the existing ones of its campaign."""
    campaign, runs = submission.campaign, submission.runs
    cells = _enter_texts(db, "cell", campaign, map(codec.to_json, submission.cells))
    behaviours = (codec.to_json(script, Script) for script in submission.scripts)
    scripts = _enter_texts(db, "script", campaign, behaviours)
    (first,) = db.execute("SELECT total FROM campaign WHERE id = ?", (campaign,)).fetchone()
    every = chain(zip(runs, repeat("queued")), zip(submission.reserve, repeat(RESERVE)))
    db.executemany(
        _INSERT_RUN,
        (
            (
                f"{campaign}.{position}",
                campaign,
                position,
                cells[run.cell].number,
                scripts[run.script].number,
                cell.scenario,
                cell.sut.name,
                run.repeat,
                cell.limit,
                run_digest(
                    cells[run.cell].digest, scripts[run.script].digest, run.repeat, run.seed
                ),
                trace_name(campaign, cell.scenario, cell.sut.name, run.repeat),
                state,
                # As text: 64 unsigned bits do not fit SQLite's integers.
                str(run.seed),
                cell.sut.kind,
                cell.sut.repeatable,
            )
            for position, (run, state) in enumerate(every, first)
            for cell in (submission.cells[run.cell],)
        ),
    )
    # Triggers count only changes of runs, not new ones.
    db.executemany(
        "INSERT INTO tally VALUES (?, ?, '', ?)"
        " ON CONFLICT DO UPDATE SET runs = runs + excluded.runs",
        ((campaign, "queued", len(runs)), (campaign, RESERVE, len(submission.reserve))),
    )
    db.execute("UPDATE campaign SET total = total + ? WHERE id = ?", (len(runs), campaign))


def _enter_texts(
    db: sqlite3.Connection, table: str, campaign: str, texts: Iterable[bytes]
) -> list[_Text]:
    """Enter cells or scripts after the existing ones."""
    query = f"SELECT count(*) FROM {table} WHERE campaign = ?"
    (first,) = db.execute(query, (campaign,)).fetchone()
    entered = []
    for number, text in enumerate(texts, first):
        db.execute(
            f"INSERT INTO {table} (campaign, number, body) VALUES (?, ?, ?)",
            (campaign, number, text),
        )
        entered.append(_Text(number, text_digest(text)))
    return entered


def read_spec(db: sqlite3.Connection, run: str) -> RunSpec:
    """Return the specification of a run."""
    cell, script, number, seed = db.execute(_READ_SPEC, (run,)).fetchone()
    behaviours = _read_script(script)
    return replace(_read_cell(cell), repeat=number, behaviours=behaviours, seed=int(seed))


# Cached by text: a lookup takes a hundredth of the time of parsing.
@functools.lru_cache(_MOST_CACHED)
def _read_cell(body: bytes) -> RunSpec:
    return codec.from_json(RunSpec, body)


@functools.lru_cache(_MOST_CACHED)
def _read_script(body: bytes) -> Script:
    script: Script = codec.from_json(Script, body)
    return script


def needed_inputs(db: sqlite3.Connection, *, waiting: bool = False) -> frozenset[str]:
    """Return the digests of scenes and files that all runs need, or only ``waiting`` ones.

    All runs include those in reserve. Raises ``sqlite3.Error``, also for damaged cells.
    """
    rows = db.execute(_NAMED.format(cells=_WAITING if waiting else "")).fetchall()
    return frozenset(digest for (digest,) in rows if digest)
