"""What the ledger keeps of runs as values: specifications, run records, where traces lie.

The body of a specification or of a repeat in reserve is ``[cell, script, repeat, seed]``, where
the first two name rows of ``part`` by content; ledgers of schema 4 and before wrote every run out.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, TypeVar

from daemon.batch.errors import Refused
from daemon.batch.paths import StatePaths
from daemon.model.assessments import AssessmentRules, RunRecord
from daemon.model.packed_submission import Interner, Script
from daemon.model.spec import RunResult, RunSpec
from grammars.text import codec

T = TypeVar("T")

_MOST_CACHED: Final = 1024
_NAME: Final = 32
"""Hexadecimal digits of SHA-256 that name a part: 128 bits, and half the bytes in every body."""

_COLUMNS: Final = (
    "run.id, scenario, sut, repeat, run.digest, state, reason, seed, cached, trace_name,"
    " trace_at, body"
)


class SpecReader:
    """Reads bodies on one connection; the parts of those read lately are remembered."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self._cells: dict[str, RunSpec] = {}
        self._scripts: dict[str, Script] = {}

    def read(self, body: bytes) -> RunSpec:
        """Return the specification that ``body`` stands for."""
        if not body.startswith(b"["):  # written out, by schema 4 or before
            return codec.from_json(RunSpec, body)
        cell, script, repeat, seed = json.loads(body)
        same = self._part(cell, self._cells, lambda text: codec.from_json(RunSpec, text))
        drawn = self._part(script, self._scripts, _read_script)
        return replace(same, repeat=repeat, seed=seed, behaviours=drawn)

    def _part(self, name: str, cache: dict[str, T], read: Callable[[bytes], T]) -> T:
        if name not in cache:
            if len(cache) >= _MOST_CACHED:
                cache.clear()
            row = self._db.execute("SELECT body FROM part WHERE name = ?", (name,)).fetchone()
            cache[name] = read(row[0])
        return cache[name]


class SpecWriter:
    """Makes bodies of runs that are entered together."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self._interner = Interner()
        self._cells: list[bytes] = []
        self._scripts: list[bytes] = []

    def body(self, run: RunSpec) -> bytes:
        """Enter what is new of a run, and return its body."""
        packed = self._interner.pack(run)
        self._enter_new(self._cells, self._interner.cells, RunSpec)
        self._enter_new(self._scripts, self._interner.scripts, Script)
        names = (self._cells[packed.cell], self._scripts[packed.script])
        return b'["%s","%s",%d,%d]' % (*names, packed.repeat, packed.seed)

    def _enter_new(self, names: list[bytes], parts: list[Any], kind: Any) -> None:
        for part in parts[len(names) :]:
            text = codec.to_json(part, kind)
            name = hashlib.sha256(text).hexdigest()[:_NAME]
            self._db.execute("INSERT OR IGNORE INTO part VALUES (?, ?)", (name, text))
            names.append(name.encode())


def _read_script(text: bytes) -> Script:
    script: Script = codec.from_json(Script, text)
    return script


def find_trace(
    db: sqlite3.Connection, paths: StatePaths, name: str, source: str, location: str = ""
) -> str:
    """Return where a run's trace lies: its ``location`` if it is in a store, else its path.

    It is that of ``source``, the run it was taken from, while it has none of its own. Empty when
    the file was deleted since; what lies in a store is not looked after.
    """
    if location:
        return location
    own = paths.traces / name
    if own.exists():
        return str(own)
    if not source:
        return ""
    row = db.execute("SELECT trace_name FROM run WHERE id = ?", (source,)).fetchone()
    path = paths.traces / row[0] if row else None
    return str(path) if path is not None and path.exists() else ""


def missing_trace_text(source: str) -> str:
    """Say that there is no trace of a run any more, whose result is that of ``source`` if any."""
    return f"the trace of {source} is gone" if source else "its trace is gone"


def read_declared(db: sqlite3.Connection, campaign: str) -> AssessmentRules:
    """Return what a campaign declares; raises :class:`Refused` when there is none of that id."""
    row = db.execute("SELECT declared FROM campaign WHERE id = ?", (campaign,)).fetchone()
    if row is None:
        raise Refused(f"there is no campaign {campaign}")
    return codec.from_json(AssessmentRules, row[0]) if row[0] else AssessmentRules()


def read_records(
    db: sqlite3.Connection,
    campaign: str,
    paths: StatePaths | None = None,
    *,
    offset: int = 0,
    limit: int = -1,
) -> tuple[RunRecord, ...]:
    """Return the runs of a campaign in order, with results where there are any.

    Their traces are looked for below ``paths``, or not at all: that costs a look at the disk each.
    """
    rows = db.execute(
        f"SELECT {_COLUMNS} FROM run LEFT JOIN result ON result.run = run.id"
        " WHERE campaign = ? ORDER BY position LIMIT ? OFFSET ?",
        (campaign, limit, offset),
    )
    return tuple(_run_record(db, tuple(row), paths) for row in rows)


def _run_record(
    db: sqlite3.Connection, row: tuple[Any, ...], paths: StatePaths | None
) -> RunRecord:
    run, scenario, sut, repeat, digest, state, reason, seed, cached, trace, url, body = row
    result = None if body is None else codec.from_json(RunResult, body)
    path, gone = "", ""
    if result and paths:
        path = find_trace(db, paths, trace, cached, url)
        gone = "" if path else missing_trace_text(cached)
    notes = (result.note if result else "", reason, gone)
    return RunRecord(
        id=run,
        scenario=scenario,
        sut=sut,
        repeat=repeat,
        digest=digest,
        outcome=result.outcome if result else None,
        verdicts=result.verdicts if result else (),
        ended=result.ended if result else "",
        timing=result.timing if result else None,
        trace=path or None,
        note="; ".join(note for note in notes if note),
        state=state,
        seed=int(seed),  # text in the table: 64 bits without a sign do not fit SQLite's integers
        cached=cached,
    )
