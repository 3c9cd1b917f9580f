"""Verification of the ledger and the folders beside it: each content is held against its digest."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias

from daemon.batch.errors import DaemonError
from daemon.batch.inputs import is_intact
from daemon.batch.ledger._connection import UNREADABLE, connect_reader
from daemon.batch.ledger._inputs import needed_inputs
from daemon.batch.ledger._results import read_engine_problems
from daemon.batch.paths import StatePaths
from daemon.batch.stores import file_sha256
from daemon.model.ids import is_digest
from daemon.model.spec import RunResult, run_digest, text_digest
from daemon.model.verdicts import deciding_verdict
from grammars.text import codec

VerificationProgress: TypeAlias = Callable[[str, int, int], None]
"""Gets what is looked at, how many of it were, and how many there are."""

_PAGE: Final = 500
_QUICK: Final = 1000
"""Results, and specifications, of a quick look: the newest."""
_NAMED: Final = 3

_RESULTS: Final = (
    "SELECT run.serial, run.id, run.digest, run.trace_name, run.trace_at, run.outcome, run.oracle,"
    " run.margin, run.unit, run.simulated, result.digest, result.body"
    " FROM run JOIN result ON result.run = run.id WHERE run.serial > ?"
    f" ORDER BY run.serial LIMIT {_PAGE}"
)
_SPECS: Final = (
    "SELECT run.serial, run.id, run.digest, cell.body, script.body, repeat, seed FROM run"
    " JOIN cell ON cell.campaign = run.campaign AND cell.number = run.cell"
    " JOIN script ON script.campaign = run.campaign AND script.number = run.script"
    f" WHERE run.serial > ? ORDER BY run.serial LIMIT {_PAGE}"
)


@dataclass(frozen=True, slots=True)
class ContentReport:
    """What was verified, by kind, and each kind of problem with the first that have it.

    ``missing`` are scenes and files of runs that wait; without them these cannot be executed. Nor
    can those of other engines, which ``foreign`` says in words.
    """

    results: int
    specifications: int
    scenes: int
    files: int
    traces: int
    problems: tuple[str, ...]
    missing: tuple[str, ...]
    foreign: tuple[str, ...]


@dataclass(slots=True)
class _Findings:
    """Names of what is wrong, by what is wrong with it."""

    by_words: defaultdict[str, list[str]] = field(default_factory=lambda: defaultdict(list))

    def add(self, words: str, name: str) -> None:
        self.by_words[words].append(name)

    @property
    def lines(self) -> tuple[str, ...]:
        return tuple(_line(words, names) for words, names in self.by_words.items())


def _line(words: str, names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{words}: {', '.join(names[:_NAMED])}{more}"


def verify_contents(
    paths: StatePaths,
    *,
    quick: bool = False,
    traces: bool = False,
    progress: VerificationProgress = lambda *_: None,
) -> ContentReport:
    """Hold results, specifications, scenes, files and traces against their digests.

    Of traces the size is looked at, the digest with ``traces``. A ``quick`` look is one at the
    newest results, and at no scene and no file. Nothing is locked for longer than some hundred
    rows take: a daemon may be working. Raises :class:`DaemonError` when the ledger cannot be read.
    """
    found = _Findings()
    try:
        with closing(connect_reader(paths.ledger)) as db:
            last = int(db.execute("SELECT ifnull(max(serial), 0) FROM run").fetchone()[0])
            start = max(0, last - _QUICK) if quick else 0
            results, seen = _verify_results(db, paths, found, (start, last), traces, progress)
            specs = _verify_specs(db, found, (start, last), progress)
            waiting = _waiting_inputs(db, found)
            foreign = dict.fromkeys(words for _, words in read_engine_problems(db))
    except UNREADABLE as error:
        raise DaemonError(f"{paths.ledger} cannot be read: {error}") from error
    scenes = files = 0
    if not quick:
        scenes = _verify_files(paths.scenes.glob("*.json"), "scenes", found, progress)
        kept = (path for path in paths.files.glob("*") if is_digest(path.name))
        files = _verify_files(kept, "files", found, progress)
    missing = _missing(paths, waiting)
    lines = found.lines
    return ContentReport(results, specs, scenes, files, seen, lines, missing, tuple(foreign))


def _waiting_inputs(db: sqlite3.Connection, found: _Findings) -> frozenset[str]:
    try:
        return needed_inputs(db, waiting=True)
    except sqlite3.OperationalError as error:
        found.add("specifications name no scene or no files", str(error))
        return frozenset()


def _pages(
    db: sqlite3.Connection, query: str, bounds: tuple[int, int], what: str,
    progress: VerificationProgress,
) -> Iterator[tuple[Any, ...]]:  # fmt: skip
    """Rows in parts: between them the ledger is nobody's, and its WAL can be emptied."""
    start, last = bounds
    at = start
    while rows := db.execute(query, (at,)).fetchall():
        for serial, *row in rows:
            at = serial
            yield tuple(row)
        progress(what, at - start, last - start)


