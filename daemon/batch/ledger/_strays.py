"""Files in a state directory that nobody needs any more, and how they go.

Killed processes leave temporary files, uploads that nobody goes on with, spools; submissions that
were refused leave scenes and files. Nothing goes that was touched lately: a campaign on its way
refers to scenes and files before the ledger knows it, and whoever admits it touches them.
"""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from daemon.batch.errors import DaemonError
from daemon.batch.ledger._connection import check_present, connect_reader
from daemon.batch.ledger._inputs import needed_inputs
from daemon.batch.locks import is_locked
from daemon.batch.paths import StatePaths
from daemon.model.ids import is_digest, is_id

StrayKind: TypeAlias = Literal[
    "upload given up",
    "temporary file",
    "scene of no campaign",
    "file of no campaign",
    "files of no search",
    "empty trace folder",
    "traces of a deleted campaign",
    "spool of a dead worker",
    "copy not used for long",
]

_GRACE: Final = 3600.0
"""Seconds since it was touched during which somebody may be about to use a file."""
_SPOOL_GRACE: Final = 7 * 86_400.0
"""Seconds during which a worker that starts may give back what a dead one has left."""
_FINISHED: Final = "*/attempt-*/result.json"
"""The results in a worker's spool: a spool with one stays until somebody has delivered it."""
_COPY_GRACE: Final = 30 * 86_400.0
"""Seconds without use after which a worker's copy of a scene or a file goes."""
# Of grammars.text.files.replacing; of a trace that is being written.
_TEMPORARY: Final = re.compile(r"\..+\.[0-9a-f]{8}\.tmp|.+\.partial")

_DELETED: Final = (
    "SELECT DISTINCT campaign FROM event WHERE kind = 'campaign' AND state = 'deleted'"
    " AND campaign NOT IN (SELECT id FROM campaign)"
)


@dataclass(frozen=True, slots=True)
class StrayFile:
    """A file or a folder that nobody needs, and how many bytes it takes."""

    what: StrayKind
    path: Path
    bytes: int


def find_strays(paths: StatePaths, now: float) -> tuple[StrayFile, ...]:
    """Look for what nobody needs; ``now`` is the wall clock [s].

    Changes nothing, a daemon may be working. Raises :class:`DaemonError` when the ledger cannot
    say what is needed, and ``OSError``.
    """
    return tuple(_find(paths, now, _read_ledger(paths)))


def remove_strays(paths: StatePaths, now: float) -> tuple[StrayFile, ...]:
    """Remove what nobody needs, and return what went; raises like :func:`find_strays`."""
    gone = [stray for stray in find_strays(paths, now) if _remove(stray, now)]
    return tuple(gone)


@dataclass(frozen=True, slots=True)
class _Needed:
    """Digests of scenes and files that runs need, and campaigns: those that are not finished,
    searches, those that were deleted.
    """

    inputs: frozenset[str]
    unfinished: frozenset[str]
    searches: frozenset[str]
    deleted: frozenset[str]


def _read_ledger(paths: StatePaths) -> _Needed:
    check_present(paths.ledger)
    try:
        with closing(connect_reader(paths.ledger)) as db:
            needed = needed_inputs(db)
            unfinished = db.execute("SELECT id FROM campaign WHERE finished_at IS NULL").fetchall()
            searches = db.execute("SELECT campaign FROM search").fetchall()
            deleted = db.execute(_DELETED).fetchall()
    except sqlite3.Error as error:
        raise DaemonError(f"{paths.ledger} does not say what is needed: {error}") from error
    named = (frozenset(row[0] for row in rows) for rows in (unfinished, searches, deleted))
    return _Needed(needed, *named)


