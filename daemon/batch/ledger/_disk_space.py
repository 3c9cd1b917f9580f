"""Freeing disk space: traces of finished campaigns, and unused files.

The ledger keeps every run, verdict and margin; rows of runs note the missing trace. Traces are
removed under the ledger's write lock, a few at a time, after another check that their campaign is
finished: a running daemon cannot restart the campaign in between.

Killed processes leave temporary files, abandoned uploads and spools; refused submissions leave
scenes and files. Recently touched files stay: a campaign in submission refers to scenes and files
before it is in the ledger, and its admission touches them.
"""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from daemon.batch.errors import DaemonError
from daemon.batch.ledger._connection import UNREADABLE, check_current, check_present, open_reader
from daemon.batch.ledger._entry import needed_inputs
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
"""Time for which a touched file may still be about to be used [s]."""
_SPOOL_GRACE: Final = 7 * 86_400.0
"""Time for which a new worker may still deliver the results of a dead one [s]."""
_UNDELIVERED: Final = "*/attempt-*/result.json"
"""Results in a worker's spool: a spool with one stays until they are delivered."""
_LONG_GRACE: Final = 30 * 86_400.0
"""Time without use after which a worker's copy of an input, or a file set aside, is removed [s]."""
# Of grammars.text.files.replacing; of a trace that is being written.
_TEMPORARY: Final = re.compile(r"\..+\.[0-9a-f]{8}\.tmp|.+\.partial")

_DELETED: Final = (
    "SELECT DISTINCT campaign FROM event WHERE kind = 'campaign' AND state = 'deleted'"
    " AND campaign NOT IN (SELECT id FROM campaign)"
)
# Traces removed while the daemon's writer waits: some milliseconds.
_BATCH: Final = 64
# Either sign is enough to keep traces, since removal is final.
_UNFINISHED: Final = (
    "SELECT id FROM campaign WHERE finished_at IS NULL UNION"
    " SELECT campaign FROM tally WHERE state IN ('queued', 'running') AND runs > 0"
)
_FINISHED: Final = (
    f"SELECT id, finished_at FROM campaign WHERE id NOT IN ({_UNFINISHED})"
    " ORDER BY finished_at, serial"
)
_USED: Final = (
    "SELECT source.trace_name FROM run JOIN run AS source ON source.id = run.cached"
    f" WHERE run.cached <> '' AND run.campaign IN ({_UNFINISHED})"
)
"""Traces of finished campaigns whose results unfinished ones reuse."""


@dataclass(frozen=True, slots=True)
class RetentionPolicy:
    """Limits of traces to keep: those of the ``newest`` finished campaigns, of campaigns finished
    at most ``age`` seconds ago, and ``size`` bytes in all; ``None`` sets no limit.
    """

    newest: int | None = None
    age: float | None = None
    size: int | None = None

    def choose(
        self, stored: Sequence[StoredTrace], everything: int, now: float
    ) -> tuple[StoredTrace, ...]:
        """Return the ``stored`` traces of finished campaigns to remove, oldest first.

        ``everything`` is the size of all traces [B], including those that must stay.
        """
        campaigns = list(dict.fromkeys(trace.campaign for trace in stored))
        newest = len(campaigns) if self.newest is None else self.newest
        outnumbered = set(campaigns[: max(0, len(campaigns) - newest)])
        total, choice = everything, []
        for trace in stored:
            is_old = self.age is not None and now - trace.finished_at > self.age
            is_beyond = self.size is not None and total > self.size
            if is_old or is_beyond or trace.campaign in outnumbered:
                choice.append(trace)
                total -= trace.size
        return tuple(choice)


@dataclass(frozen=True, slots=True)
class StoredTrace:
    """A stored trace of a finished campaign, of ``size`` bytes."""

    campaign: str
    name: str
    size: int
    finished_at: float


