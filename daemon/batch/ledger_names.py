"""What can be named in a ledger: campaigns, runs, scenarios, systems under test, oracles.

For completion at every TAB: the ledger is read as it is, without a daemon and without the package
that keeps it, whose models take longer to import than people wait for a word. Nothing is ever
written. All functions raise ``sqlite3.Error`` when the ledger cannot be read.
"""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any, Final

MOST_NAMES: Final = 200
"""Names in one answer: nobody reads more."""

# Another program may hold the ledger for long; no names are better than a shell that hangs.
_LOCK_TIMEOUT: Final = 0.1
_AFTER_ANY_TEXT: Final = "\U0010ffff"
"""Behind every text that begins with what stands before it."""


def campaigns(ledger: Path) -> list[tuple[str, str, str]]:
    """Return id, name and a few words about each campaign, the newest first."""
    query = "SELECT id, name, total, about FROM campaign ORDER BY serial DESC LIMIT ?"
    return [
        (id, name, f"{total} runs{f', {about}' if about else ''}")
        for id, name, total, about in _select(ledger, query, MOST_NAMES)
    ]


def runs(ledger: Path, beginning: str) -> list[tuple[str, str]]:
    """Return the ids of runs that begin so and how each stands, failures first."""
    # By comparison, not LIKE: only that uses the index on ids, and % and _ need no escape.
    query = (
        "SELECT id, scenario || '/' || sut || '/' || repeat, state, outcome, oracle FROM run"
        " WHERE id >= ? AND id < ? AND state <> 'reserve'"
        " ORDER BY outcome <> 'fail', serial LIMIT ?"
    )
    found = _select(ledger, query, beginning, beginning + _AFTER_ANY_TEXT, MOST_NAMES)
    return [
        (name, " ".join(filter(None, (outcome or state, label, oracle))))
        for name, label, state, outcome, oracle in found
    ]


def oracles(ledger: Path, run: str) -> list[tuple[str, str]]:
    """Return name and text of the oracles of a run, or of all of a campaign."""
    query = (
        "SELECT body FROM run JOIN cell ON cell.campaign = run.campaign AND number = cell"
        " WHERE id IN (?1, ?1 || '.0') LIMIT 1"
    )
    found = [json.loads(body)["oracles"] for (body,) in _select(ledger, query, run)]
    return [(one["name"], one["text"]) for oracles in found for one in oracles]


def layers(ledger: Path, campaign: str) -> list[tuple[str, str]]:
    """Return scenarios, systems under test and deciding oracles, of a campaign or of all."""
    newest = "SELECT id FROM campaign WHERE id = ?1 OR name = ?1 ORDER BY serial DESC LIMIT 1"
    where = f"campaign = ({newest})" if campaign else "?1 = ''"
    found: dict[str, str] = {}
    for column in ("scenario", "sut", "oracle"):
        query = f"SELECT DISTINCT {column} FROM run WHERE {where} LIMIT ?2"
        for (name,) in _select(ledger, query, campaign, MOST_NAMES):
            found.setdefault(name, column)
    return [(name, column) for name, column in found.items() if name]


def _select(ledger: Path, query: str, *values: str | int) -> list[Any]:
    # mode=ro: another connection would make an empty file where there is no ledger.
    address = f"{ledger.absolute().as_uri()}?mode=ro"
    with closing(sqlite3.connect(address, uri=True, timeout=_LOCK_TIMEOUT)) as db:
        return db.execute(query, values).fetchall()
