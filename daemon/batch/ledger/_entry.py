"""Submissions made ready to be entered, and the rows that the ledger makes of them.

To digest a large campaign takes seconds and needs no ledger: that is done before.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from daemon.model.ids import trace_name
from daemon.model.packed_submission import PackedRun, PackedSubmission, Script, submission_digest
from daemon.model.spec import RunSpec
from grammars.text import codec

_NAME: Final = 32
"""Hexadecimal digits of SHA-256 that name a part: 128 bits, and half the bytes in every body."""
INSERT_RUN: Final = (
    "INSERT INTO run (id, campaign, position, scenario, sut, repeat, time_limit, digest,"
    " trace_name, seed, kind, repeatable) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
)


class Part(NamedTuple):
    """A cell or a script as the ledger keeps it; the name is that of its content."""

    name: str
    body: bytes


@dataclass(frozen=True, slots=True)
class AdmittedSubmission:
    """A submission with its ``digest``, the parts its runs are made of, and their ``digests``."""

    packed: PackedSubmission
    digest: str
    cells: tuple[Part, ...]
    scripts: tuple[Part, ...]
    digests: tuple[str, ...]


def prepare_submission(packed: PackedSubmission) -> AdmittedSubmission:
    """Make a submission ready to be entered.

    Raises ``ValueError`` for a run in terms of a cell or a script that is not there.
    """
    digests: list[str] = []
    digest = submission_digest(packed, lambda _, found: digests.append(found))
    cells = tuple(_parts(packed.cells, RunSpec))
    scripts = tuple(_parts(packed.scripts, Script))
    return AdmittedSubmission(packed, digest, cells, scripts, tuple(digests))


def _parts(values: Iterable[object], kind: Any) -> Iterator[Part]:
    for value in values:
        body = codec.to_json(value, kind)
        yield Part(hashlib.sha256(body).hexdigest()[:_NAME], body)


def enter_parts(db: sqlite3.Connection, prepared: AdmittedSubmission) -> None:
    """Enter what the specifications of runs are made of."""
    statement = "INSERT OR IGNORE INTO part (name, body) VALUES (?, ?)"
    db.executemany(statement, (*prepared.cells, *prepared.scripts))


def enter_runs(
    db: sqlite3.Connection, prepared: AdmittedSubmission, first: int = 0, offset: int = 0
) -> None:
    """Enter the runs from the ``first`` on; ``offset`` is added to their positions."""
    campaign = prepared.packed.campaign
    runs = list(enumerate(prepared.packed.runs))[first:]
    db.executemany(INSERT_RUN, (_run_row(prepared, i, run, offset) for i, run in runs))
    db.executemany(
        "INSERT INTO spec (run, body) VALUES (?, ?)",
        ((f"{campaign}.{i + offset}", _body(prepared, run)) for i, run in runs),
    )
    count_queued(db, campaign, len(runs))


def enter_reserve(db: sqlite3.Connection, prepared: AdmittedSubmission) -> None:
    """Enter the repeats in reserve."""
    packed = prepared.packed
    db.executemany(
        "INSERT INTO reserve (campaign, position, scenario, sut, repeat, body)"
        " VALUES (?, ?, ?, ?, ?, ?)",
        (
            (packed.campaign, i, cell.scenario, cell.sut.name, run.repeat, _body(prepared, run))
            for i, run in enumerate(packed.reserve)
            for cell in (packed.cells[run.cell],)
        ),
    )


def _run_row(
    prepared: AdmittedSubmission, index: int, run: PackedRun, offset: int
) -> tuple[object, ...]:
    campaign, cell = prepared.packed.campaign, prepared.packed.cells[run.cell]
    sut, position = cell.sut, index + offset
    return (
        f"{campaign}.{position}",
        campaign,
        position,
        cell.scenario,
        sut.name,
        run.repeat,
        cell.limit,
        prepared.digests[index],
        trace_name(campaign, cell.scenario, sut.name, run.repeat),
        # As text: 64 bits without a sign do not fit SQLite's integers.
        str(run.seed),
        sut.kind,
        sut.repeatable,
    )


def _body(prepared: AdmittedSubmission, run: PackedRun) -> bytes:
    cell, script = prepared.cells[run.cell].name, prepared.scripts[run.script].name
    return f'["{cell}","{script}",{run.repeat},{run.seed}]'.encode()


def count_queued(db: sqlite3.Connection, campaign: str, runs: int) -> None:
    """Add new runs to the tally: nothing else counts them."""
    db.execute(
        "INSERT INTO tally VALUES (?, 'queued', '', ?)"
        " ON CONFLICT DO UPDATE SET runs = runs + excluded.runs",
        (campaign, runs),
    )