def _verify_results(
    db: sqlite3.Connection,
    paths: StatePaths,
    found: _Findings,
    bounds: tuple[int, int],
    hashing: bool,
    progress: VerificationProgress,
) -> tuple[int, int]:
    """Verify results, and the traces they are about; returns how many of each."""
    results = traces = 0
    for run, spec, trace, url, *columns, digest, body in _pages(
        db, _RESULTS, bounds, "results", progress
    ):
        results += 1
        try:
            result = codec.from_json(RunResult, body)
        except ValueError:
            found.add("results cannot be read", run)
            continue
        if result.digest != digest:
            found.add("results differ from their digest", run)
        if result.spec != spec:
            found.add("results are of another specification than their run", run)
        if tuple(columns) != _columns(result):
            found.add("verdicts of runs differ from their results", run)
        if not url:
            traces += _verify_trace(paths, trace, result, hashing, found)
    return results, traces


def _columns(result: RunResult) -> tuple[object, ...]:
    verdict, simulated = deciding_verdict(result.verdicts), result.timing.simulated
    if verdict is None:
        return (str(result.outcome), "", None, "", simulated)
    return (str(result.outcome), verdict.oracle, verdict.margin, verdict.unit, simulated)


def _verify_trace(
    paths: StatePaths, name: str, result: RunResult, hashing: bool, found: _Findings
) -> int:
    try:
        path = paths.trace(name)
        size = path.stat().st_size
        if size != result.trace.size:
            found.add("traces have another size than was recorded", str(path))
        elif hashing and file_sha256(path) != result.trace.sha256:
            found.add("traces differ from their digest", str(path))
    except FileNotFoundError:
        return 0  # removed to make room: its run says so
    except (OSError, ValueError) as error:
        found.add("traces cannot be read", f"{name} ({error})")
    return 1


def _verify_specs(
    db: sqlite3.Connection,
    found: _Findings,
    bounds: tuple[int, int],
    progress: VerificationProgress,
) -> int:
    count = 0
    for run, digest, cell, script, *numbers in _pages(
        db, _SPECS, bounds, "specifications", progress
    ):
        count += 1
        if run_digest(text_digest(cell), text_digest(script), *numbers) != digest:
            found.add("specifications differ from their digest", run)
    return count


def _verify_files(
    paths: Iterable[Path],
    what: str,
    found: _Findings,
    progress: VerificationProgress,
) -> int:
    every = sorted(paths)
    for i, path in enumerate(every, start=1):
        try:
            if not is_intact(path) and path.exists():  # else housekeeping was faster
                found.add(f"{what} differ from their digest", str(path))
        except OSError as error:
            found.add(f"{what} cannot be read", f"{path} ({error.strerror})")
        progress(what, i, len(every))
    return len(every)


def _missing(paths: StatePaths, waiting: Iterable[str]) -> tuple[str, ...]:
    there = {path.stem for path in (*paths.scenes.glob("*.json"), *paths.files.glob("*"))}
    return tuple(sorted(set(waiting) - there))
