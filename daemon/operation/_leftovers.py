"""What was left behind by something that was killed, or is not known to the ledger."""

from __future__ import annotations

import fcntl
import shlex
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from urllib.parse import quote

from daemon.operation._findings import Finding, ok, warning
from daemon.places import Places, is_id

_SHOWN = 3


def check_leftovers(places: Places, here: Path) -> Iterator[Finding]:
    """Look for partial traces, orphan spools, unknown traces, and workshops at and below ``here``.

    Locks are tried for a moment, shared; nothing is changed.
    """
    found = [
        *_finding("partial traces", _partial(places), "remove them while no worker runs: {remove}"),
        *_finding(
            "spools of dead workers",
            _orphans(places),
            "the next worker to start delivers what is finished and removes them",
        ),
        *_finding("traces unknown to the ledger", _unknown(places), "if unwanted: {remove}"),
        *_finding(
            "workshops of interrupted runs",
            _workshops(here),
            "if no `scenario run` uses them: {remove}",
        ),
    ]
    yield from found or [ok("leftovers", "none")]


def _finding(what: str, paths: Iterable[Path], remedy: str) -> Iterator[Finding]:
    found = sorted(paths)
    if not found:
        return
    names = " ".join(shlex.quote(str(path)) for path in found[:_SHOWN])
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    message = f"{what}: {', '.join(str(path) for path in found[:_SHOWN])}{more}"
    yield warning("leftovers", message, remedy.format(remove=f"rm -r {names}"))


def _partial(places: Places) -> Iterator[Path]:
    for pattern in ("*/.*.tmp", "*/*.partial"):
        yield from places.traces.glob(pattern)


def _orphans(places: Places) -> Iterator[Path]:
    for folder in places.spool.glob("*"):
        if is_id(folder.name) and (folder / "lock").exists() and not locked(folder / "lock"):
            yield folder


def _unknown(places: Places) -> tuple[Path, ...]:
    known: set[str] = set()
    if places.ledger.exists():
        uri = f"file:{quote(str(places.ledger))}?mode=ro"
        try:
            with closing(sqlite3.connect(uri, uri=True)) as db:
                known = {row[0] for row in db.execute("SELECT id FROM campaign")}
        except sqlite3.Error:
            return ()  # the ledger's own finding says so
    return tuple(folder for folder in places.traces.glob("*") if folder.name not in known)


def _workshops(here: Path) -> Iterator[Path]:
    for pattern in (".scenario-*", "*/.scenario-*", "scenario-results/*/.scenario-*"):
        for folder in here.glob(pattern):
            if folder.is_dir() and not locked(folder / "daemon.lock"):
                yield folder


def locked(path: Path) -> bool:
    """Whether somebody holds the lock that ``path`` is."""
    with suppress(FileNotFoundError), path.open("rb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
