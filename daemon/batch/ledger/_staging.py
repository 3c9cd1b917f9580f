"""Submissions made ready to be entered: rows in a file of their own, from which SQLite copies them.

To make them takes Python seconds for a million runs and needs no ledger: another process may do it.
To copy them is one statement for many rows, in which no other thread of the daemon has to wait.
"""

from __future__ import annotations

import hashlib
import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from daemon.batch.errors import Unavailable
from daemon.batch.ledger._steps import STEP_ROWS, Steps
from daemon.model.ids import trace_name
from daemon.model.packed_submission import PackedRun, PackedSubmission, Script, submission_digest
from daemon.model.spec import RunSpec
from grammars.text import codec

_NAME: Final = 32
"""Hexadecimal digits of SHA-256 that name a part: 128 bits, and half the bytes in every body."""
_MANY: Final = 2000
STAGED: Final = "staged"
"""The name under which the ledger's connection knows the file."""

_TABLES: Final = """
CREATE TABLE {0}.staged_campaign (
    id TEXT, name TEXT, about TEXT, source TEXT, digest TEXT, total INTEGER, declared BLOB,
    fresh INTEGER, reserve INTEGER, origin BLOB
);
CREATE TABLE {0}.staged_part (name TEXT PRIMARY KEY, body BLOB);
CREATE TABLE {0}.staged_cell (
    cell INTEGER PRIMARY KEY, part TEXT, scenario TEXT, sut TEXT, time_limit REAL, kind TEXT,
    repeatable INTEGER, trace TEXT
);
CREATE TABLE {0}.staged_script (script INTEGER PRIMARY KEY, part TEXT);
CREATE TABLE {0}.staged_run (
    position INTEGER PRIMARY KEY, cell INTEGER, script INTEGER, repeat INTEGER, seed TEXT,
    digest TEXT
);
CREATE TABLE {0}.staged_reserve (
    position INTEGER PRIMARY KEY, cell INTEGER, script INTEGER, repeat INTEGER, seed TEXT
);
"""


@dataclass(frozen=True, slots=True)
class StagedCampaign:
    """What a staged submission says of its campaign; ``runs`` and ``reserve`` are counted."""

    id: str
    name: str
    about: str
    source: str
    digest: str
    runs: int
    declared: bytes
    fresh: bool
    reserve: int
    origin: bytes


def stage_submission(packed: PackedSubmission, path: Path) -> None:
    """Write the rows of a submission into a new file.

    Raises ``ValueError`` for a run in terms of a cell or a script that is not there, and
    :class:`Unavailable` when the file cannot be written.
    """
    try:
        with closing(sqlite3.connect(path, isolation_level=None)) as db:
            # Nothing of it has to survive anything: who is not told that it is in the ledger sends
            # it once more.
            db.execute("PRAGMA journal_mode = OFF")
            db.execute("PRAGMA synchronous = OFF")
            db.execute("BEGIN")
            stage_rows(db, packed)
            db.execute("COMMIT")
    except sqlite3.Error as error:
        raise Unavailable(f"the submission cannot be stored: {error}") from error


def stage_rows(db: sqlite3.Connection, packed: PackedSubmission, schema: str = "main") -> None:
    """Make the tables in a ``schema`` of the connection and fill them; raises ``ValueError``."""
    for statement in _TABLES.format(schema).split(";"):
        db.execute(statement)
    cells = _enter_parts(db, packed.cells, RunSpec)
    db.executemany(
        "INSERT INTO staged_cell VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        (
            (i, part, *_cell_row(packed.campaign, cell))
            for i, (part, cell) in enumerate(zip(cells, packed.cells, strict=True))
        ),
    )
    scripts = _enter_parts(db, packed.scripts, Script)
    db.executemany("INSERT INTO staged_script VALUES (?, ?)", enumerate(scripts))
    runs = _RowBuffer(db, "INSERT INTO staged_run VALUES (?, ?, ?, ?, ?, ?)")
    digest = submission_digest(packed, lambda run, found: runs.add((*_row(run), found)))
    runs.flush()
    reserve = _RowBuffer(db, "INSERT INTO staged_reserve VALUES (?, ?, ?, ?, ?)")
    for run in packed.reserve:
        reserve.add(_row(run))
    reserve.flush()
    named = (packed.campaign, packed.name, packed.about, packed.source, digest)
    declared = codec.to_json(packed.declared)
    db.execute(
        "INSERT INTO staged_campaign VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (*named, runs.count, declared, packed.fresh, reserve.count, codec.to_json(packed.origin)),
    )


def drop_rows(db: sqlite3.Connection) -> None:
    """Remove the temporary tables that were made on a connection."""
    for name in re.findall(r"TABLE \{0\}\.(\w+)", _TABLES):
        db.execute(f"DROP TABLE temp.{name}")


def _row(run: PackedRun) -> tuple[object, ...]:
    # The seed as text: 64 bits without a sign do not fit SQLite's integers.
    return (run.cell, run.script, run.repeat, str(run.seed))


