"""What can be named in a state directory: campaigns, runs, scenarios, systems under test, oracles.

For completion at every TAB: the ledger is read as it is, without a daemon and without its models,
which take longer to import than people wait for a word. Nothing is ever written.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

MOST_NAMES: Final = 200
"""Names in one answer: nobody reads more."""

_LOCK_TIMEOUT: Final = 0.1
"""Seconds to wait for a ledger that is being written."""
_AFTER_ANY_TEXT: Final = "\U0010ffff"
"""Behind every text that begins with what stands before it."""


class LedgerName(NamedTuple):
    """A name and what it is, in a few words."""

    name: str
    about: str


def campaigns(ledger: Path) -> tuple[LedgerName, ...]:
    """Return the ids of the campaigns, the newest first, then their names.

    Raises ``OSError`` or ``sqlite3.Error`` when the ledger cannot be read.
    """
    with _opened(ledger) as book:
        query = "SELECT id, name, total, about FROM campaign ORDER BY serial DESC LIMIT ?"
        rows = book.execute(query, (MOST_NAMES,)).fetchall()
    ids = (LedgerName(row[0], f"{row[2]} runs{f', {row[3]}' if row[3] else ''}") for row in rows)
    newest = {row[1]: LedgerName(row[1], f"the newest is {row[0]}") for row in reversed(rows)}
    return (*ids, *newest.values())


def runs(ledger: Path, beginning: str) -> tuple[LedgerName, ...]:
    """Return the ids of runs that begin so, failures first; raises like :func:`campaigns`."""
    query = (
        "SELECT id, scenario || '/' || sut || '/' || repeat, state, outcome, oracle FROM run"
        " WHERE id >= ? AND id < ?"
        " ORDER BY outcome <> 'fail', serial LIMIT ?"
    )
    with _opened(ledger) as book:
        found = book.execute(query, (beginning, beginning + _AFTER_ANY_TEXT, MOST_NAMES)).fetchall()
    return tuple(
        LedgerName(name, " ".join(filter(None, (outcome or state, label, oracle))))
        for name, label, state, outcome, oracle in found
    )


def oracles(ledger: Path, run: str) -> tuple[LedgerName, ...]:
    """Return the oracles of a run, or of all of a campaign; raises like :func:`campaigns`."""
    query = "SELECT body FROM spec WHERE run = ? OR run = ? LIMIT 1"
    with _opened(ledger) as book:
        row = book.execute(query, (run, f"{run}.0")).fetchone()
        body = json.loads(row[0]) if row else {"oracles": []}
        if isinstance(body, list):
            # [cell, script, repeat, seed]: the oracles are the cell's.
            cell = book.execute("SELECT body FROM part WHERE name = ?", (body[0],)).fetchone()
            body = json.loads(cell[0])
    found = body["oracles"]
    return tuple(LedgerName(oracle["name"], oracle["text"]) for oracle in found)


def column_values(ledger: Path, campaign: str, columns: Sequence[str]) -> tuple[LedgerName, ...]:
    """Return scenarios, systems under test or oracles that decided, of a campaign or of all.

    ``columns`` are among ``scenario``, ``sut`` and ``oracle``. Raises like :func:`campaigns`.
    """
    whose = (
        "WHERE campaign ="
        " (SELECT id FROM campaign WHERE id = ?1 OR name = ?1 ORDER BY serial DESC LIMIT 1)"
    )
    found: dict[str, LedgerName] = {}
    with _opened(ledger) as book:
        for column in columns:
            if column not in ("scenario", "sut", "oracle"):
                raise ValueError(f"{column} is no column of names")
            where, values = (whose, (campaign,)) if campaign else ("", ())
            query = f"SELECT DISTINCT {column} FROM run {where} LIMIT {MOST_NAMES}"
            for (name,) in book.execute(query, values):
                found.setdefault(name, LedgerName(name, column))
    return tuple(named for name, named in found.items() if name)


@contextmanager
def _opened(ledger: Path) -> Iterator[sqlite3.Connection]:
    address = f"{ledger.absolute().as_uri()}?mode=ro"
    with closing(sqlite3.connect(address, uri=True, timeout=_LOCK_TIMEOUT)) as connection:
        yield connection