def _find(paths: StatePaths, now: float, needed: _Needed) -> Iterator[StrayFile]:
    yield from _old("upload given up", _entries(paths.incoming), now, _GRACE)
    yield from _find_temporary(paths, now)
    scenes = (
        p for p in _entries(paths.scenes) if p.suffix == ".json" and p.stem not in needed.inputs
    )
    yield from _old("scene of no campaign", scenes, now, _GRACE)
    files = (p for p in _entries(paths.files) if is_digest(p.name) and p.name not in needed.inputs)
    yield from _old("file of no campaign", files, now, _GRACE)
    # One that is being submitted has a dot before its name.
    bundles = (p for p in _folders(paths.searches) if is_id(p.name))
    unknown = (p for p in bundles if p.name not in needed.searches)
    yield from _old("files of no search", unknown, now, _GRACE)
    for folder in _folders(paths.traces):
        if folder.name in needed.deleted:
            # The daemon died between the commit and their end.
            yield from _old("traces of a deleted campaign", [folder], now, _GRACE)
        elif folder.name not in needed.unfinished and not any(folder.iterdir()):
            yield from _old("empty trace folder", [folder], now, _GRACE)
    yield from _find_spools(paths, now)
    # What workers keep here that have another daemon.
    for there in paths.caches:
        yield from _find_temporary(there, now)
        copies = (p for p in (*_entries(there.scenes), *_entries(there.files)) if p.name[0] != ".")
        yield from _old("copy not used for long", copies, now, _COPY_GRACE)
        yield from _find_spools(there, now)


def _find_temporary(paths: StatePaths, now: float) -> Iterator[StrayFile]:
    kept = (paths.state, paths.scenes, paths.files, paths.searches, paths.traces)
    for folder in (*kept, *_folders(paths.traces)):
        left = (path for path in _entries(folder) if _TEMPORARY.fullmatch(path.name))
        yield from _old("temporary file", left, now, _GRACE)


def _find_spools(paths: StatePaths, now: float) -> Iterator[StrayFile]:
    for folder in _folders(paths.spool):
        # One that is being made has a dot before its name, and nothing in it yet.
        unborn = folder.name.startswith(".")
        if unborn or (is_id(folder.name) and not any(folder.glob(_FINISHED))):
            used = max((_touched(path) for path in (folder, *folder.rglob("*"))), default=0.0)
            grace = _GRACE if unborn else _SPOOL_GRACE
            if now - used > grace and not is_locked(folder / "lock"):
                yield StrayFile("spool of a dead worker", folder, _size(folder))


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def _folders(folder: Path) -> list[Path]:
    return [path for path in _entries(folder) if path.is_dir() and not path.is_symlink()]


def _old(what: StrayKind, paths: Iterable[Path], now: float, grace: float) -> Iterator[StrayFile]:
    for path in paths:
        with suppress(FileNotFoundError):
            if now - path.lstat().st_mtime > grace:
                yield StrayFile(what, path, _size(path))


def _touched(path: Path) -> float:
    with suppress(FileNotFoundError):
        return path.lstat().st_mtime
    return 0.0


def _size(path: Path) -> int:
    total = 0
    for each in (path, *path.rglob("*")) if path.is_dir() else (path,):
        with suppress(FileNotFoundError):
            total += each.lstat().st_size if not each.is_dir() else 0
    return total


def _remove(stray: StrayFile, now: float) -> bool:
    """Remove it unless somebody came to need it; returns whether it is gone."""
    path = stray.path
    if stray.what == "empty trace folder":
        # Refused by the system when a trace has come.
        with suppress(OSError):
            path.rmdir()
            return True
        return False
    # Under another name first: who wants to use it now finds that it is not there and brings it
    # again, and who has touched it just before gets it back.
    aside = path.with_name(f".{path.name}.{os.urandom(4).hex()}.tmp")
    try:
        path.rename(aside)
    except FileNotFoundError:
        return False
    touched = now - aside.lstat().st_mtime < _GRACE and not path.exists()
    if touched or (aside.is_dir() and is_locked(aside / "lock")):
        aside.rename(path)
        return False
    if aside.is_dir():
        shutil.rmtree(aside)
    else:
        aside.unlink()
    return True