class _RowBuffer:
    """Numbers rows and inserts many at a time."""

    def __init__(self, db: sqlite3.Connection, statement: str) -> None:
        self.count = 0
        self._db = db
        self._statement = statement
        self._rows: list[tuple[object, ...]] = []

    def add(self, row: tuple[object, ...]) -> None:
        self._rows.append((self.count, *row))
        self.count += 1
        if len(self._rows) >= _MANY:
            self.flush()

    def flush(self) -> None:
        self._db.executemany(self._statement, self._rows)
        self._rows.clear()


def _enter_parts(db: sqlite3.Connection, parts: Iterable[Any], kind: Any) -> Iterator[str]:
    names = []
    for part in parts:
        text = codec.to_json(part, kind)
        name = hashlib.sha256(text).hexdigest()[:_NAME]
        db.execute("INSERT OR IGNORE INTO staged_part VALUES (?, ?)", (name, text))
        names.append(name)
    return iter(names)


def _cell_row(campaign: str, cell: RunSpec) -> tuple[object, ...]:
    sut = cell.sut
    trace = trace_name(campaign, cell.scenario, sut.name, 0).removesuffix("0.mcap")
    return (cell.scenario, sut.name, cell.limit, sut.kind, sut.repeatable, trace)


def read_campaign(db: sqlite3.Connection) -> StagedCampaign:
    """Return what the staged submission says of its campaign."""
    row = db.execute("SELECT * FROM staged_campaign").fetchone()
    id, name, about, source, digest, runs, declared, fresh, reserve, origin = row
    named = (id, name, about, source, digest)
    return StagedCampaign(*named, runs, declared, bool(fresh), reserve, origin)


_BODY: Final = (
    "CAST('[\"' || staged_cell.part || '\",\"' || staged_script.part || '\",' || repeat || ','"
    " || seed || ']' AS BLOB)"
)
_PARTS: Final = (
    "INSERT OR IGNORE INTO part SELECT name, body FROM staged_part WHERE rowid >= ?1 AND rowid < ?2"
)
_RUNS: Final = (
    "INSERT INTO run (id, campaign, position, scenario, sut, repeat, time_limit, digest,"
    " trace_name, seed, kind, repeatable) SELECT ?3 || '.' || (position + ?4), ?3, position + ?4,"
    " scenario, sut, repeat, time_limit, digest, trace || repeat || '.mcap', seed, kind, repeatable"
    " FROM staged_run JOIN staged_cell USING (cell) WHERE position >= ?1 AND position < ?2"
    " ORDER BY position"
)
_SPECS: Final = (
    f"INSERT INTO spec (run, body) SELECT ?3 || '.' || (position + ?4), {_BODY} FROM staged_run"
    " JOIN staged_cell USING (cell) JOIN staged_script USING (script)"
    " WHERE position >= ?1 AND position < ?2 ORDER BY position"
)
_RESERVE: Final = (
    "INSERT INTO reserve (campaign, position, scenario, sut, repeat, body)"
    f" SELECT ?3, position, scenario, sut, repeat, {_BODY} FROM staged_reserve"
    " JOIN staged_cell USING (cell) JOIN staged_script USING (script)"
    " WHERE position >= ?1 AND position < ?2"
)


def enter_rows(db: sqlite3.Connection, campaign: StagedCampaign) -> Steps[None]:
    """Copy parts, runs with their specifications, and reserve into the ledger."""
    yield from enter_parts(db)
    yield from _copy(campaign.runs, lambda *part: copy_runs(db, campaign.id, *part))
    yield from _copy(campaign.reserve, lambda *part: db.execute(_RESERVE, (*part, campaign.id)))


def enter_parts(db: sqlite3.Connection) -> Steps[None]:
    """Copy what the specifications of staged runs are made of."""
    parts = db.execute("SELECT count(*) FROM staged_part").fetchone()[0]
    yield from _copy(parts, lambda *part: db.execute(_PARTS, part), first=1)


def _copy(count: int, copy: Callable[[int, int], object], first: int = 0) -> Steps[None]:
    for start in range(first, first + count, STEP_ROWS):
        copy(start, start + STEP_ROWS)
        yield


def copy_runs(db: sqlite3.Connection, campaign: str, start: int, end: int, offset: int = 0) -> None:
    """Copy staged runs from ``start`` to before ``end``; ``offset`` is added to their positions."""
    entered = db.execute(_RUNS, (start, end, campaign, offset)).rowcount
    db.execute(_SPECS, (start, end, campaign, offset))
    count_queued(db, campaign, entered)


def count_queued(db: sqlite3.Connection, campaign: str, runs: int) -> None:
    """Add new runs to the tally: nothing else counts them."""
    db.execute(
        "INSERT INTO tally VALUES (?, 'queued', '', ?)"
        " ON CONFLICT DO UPDATE SET runs = runs + excluded.runs",
        (campaign, runs),
    )