@dataclass(frozen=True, slots=True)
class SweepResult:
    """Removed ``traces``, or with ``dry`` those to remove, oldest first; ``rest`` bytes stay."""

    traces: tuple[StoredTrace, ...]
    rest: int

    @property
    def freed(self) -> int:
        """Freed bytes."""
        return sum(trace.size for trace in self.traces)


def sweep_traces(
    paths: StatePaths, policy: RetentionPolicy, now: float, *, dry: bool = False
) -> SweepResult:
    """Remove the traces beyond the limits of ``policy``; with ``dry`` only report them.

    ``now`` is the wall clock [s]. A daemon may be running. Raises :class:`DaemonError` without a
    ledger of this version, and ``OSError`` when a trace cannot be removed.
    """
    with _ledger(paths) as db:
        everything = stored_bytes(paths)
        traces = policy.choose(tuple(_stored(db, paths)), everything, now)
        if not dry:
            traces = _remove(db, paths, traces)
    return SweepResult(traces, everything - sum(trace.size for trace in traces))


@contextmanager
def _ledger(paths: StatePaths) -> Iterator[sqlite3.Connection]:
    check_present(paths.ledger)
    with closing(sqlite3.connect(paths.ledger, isolation_level=None)) as db:
        try:
            check_current(db, paths.ledger)
            yield db
        except UNREADABLE as error:
            raise DaemonError(f"{paths.ledger} cannot be used: {error}") from error


def _stored(db: sqlite3.Connection, paths: StatePaths) -> Iterator[StoredTrace]:
    used = {row[0] for row in db.execute(_USED)}
    for campaign, finished_at in db.execute(_FINISHED).fetchall():
        rows = db.execute(
            "SELECT trace_name FROM run WHERE campaign = ? ORDER BY finished_at, serial",
            (campaign,),
        )
        for (name,) in rows:
            size = _size(paths.trace(name))
            if size is not None and name not in used:
                yield StoredTrace(campaign, name, size, finished_at)


def _size(path: Path) -> int | None:
    try:
        return path.lstat().st_size
    except FileNotFoundError:
        return None


def stored_bytes(paths: StatePaths) -> int:
    """Return the size of all traces [B], including those of unfinished and unknown campaigns."""
    return sum(_size(path) or 0 for path in matching_paths(paths.traces, "*/*.mcap"))


def _remove(
    db: sqlite3.Connection, paths: StatePaths, traces: tuple[StoredTrace, ...]
) -> tuple[StoredTrace, ...]:
    removed: list[StoredTrace] = []
    for start in range(0, len(traces), _BATCH):
        # The write lock, without writing: no daemon can restart one of these campaigns or reuse its
        # results between the check and the removal.
        db.execute("BEGIN IMMEDIATE")
        try:
            finished = {row[0] for row in db.execute(_FINISHED)}
            used = {row[0] for row in db.execute(_USED)}
            for trace in traces[start : start + _BATCH]:
                if trace.campaign in finished and trace.name not in used:
                    paths.trace(trace.name).unlink(missing_ok=True)
                    removed.append(trace)
        finally:
            db.execute("ROLLBACK")
    return tuple(removed)


@dataclass(frozen=True, slots=True)
class StrayFile:
    """An unused file or folder, and its size in bytes."""

    what: StrayKind
    path: Path
    bytes: int


@dataclass(frozen=True, slots=True)
class Removal:
    """Removed traces and stray files, or with ``dry_run`` those to remove.

    ``freed`` and ``kept`` are bytes of traces alone.
    """

    state: Path
    dry_run: bool
    freed: int
    kept: int
    traces: tuple[StoredTrace, ...]
    strays: tuple[StrayFile, ...]


def find_strays(paths: StatePaths, now: float) -> tuple[StrayFile, ...]:
    """Return the unused files; ``now`` is the wall clock [s].

    Changes nothing; a daemon may be running. Raises :class:`DaemonError` when the ledger cannot be
    read, and ``OSError``.
    """
    check_present(paths.ledger)
    with open_reader(paths.ledger) as db:
        inputs = needed_inputs(db)
        unfinished, deleted = (
            frozenset(campaign for (campaign,) in db.execute(query))
            for query in (_UNFINISHED, _DELETED)
        )
    return tuple(
        StrayFile(what, path, sum(_size(each) or 0 for each in _whole(path) if not each.is_dir()))
        for what, candidates, grace in _candidates(paths, inputs, unfinished, deleted)
        for path in sorted(candidates)
        if now - _last_use(path, whole=path.parent.name == "spool") > grace
    )


