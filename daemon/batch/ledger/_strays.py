"""Files in a state directory that nobody needs any more, and how they go.

Killed processes leave temporary files, uploads that nobody goes on with, spools; submissions that
were refused leave scenes and files. Nothing goes that was touched lately: a campaign on its way
refers to scenes and files before the ledger knows it, and whoever admits it touches them.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from daemon.batch.ledger._connection import check_present, open_reader
from daemon.batch.ledger._entry import needed_inputs
from daemon.batch.ledger._retention import StoredTrace
from daemon.batch.paths import StatePaths, is_locked
from daemon.model.ids import is_digest, is_id
from grammars.text.files import matching_paths

StrayKind: TypeAlias = Literal[
    "upload given up",
    "temporary file",
    "scene of no campaign",
    "file of no campaign",
    "empty trace folder",
    "traces of a deleted campaign",
    "spool of a dead worker",
    "copy not used for long",
    "moved aside long ago",
]

_GRACE: Final = 3600.0
"""Seconds since it was touched during which somebody may be about to use a file."""
_SPOOL_GRACE: Final = 7 * 86_400.0
"""Seconds during which a worker that starts may give back what a dead one has left."""
_FINISHED: Final = "*/attempt-*/result.json"
"""The results in a worker's spool: a spool with one stays until somebody has delivered it."""
_LONG_GRACE: Final = 30 * 86_400.0
"""Seconds without use after which a worker's copy of an input goes, or a thing moved aside."""
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


@dataclass(frozen=True, slots=True)
class Removal:
    """Traces and stray files that were removed, or would be.

    ``freed`` and ``kept`` are bytes of traces alone.
    """

    state: Path
    dry_run: bool
    freed: int
    kept: int
    traces: tuple[StoredTrace, ...]
    strays: tuple[StrayFile, ...]


def find_strays(paths: StatePaths, now: float) -> tuple[StrayFile, ...]:
    """Look for what nobody needs; ``now`` is the wall clock [s].

    Changes nothing, a daemon may be working. Raises :class:`DaemonError` when the ledger cannot
    say what is needed, and ``OSError``.
    """
    needed = _read_ledger(paths)
    return tuple(
        StrayFile(what, path, sum(map(_bytes, _whole(path))))
        for what, found, grace in _candidates(paths, needed)
        for path in sorted(found)
        if now - _last_use(path, whole=path.parent.name == "spool") > grace
    )


def remove_strays(paths: StatePaths, now: float) -> tuple[StrayFile, ...]:
    """Remove what nobody needs, and return what went; raises like :func:`find_strays`.

    Whatever cannot be removed stays, and stays a stray.
    """
    return tuple(stray for stray in find_strays(paths, now) if _remove(stray, now))


@dataclass(frozen=True, slots=True)
class _Needed:
    """Digests of scenes and files that runs need, and campaigns: unfinished and deleted ones."""

    inputs: frozenset[str]
    unfinished: frozenset[str]
    deleted: frozenset[str]


def _read_ledger(paths: StatePaths) -> _Needed:
    check_present(paths.ledger)
    with open_reader(paths.ledger) as db:
        needed = needed_inputs(db)
        unfinished = db.execute("SELECT id FROM campaign WHERE finished_at IS NULL").fetchall()
        deleted = db.execute(_DELETED).fetchall()
    named = (frozenset(row[0] for row in rows) for rows in (unfinished, deleted))
    return _Needed(needed, *named)


_Candidates: TypeAlias = Iterator[tuple[StrayKind, Iterable[Path], float]]


def _candidates(paths: StatePaths, needed: _Needed) -> _Candidates:
    """Yield what may be superfluous, and for how long [s] it has to be untouched to be so."""
    yield "upload given up", paths.incoming.glob("*"), _GRACE
    scenes = (p for p in paths.scenes.glob("[!.]*.json") if p.stem not in needed.inputs)
    yield "scene of no campaign", scenes, _GRACE
    files = (p for p in paths.files.glob("*") if is_digest(p.name) and p.name not in needed.inputs)
    yield "file of no campaign", files, _GRACE
    traces = _folders(paths.traces)
    # The daemon died between the commit and their end.
    deleted = [folder for folder in traces if folder.name in needed.deleted]
    yield "traces of a deleted campaign", deleted, _GRACE
    others = (p for p in traces if p.name not in needed.unfinished | needed.deleted)
    yield "empty trace folder", (p for p in others if not any(p.iterdir())), _GRACE
    yield from _leavings(paths)
    for there in paths.caches:
        yield from _leavings(there)
        copies = (*there.scenes.glob("[!.]*"), *there.files.glob("[!.]*"))
        yield "copy not used for long", copies, _LONG_GRACE


def _leavings(paths: StatePaths) -> _Candidates:
    """Yield what killed daemons and workers leave in a folder of theirs."""
    kept = (paths.state, paths.scenes, paths.files, *_folders(paths.traces))
    inside = (path for folder in (*kept, paths.traces) for path in matching_paths(folder, "*"))
    yield "temporary file", (p for p in inside if _TEMPORARY.fullmatch(p.name)), _GRACE
    spools = [folder for folder in _folders(paths.spool) if not is_locked(folder / "lock")]
    # One that is being made has a dot before its name, and nothing in it yet.
    yield "spool of a dead worker", (p for p in spools if p.name.startswith(".")), _GRACE
    empty = (p for p in spools if is_id(p.name) and not any(matching_paths(p, _FINISHED)))
    yield "spool of a dead worker", empty, _SPOOL_GRACE
    yield "moved aside long ago", paths.aside.glob("*"), _LONG_GRACE


def _folders(folder: Path) -> list[Path]:
    return [path for path in matching_paths(folder, "*") if path.is_dir() and not path.is_symlink()]


def _whole(path: Path) -> Iterator[Path]:
    """Yield a path and all below it; what others remove meanwhile is passed over."""
    yield path
    for folder, folders, files in os.walk(path):
        yield from (Path(folder, name) for name in (*folders, *files))


def _last_use(path: Path, *, whole: bool) -> float:
    """Return when a file or folder was touched last, or anything in it if it counts as a whole."""
    times = [0.0]
    for each in _whole(path) if whole else (path,):
        with suppress(FileNotFoundError):
            times.append(each.lstat().st_mtime)
    return max(times) if len(times) > 1 else float("inf")


def _bytes(path: Path) -> int:
    with suppress(FileNotFoundError):
        return 0 if path.is_dir() else path.lstat().st_size
    return 0


def _remove(stray: StrayFile, now: float) -> bool:
    """Remove it unless somebody came to need it; returns whether it is gone."""
    path = stray.path
    # Under another name first: who wants to use it now finds that it is not there and brings it
    # again, and who has touched it just before gets it back.
    aside = path.with_name(f".{path.name}.{os.urandom(4).hex()}.tmp")
    try:
        if stray.what == "empty trace folder":
            path.rmdir()  # refused by the system when a trace has come
            return True
        path.rename(aside)
        touched = now - aside.lstat().st_mtime < _GRACE and not path.exists()
        if touched or (aside.is_dir() and is_locked(aside / "lock")):
            aside.rename(path)
            return False
        if aside.is_dir() and not aside.is_symlink():
            shutil.rmtree(aside)
        else:
            aside.unlink()
    except OSError:
        return False
    return True
