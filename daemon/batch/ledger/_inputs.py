"""Which scenes and files the runs of the ledger need."""

from __future__ import annotations

import sqlite3
from typing import Final

# Read as JSON, not as specifications: a field that a later version does not take must not make
# what a run needs look superfluous.
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


def needed_inputs(db: sqlite3.Connection, *, waiting: bool = False) -> frozenset[str]:
    """Return the digests of scenes and files that runs need, or that those do which wait.

    Runs that may still be made of a reserve count among all. Raises ``sqlite3.Error``, also for a
    ledger that is damaged there.
    """
    rows = db.execute(_NAMED.format(cells=_WAITING if waiting else "")).fetchall()
    return frozenset(digest for (digest,) in rows if digest)
