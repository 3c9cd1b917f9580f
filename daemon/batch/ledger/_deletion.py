"""Campaigns taken out of the ledger: their rows and traces, what nothing refers to, and the space.

They are hidden before (``campaign.visible``), and so is what was never entered as a whole.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from daemon.batch.ledger._steps import STEP_ROWS, Steps
from daemon.batch.paths import StatePaths

_HIDDEN: Final = "SELECT id FROM campaign WHERE visible = 0 ORDER BY serial"
_OF_RUNS: Final = ("result", "spec")
"""Tables with rows about a run, in its column ``run``."""
_PAGES: Final = 200
"""Pages given back in one step."""


def hides_anything(db: sqlite3.Connection) -> bool:
    """Whether there is a campaign to remove."""
    return db.execute(f"{_HIDDEN} LIMIT 1").fetchone() is not None


def remove_hidden(db: sqlite3.Connection, paths: StatePaths) -> Steps[int]:
    """Remove every hidden campaign with its traces; returns how many there were."""
    names = [row[0] for row in db.execute(_HIDDEN)]
    for campaign in names:
        yield from remove_campaign(db, paths, campaign)
    if names:
        yield from _remove_unused_parts(db)
        yield from _give_back_pages(db)
    return len(names)


def remove_campaign(db: sqlite3.Connection, paths: StatePaths, campaign: str) -> Steps[None]:
    """Remove a hidden campaign; given up in the middle, it is begun again where it was left."""
    folder = paths.traces / campaign
    has_traces = folder.is_dir()
    while rows := db.execute(
        "SELECT id, trace_name FROM run WHERE campaign = ? ORDER BY position LIMIT ?",
        (campaign, STEP_ROWS),
    ).fetchall():
        _hand_over(db, paths, dict(rows))
        if has_traces:
            for _, name in rows:
                paths.trace(name).unlink(missing_ok=True)
        runs = [(run,) for run, _ in rows]
        for table in _OF_RUNS:
            db.executemany(f"DELETE FROM {table} WHERE run = ?", runs)
        db.executemany("DELETE FROM run WHERE id = ?", runs)
        yield
    while db.execute(
        "DELETE FROM reserve WHERE campaign = ?1 AND position IN"
        " (SELECT position FROM reserve WHERE campaign = ?1 LIMIT ?2)",
        (campaign, STEP_ROWS),
    ).rowcount:
        yield
    while db.execute(
        "DELETE FROM proposal WHERE campaign = ?1 AND position IN"
        " (SELECT position FROM proposal WHERE campaign = ?1 LIMIT ?2)",
        (campaign, STEP_ROWS),
    ).rowcount:
        yield
    if db.execute("DELETE FROM search WHERE campaign = ?", (campaign,)).rowcount:
        # Before the commit: a folder that is left is looked at by nobody but the housekeeping.
        shutil.rmtree(paths.search(campaign), ignore_errors=True)
    # The last word about it stays: who was away learns that it is gone.
    db.execute("DELETE FROM event WHERE campaign = ? AND state <> 'deleted'", (campaign,))
    db.execute("DELETE FROM tally WHERE campaign = ?", (campaign,))
    db.execute("DELETE FROM campaign WHERE id = ?", (campaign,))
    if has_traces:
        with suppress(OSError):  # something else lies in it, or it is gone
            folder.rmdir()
    yield


def _hand_over(db: sqlite3.Connection, paths: StatePaths, traces: dict[str, str]) -> None:
    """Let runs elsewhere that took results of these have their traces.

    ``traces`` are names by run. The first that took the result of a run gets its trace, and all
    others are led to that one.
    """
    marks = ", ".join("?" * len(traces))
    users = db.execute(
        f"SELECT cached, id, trace_name FROM run WHERE cached IN ({marks}) AND cached <> ''"
        " ORDER BY serial",
        tuple(traces),
    ).fetchall()
    heirs: dict[str, str] = {}
    for source, run, name in users:
        if source in heirs:
            db.execute("UPDATE run SET cached = ? WHERE id = ?", (heirs[source], run))
            continue
        heirs[source] = run
        db.execute("UPDATE run SET cached = '' WHERE id = ?", (run,))
        _move_trace(paths, traces[source], name)


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


def _remove_unused_parts(db: sqlite3.Connection) -> Steps[None]:
    """Remove cells and scripts of no run; only while nothing is being entered."""
    db.execute("CREATE TEMP TABLE IF NOT EXISTS used_part (name TEXT PRIMARY KEY) WITHOUT ROWID")
    db.execute("DELETE FROM used_part")
    # The reserve first: what becomes a run meanwhile has been seen there, or will be seen below.
    last: Sequence[object] = ("", -1)
    while rows := db.execute(
        "SELECT campaign, position, body FROM reserve WHERE (campaign, position) > (?, ?)"
        " ORDER BY campaign, position LIMIT ?",
        (*last, STEP_ROWS),
    ).fetchall():
        last = rows[-1][:2]
        _mark(db, [row[2] for row in rows])
        yield
    run = ""
    while rows := db.execute(
        "SELECT run, body FROM spec WHERE run > ? ORDER BY run LIMIT ?", (run, STEP_ROWS)
    ).fetchall():
        run = rows[-1][0]
        _mark(db, [row[1] for row in rows])
        yield
    name = ""
    while rows := db.execute(
        "SELECT name, name IN (SELECT name FROM used_part) FROM part WHERE name > ?"
        " ORDER BY name LIMIT ?",
        (name, STEP_ROWS),
    ).fetchall():
        name = rows[-1][0]
        db.executemany("DELETE FROM part WHERE name = ?", [row[:1] for row in rows if not row[1]])
        yield
    db.execute("DELETE FROM used_part")


def _mark(db: sqlite3.Connection, bodies: Sequence[bytes]) -> None:
    # A body is a list of the names of its cell and its script, the repeat and the seed.
    packed = [bytes(body) for body in bodies]
    names = {body[2:34] for body in packed} | {body[37:69] for body in packed}
    rows = [(name.decode(),) for name in names]
    db.executemany("INSERT OR IGNORE INTO used_part VALUES (?)", rows)


def _give_back_pages(db: sqlite3.Connection) -> Steps[None]:
    """Shorten the file by the pages that are free in it."""
    while db.execute("PRAGMA freelist_count").fetchone()[0]:
        db.execute(f"PRAGMA incremental_vacuum({_PAGES})").fetchall()
        yield
