"""Run records, read from the ledger: what assessments are made of."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from typing import Final

from daemon.assessment import Declared, RunRecord
from daemon.errors import Refused
from daemon.places import Places
from daemon.spec import RunResult
from daemon.store import Recorded
from grammars import codec

_COLUMNS: Final = (
    "run.id, scenario, sut, repeat, run.digest, state, reason, seed, cached, trace_name,"
    " trace_at, body"
)
FindTrace = Callable[[str, str, str], str]
"""Returns where a trace lies, by its own name, the run it was taken from and its URL if any."""


def find_trace(
    db: sqlite3.Connection, places: Places, name: str, source: str, location: str = ""
) -> str:
    """Return where a run's trace lies: its ``location`` if it is in a store, else its path.

    It is that of ``source``, the run it was taken from, while it has none of its own. Empty when
    the file was deleted since; what lies in a store is not looked after.
    """
    if location:
        return location
    own = places.traces / name
    if own.exists():
        return str(own)
    if not source:
        return ""
    row = db.execute("SELECT trace_name FROM run WHERE id = ?", (source,)).fetchone()
    path = places.traces / row[0] if row else None
    return str(path) if path is not None and path.exists() else ""


def trace_is_gone(source: str) -> str:
    """Say that there is no trace of a run any more, whose result is that of ``source`` if any."""
    return f"the trace of {source} is gone" if source else "its trace is gone"


def find_traces(db: sqlite3.Connection, places: Places, name: str) -> tuple[Recorded, ...]:
    """Return the traces there are of a campaign or a run, in order, cached ones included."""
    rows = db.execute(
        "SELECT id, trace_name, cached, trace_at, body FROM run JOIN result ON result.run = run.id"
        " WHERE run.campaign = ?1 OR run.id = ?1 ORDER BY serial",
        (name,),
    ).fetchall()
    found = []
    for run, trace, source, url, body in rows:
        location = find_trace(db, places, trace, source, url)
        if location:
            info = codec.from_json(RunResult, body).trace
            found.append(Recorded(run, location, info.sha256, info.size))
    return tuple(found)


def read_declared(db: sqlite3.Connection, campaign: str) -> Declared:
    """Return what a campaign declares; raises :class:`Refused` when there is none of that id."""
    row = db.execute("SELECT declared FROM campaign WHERE id = ?", (campaign,)).fetchone()
    if row is None:
        raise Refused(f"there is no campaign {campaign}")
    return codec.from_json(Declared, row[0]) if row[0] else Declared()


def read_records(
    db: sqlite3.Connection,
    campaign: str,
    *,
    find_trace: FindTrace | None = None,
    offset: int = 0,
    limit: int = -1,
) -> tuple[RunRecord, ...]:
    """Return the runs of a campaign in order, with results where there are any."""
    rows = db.execute(
        f"SELECT {_COLUMNS} FROM run LEFT JOIN result ON result.run = run.id"
        " WHERE campaign = ? ORDER BY position LIMIT ? OFFSET ?",
        (campaign, limit, offset),
    )
    return tuple(_record(tuple(row), find_trace) for row in rows)


def _record(row: tuple[object, ...], find_trace: FindTrace | None) -> RunRecord:
    run, scenario, sut, repeat, digest, state, reason, seed, cached, trace, url, body = row
    result = codec.from_json(RunResult, body) if isinstance(body, bytes | str) else None
    path = find_trace(str(trace), str(cached), str(url)) if find_trace and result else ""
    gone = result is not None and find_trace is not None and not path
    notes = (
        result.note if result else "",
        str(reason),
        trace_is_gone(str(cached)) if gone else "",
    )
    return RunRecord(
        id=str(run),
        scenario=str(scenario),
        sut=str(sut),
        repeat=int(str(repeat)),
        digest=str(digest),
        outcome=result.outcome if result else None,
        verdicts=result.verdicts if result else (),
        ended=result.ended if result else "",
        timing=result.timing if result else None,
        trace=path or None,
        note="; ".join(note for note in notes if note),
        state=str(state),
        seed=int(str(seed)),
        cached=str(cached),
    )
