"""Verification of the ledger and its folders: every content is compared with its digest."""

from __future__ import annotations

import sqlite3
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, TypeAlias

from daemon.batch.ledger._connection import open_reader
from daemon.batch.ledger._entry import needed_inputs
from daemon.batch.ledger._results import hold_text, read_other_engines, result_columns
from daemon.batch.paths import StatePaths
from daemon.batch.stores import file_sha256, is_intact
from daemon.model.ids import is_digest
from daemon.model.spec import RunResult, TraceInfo, run_digest, text_digest
from grammars.text import codec

VerificationProgress: TypeAlias = Callable[[str, int, int], None]
"""Receiver of the kind of content, the number verified so far, and the total."""

_PAGE: Final = 500
_QUICK: Final = 1000
"""Number of the newest runs that a quick verification covers."""

_RUNS: Final = (
    "SELECT run.serial, run.id, run.digest, cell.body, script.body, repeat, seed,"
    " result.digest, result.body, outcome, oracle, margin, unit, simulated, trace_name, trace_at"
    " FROM run"
    " JOIN cell ON cell.campaign = run.campaign AND cell.number = run.cell"
    " JOIN script ON script.campaign = run.campaign AND script.number = run.script"
    " LEFT JOIN result ON result.run = run.id"
    f" WHERE run.serial > ? ORDER BY run.serial LIMIT {_PAGE}"
)


@dataclass(slots=True)
class ContentReport:
    """Counts of verified contents, and the names with each kind of problem.

    ``missing`` are scenes and files that waiting runs need. ``foreign`` are messages about runs of
    other engines, which cannot be executed either.
    """

    counts: Counter[str] = field(default_factory=Counter)
    problems: defaultdict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    missing: tuple[str, ...] = ()
    foreign: tuple[str, ...] = ()


def verify_contents(
    paths: StatePaths,
    *,
    quick: bool = False,
    traces: bool = False,
    progress: VerificationProgress = lambda *_: None,
) -> ContentReport:
    """Compare results, specifications, scenes, files and traces with their digests.

    Traces are only measured, or with ``traces`` read. ``quick`` covers only the newest results, no
    scenes and no files. The ledger is locked for some hundred rows at a time, so a daemon may be
    running. Raises :class:`DaemonError` when the ledger cannot be read.
    """
    report = ContentReport()
    with open_reader(paths.ledger) as db:
        last = int(db.execute("SELECT ifnull(max(serial), 0) FROM run").fetchone()[0])
        at = start = max(0, last - _QUICK) if quick else 0
        # In parts: between them the ledger is not locked, and its WAL can be emptied.
        while rows := db.execute(_RUNS, (at,)).fetchall():
            for at, *row, trace, url in rows:  # noqa: B007  (where the next part begins)
                result = _verify_run(report, *row)
                if result is not None and not url:
                    _verify_trace(report, paths, trace, result.trace, hashing=traces)
            progress("runs", at - start, last - start)
        report.missing = _missing_inputs(report, paths, db)
        held = (hold_text(lacks) for _, lacks in read_other_engines(db))
        report.foreign = tuple(dict.fromkeys(held))
    if not quick:
        files = (path for path in paths.files.glob("*") if is_digest(path.name))
        for what, contents in (("scenes", paths.scenes.glob("*.json")), ("files", files)):
            every = sorted(contents)
            for i, path in enumerate(every, start=1):
                _verify_file(report, what, path)
                progress(what, i, len(every))
    return report


def _verify_run(
    report: ContentReport, run: str, digest: str, cell: bytes, script: bytes, repeat: int,
    seed: str, expected: str | None, body: bytes | None, *columns: object,
) -> RunResult | None:  # fmt: skip
    """Verify a run's specification and its result; return the result, if any."""
    report.counts["specifications"] += 1
    if run_digest(text_digest(cell), text_digest(script), repeat, seed) != digest:
        report.problems["specifications differ from their digest"].append(run)
    if body is None:
        return None
    report.counts["results"] += 1
    try:
        result = codec.from_json(RunResult, body)
    except ValueError:
        report.problems["results cannot be read"].append(run)
        return None
    if result.digest != expected:
        report.problems["results differ from their digest"].append(run)
    if result.spec != digest:
        report.problems["results are of another specification than their run"].append(run)
    if columns != result_columns(result):
        report.problems["verdicts of runs differ from their results"].append(run)
    return result


def _verify_trace(
    report: ContentReport, paths: StatePaths, name: str, recorded: TraceInfo, *, hashing: bool
) -> None:
    try:
        path = paths.trace(name)
        if path.stat().st_size != recorded.size:
            report.problems["traces have another size than was recorded"].append(str(path))
        elif hashing and file_sha256(path) != recorded.sha256:
            report.problems["traces differ from their digest"].append(str(path))
    except FileNotFoundError:
        return  # removed to free space, as its run notes
    except (OSError, ValueError) as error:
        report.problems["traces cannot be read"].append(f"{name} ({error})")
    report.counts["traces"] += 1


def _verify_file(report: ContentReport, what: str, path: Path) -> None:
    report.counts[what] += 1
    try:
        if not is_intact(path) and path.exists():  # housekeeping may have removed it
            report.problems[f"{what} differ from their digest"].append(str(path))
    except OSError as error:
        report.problems[f"{what} cannot be read"].append(f"{path} ({error.strerror})")


def _missing_inputs(
    report: ContentReport, paths: StatePaths, db: sqlite3.Connection
) -> tuple[str, ...]:
    """Return the missing scenes and files of waiting runs."""
    try:
        waiting = needed_inputs(db, waiting=True)
    except sqlite3.OperationalError as error:
        report.problems["specifications name no scene or no files"].append(str(error))
        return ()
    places = (*paths.scenes.glob("*.json"), *paths.files.glob("*"))
    return tuple(sorted(waiting - {path.stem for path in places}))