def remove_strays(paths: StatePaths, now: float) -> tuple[StrayFile, ...]:
    """Remove unused files and return the removed ones; raises as :func:`find_strays`.

    Files that cannot be removed stay.
    """
    return tuple(stray for stray in find_strays(paths, now) if _remove_stray(stray, now))


_Candidates: TypeAlias = Iterator[tuple[StrayKind, Iterable[Path], float]]


def _candidates(
    paths: StatePaths, inputs: frozenset[str], unfinished: frozenset[str], deleted: frozenset[str]
) -> _Candidates:
    """Yield possibly unused paths, and the time [s] without a touch after which they are.

    ``inputs`` are the digests of needed scenes and files, the others ids of campaigns.
    """
    yield "upload given up", paths.incoming.glob("*"), _GRACE
    scenes = (p for p in paths.scenes.glob("[!.]*.json") if p.stem not in inputs)
    yield "scene of no campaign", scenes, _GRACE
    files = (p for p in paths.files.glob("*") if is_digest(p.name) and p.name not in inputs)
    yield "file of no campaign", files, _GRACE
    traces = _folders(paths.traces)
    # If the daemon died between the commit and their removal.
    yield "traces of a deleted campaign", (p for p in traces if p.name in deleted), _GRACE
    others = (p for p in traces if p.name not in unfinished | deleted)
    yield "empty trace folder", (p for p in others if not any(p.iterdir())), _GRACE
    yield from _leavings(paths)
    for cache in paths.caches:
        yield from _leavings(cache)
        copies = (*cache.scenes.glob("[!.]*"), *cache.files.glob("[!.]*"))
        yield "copy not used for long", copies, _LONG_GRACE


def _leavings(paths: StatePaths) -> _Candidates:
    """Yield leftovers of killed daemons and workers in one of their folders."""
    folders = (paths.state, paths.scenes, paths.files, *_folders(paths.traces), paths.traces)
    inside = (path for folder in folders for path in matching_paths(folder, "*"))
    yield "temporary file", (p for p in inside if _TEMPORARY.fullmatch(p.name)), _GRACE
    spools = [folder for folder in _folders(paths.spool) if not is_locked(folder / "lock")]
    # A new spool begins with a dot, and is still empty.
    yield "spool of a dead worker", (p for p in spools if p.name.startswith(".")), _GRACE
    empty = (p for p in spools if is_id(p.name) and not any(matching_paths(p, _UNDELIVERED)))
    yield "spool of a dead worker", empty, _SPOOL_GRACE
    yield "moved aside long ago", paths.aside.glob("*"), _LONG_GRACE


def _folders(folder: Path) -> list[Path]:
    return [path for path in matching_paths(folder, "*") if path.is_dir() and not path.is_symlink()]


def _whole(path: Path) -> Iterator[Path]:
    """Yield a path and everything below it, without paths that others remove meanwhile."""
    yield path
    for folder, folders, files in os.walk(path):
        yield from (Path(folder, name) for name in (*folders, *files))


def _last_use(path: Path, *, whole: bool) -> float:
    """Return the last change of a file or folder, with ``whole`` including its contents."""
    times = [0.0]
    for each in _whole(path) if whole else (path,):
        with suppress(FileNotFoundError):
            times.append(each.lstat().st_mtime)
    return max(times) if len(times) > 1 else float("inf")


def _remove_stray(stray: StrayFile, now: float) -> bool:
    """Remove a stray unless it has just been touched; return whether it is gone."""
    path = stray.path
    # Rename it first: a new user finds it missing and brings it again; a process that has just
    # touched it gets it back.
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
