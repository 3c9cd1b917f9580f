"""Which scenes and files the runs of the ledger need."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from typing import Final

from daemon.model.attachments import attached_digests

_CELL: Final = (3, 32)
"""Where in the body of a specification the name of its cell stands, and its length."""
_BODIES: Final = f"""
    SELECT DISTINCT substr(CAST(body AS TEXT), {_CELL[0]}, {_CELL[1]}) FROM spec
"""
_RESERVES: Final = f"""
    SELECT DISTINCT substr(CAST(body AS TEXT), {_CELL[0]}, {_CELL[1]}) FROM reserve
"""
_WAITING: Final = " JOIN run ON run.id = spec.run WHERE run.state IN ('queued', 'running')"


def referenced_inputs(db: sqlite3.Connection) -> tuple[frozenset[str], frozenset[str]]:
    """Return the digests of scenes and files that any run needs, and those of runs that wait.

    Runs that may still be made of a reserve count among all. Raises ``sqlite3.Error``, and
    ``ValueError``, ``TypeError`` or ``KeyError`` for a ledger that is damaged there.
    """
    return _inputs(db, (_BODIES, _RESERVES)), _inputs(db, (_BODIES + _WAITING,))


def _inputs(db: sqlite3.Connection, queries: tuple[str, ...]) -> frozenset[str]:
    cells = {name for query in queries for (name,) in db.execute(query)}
    return _inputs_of(_part(db, name) for name in cells)


def _part(db: sqlite3.Connection, name: str) -> bytes:
    row = db.execute("SELECT body FROM part WHERE name = ?", (name,)).fetchone()
    if row is None:
        # What its runs need would look superfluous.
        raise ValueError(f"there is no part {name!r} of a specification")
    body: bytes = row[0]
    return body


def _inputs_of(bodies: Iterator[bytes]) -> frozenset[str]:
    found: set[str] = set()
    for body in bodies:
        # As it is written, not as a specification: a field that a later version does not take must
        # not make what a run needs look superfluous.
        spec = json.loads(body)
        found.add(spec["scene"])
        found.update(attached_digests(spec["sut"]["parameters"]).values())
        found.add(spec.get("map", {}).get("file", ""))
    return frozenset(found - {""})
