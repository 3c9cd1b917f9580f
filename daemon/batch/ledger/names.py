"""What can be named in a ledger: campaigns, runs, scenarios, systems under test, oracles.

For completion at every TAB: the ledger is read as it is, without a daemon and without its models,
which take longer to import than people wait for a word. Nothing is ever written. All functions
raise ``OSError`` or ``sqlite3.Error`` when the ledger cannot be read.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Final, NamedTuple

from daemon.batch.ledger._connection import connect_reader

MOST_NAMES: Final = 200
"""Names in one answer: nobody reads more."""

# Another program may hold the ledger for long; no names are better than a shell that hangs.
_LOCK_TIMEOUT: Final = 0.1
_AFTER_ANY_TEXT: Final = "\U0010ffff"
"""Behind every text that begins with what stands before it."""


class LedgerName(NamedTuple):
    """A name and what it is, in a few words."""

    name: str
    about: str


class CampaignName(NamedTuple):
    """A campaign by its ``id`` and by its ``name``, which others may have too."""

    id: str
    name: str
    about: str


def campaigns(ledger: Path) -> tuple[CampaignName, ...]:
    """Return the campaigns, the newest first."""
    query = "SELECT id, name, total, about FROM campaign ORDER BY serial DESC LIMIT ?"
    with closing(_open(ledger)) as db:
        rows = db.execute(query, (MOST_NAMES,)).fetchall()
    return tuple(
        CampaignName(row[0], row[1], f"{row[2]} runs{f', {row[3]}' if row[3] else ''}")
        for row in rows
    )


def ids_and_names(campaigns: Sequence[CampaignName]) -> tuple[LedgerName, ...]:
    """Return the ids of campaigns that come with the newest first, then each name once."""
    newest = {c.name: LedgerName(c.name, f"the newest is {c.id}") for c in reversed(campaigns)}
    return (*(LedgerName(c.id, c.about) for c in campaigns), *newest.values())


def runs(ledger: Path, beginning: str) -> tuple[LedgerName, ...]:
    """Return the ids of runs that begin so, failures first."""
    # By comparison, not LIKE: only that uses the index on ids, and % and _ need no escape.
    query = (
        "SELECT id, scenario || '/' || sut || '/' || repeat, state, outcome, oracle FROM run"
        " WHERE id >= ? AND id < ? AND state <> 'reserve'"
        " ORDER BY outcome <> 'fail', serial LIMIT ?"
    )
    with closing(_open(ledger)) as db:
        found = db.execute(query, (beginning, beginning + _AFTER_ANY_TEXT, MOST_NAMES)).fetchall()
    return tuple(
        LedgerName(name, " ".join(filter(None, (outcome or state, label, oracle))))
        for name, label, state, outcome, oracle in found
    )


def oracles(ledger: Path, run: str) -> tuple[LedgerName, ...]:
    """Return the oracles of a run, or of all of a campaign."""
    query = (
        "SELECT body FROM run JOIN cell ON cell.campaign = run.campaign AND number = cell"
        " WHERE id IN (?1, ?1 || '.0') LIMIT 1"
    )
    with closing(_open(ledger)) as db:
        row = db.execute(query, (run,)).fetchone()
    if row is None:
        return ()
    return tuple(LedgerName(one["name"], one["text"]) for one in json.loads(row[0])["oracles"])


def column_values(ledger: Path, campaign: str, columns: Sequence[str]) -> tuple[LedgerName, ...]:
    """Return scenarios, systems under test or oracles that decided, of a campaign or of all.

    ``columns`` are among ``scenario``, ``sut`` and ``oracle``.
    """
    of_campaign = (
        "WHERE campaign ="
        " (SELECT id FROM campaign WHERE id = ?1 OR name = ?1 ORDER BY serial DESC LIMIT 1)"
    )
    found: dict[str, LedgerName] = {}
    with closing(_open(ledger)) as db:
        for column in columns:
            if column not in ("scenario", "sut", "oracle"):
                raise ValueError(f"{column} is no column of names")
            where, values = (of_campaign, (campaign,)) if campaign else ("", ())
            query = f"SELECT DISTINCT {column} FROM run {where} LIMIT {MOST_NAMES}"
            for (name,) in db.execute(query, values):
                found.setdefault(name, LedgerName(name, column))
    return tuple(named for name, named in found.items() if name)


def _open(ledger: Path) -> sqlite3.Connection:
    return connect_reader(ledger, timeout=_LOCK_TIMEOUT)
