"""Names in a ledger: campaigns, runs, scenarios, systems under test, oracles.

For completion at every TAB: reads the ledger directly, without a daemon and without the package
that keeps it, whose import takes too long for completion. It never writes. All functions raise
``sqlite3.Error`` when the ledger cannot be read.
"""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any, Final

MOST_NAMES: Final = 200
"""Most names in one answer."""

# Another program may hold the ledger for long; no names are better than a hanging shell.
_LOCK_TIMEOUT: Final = 0.1
_AFTER_ANY_TEXT: Final = "\U0010ffff"
"""Suffix that makes a text sort after every text with this prefix."""


def campaigns(ledger: Path) -> list[tuple[str, str, str]]:
    """Return id, name and a few words about each campaign, the newest first."""
    query = "SELECT id, name, total, about FROM campaign ORDER BY serial DESC LIMIT ?"
    return [
        (id, name, f"{total} runs{f', {about}' if about else ''}")
        for id, name, total, about in _select(ledger, query, MOST_NAMES)
    ]


def runs(ledger: Path, beginning: str) -> list[tuple[str, str]]:
    """Return ids of runs with this beginning, and the state of each, failures first."""
    # By comparison, not LIKE: it uses the index on ids, and % and _ need no escape.
    query = (
        "SELECT id, scenario || '/' || sut || '/' || repeat, state, outcome, oracle FROM run"
        " WHERE id >= ? AND id < ? AND state <> 'reserve'"
        " ORDER BY outcome <> 'fail', serial LIMIT ?"
    )
    rows = _select(ledger, query, beginning, beginning + _AFTER_ANY_TEXT, MOST_NAMES)
    return [
        (name, " ".join(filter(None, (outcome or state, label, oracle))))
        for name, label, state, outcome, oracle in rows
    ]


def oracles(ledger: Path, run: str) -> list[tuple[str, str]]:
    """Return name and text of the oracles of a run, or of a campaign."""
    query = (
        "SELECT body FROM run JOIN cell ON cell.campaign = run.campaign AND number = cell"
        " WHERE id IN (?, ? || '.0') LIMIT 1"
    )
    cells = [json.loads(body) for (body,) in _select(ledger, query, run, run)]
    return [(oracle["name"], oracle["text"]) for cell in cells for oracle in cell["oracles"]]


def layers(ledger: Path, campaign: str) -> list[tuple[str, str]]:
    """Return scenarios, systems under test and deciding oracles of one or all campaigns."""
    newest = "SELECT id FROM campaign WHERE ? IN (id, name) ORDER BY serial DESC LIMIT 1"
    where = f"campaign = ({newest})" if campaign else "? = ''"
    columns: dict[str, str] = {}
    for column in ("scenario", "sut", "oracle"):
        query = f"SELECT DISTINCT {column} FROM run WHERE {where} LIMIT ?"
        for (name,) in _select(ledger, query, campaign, MOST_NAMES):
            columns.setdefault(name, column)
    return [(name, column) for name, column in columns.items() if name]


def _select(ledger: Path, query: str, *values: str | int) -> list[Any]:
    # mode=ro: otherwise connecting to a missing ledger would create an empty file.
    address = f"{ledger.absolute().as_uri()}?mode=ro"
    with closing(sqlite3.connect(address, uri=True, timeout=_LOCK_TIMEOUT)) as db:
        return db.execute(query, values).fetchall()
