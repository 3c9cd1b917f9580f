"""Campaigns taken out of the ledger: their rows, their files and the space."""

from __future__ import annotations

import os
import sqlite3
from contextlib import suppress

from daemon.batch.paths import StatePaths


def remove_campaign(db: sqlite3.Connection, paths: StatePaths, campaign: str) -> None:
    """Remove the rows of a campaign; runs elsewhere that took its results get their traces.

    Its files are left for :func:`remove_files`: what is not committed has not happened.
    """
    _hand_over(db, paths, campaign)
    db.execute("DELETE FROM event WHERE campaign = ?", (campaign,))
    # Before the cells they have, for each of which SQLite looks for runs.
    db.execute("DELETE FROM run WHERE campaign = ?", (campaign,))
    db.execute("DELETE FROM campaign WHERE id = ?", (campaign,))


def shorten_file(db: sqlite3.Connection) -> None:
    """Shorten the file by all that is free in it."""
    (free,) = db.execute("PRAGMA freelist_count").fetchone()
    for _ in range(free):
        # However many pages it is told, Python's SQLite gives back one each time.
        db.execute("PRAGMA incremental_vacuum(1)")


def remove_files(paths: StatePaths, campaign: str) -> None:
    """Remove the traces of a campaign that is gone."""
    folder = paths.traces / campaign
    for trace in folder.glob("*.mcap"):
        trace.unlink(missing_ok=True)
    with suppress(OSError):  # something else lies in it, or it is gone
        folder.rmdir()


def _hand_over(db: sqlite3.Connection, paths: StatePaths, campaign: str) -> None:
    """Let runs elsewhere that took results of a campaign have their traces.

    The first that took the result of a run gets its trace, and all others are led to that one.
    """
    users = db.execute(
        "SELECT source.id, source.trace_name, run.id, run.trace_name FROM run"
        " JOIN run AS source ON source.id = run.cached"
        " WHERE run.cached <> '' AND source.campaign = ?1 AND run.campaign <> ?1"
        " ORDER BY run.serial",
        (campaign,),
    ).fetchall()
    heirs: dict[str, str] = {}
    for source, old, run, new in users:
        if source in heirs:
            db.execute("UPDATE run SET cached = ? WHERE id = ?", (heirs[source], run))
            continue
        heirs[source] = run
        db.execute("UPDATE run SET cached = '' WHERE id = ?", (run,))
        _move_trace(paths, old, new)


def _move_trace(paths: StatePaths, old: str, new: str) -> None:
    source, target = paths.trace(old), paths.trace(new)
    if target.exists() or not source.exists():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    # Linked, not moved: should this never be committed, it lies where it was as well.
    try:
        os.link(source, target)
    except OSError:
        source.replace(target)
