"""Verification of the ledger and its folders: every content is compared with its digest."""

from __future__ import annotations

import sqlite3
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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
    "SELECT run.serial, run.id, run.digest, cell.body, script.body, repeat, seed, trace_name,"
    " trace_at, result.digest, result.body, outcome, oracle, margin, unit, simulated FROM run"
    " JOIN cell ON cell.campaign = run.campaign AND cell.number = run.cell"
    " JOIN script ON script.campaign = run.campaign AND script.number = run.script"
    " LEFT JOIN result ON result.run = run.id"
    f" WHERE run.serial > ? ORDER BY run.serial LIMIT {_PAGE}"
)


@dataclass(frozen=True, slots=True)
class ContentReport:
    """Counts of verified contents, and the names with each kind of problem.

    ``missing`` are scenes and files that waiting runs need. ``foreign`` are messages about runs of
    other engines, which cannot be executed either.
    """

    counts: Counter[str]
    problems: Mapping[str, list[str]]
    missing: tuple[str, ...]
    foreign: tuple[str, ...]


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
    look = _Look(paths, traces)
    with open_reader(paths.ledger) as db:
        last = int(db.execute("SELECT ifnull(max(serial), 0) FROM run").fetchone()[0])
        at = start = max(0, last - _QUICK) if quick else 0
        # In parts: between them the ledger is not locked, and its WAL can be emptied.
        while rows := db.execute(_RUNS, (at,)).fetchall():
            for at, *row in rows:  # noqa: B007  (where the next part begins)
                look.at_run(*row)
            progress("runs", at - start, last - start)
        missing = look.missing_inputs(db)
        foreign = dict.fromkeys(hold_text(lacks) for _, lacks in read_other_engines(db))
    if not quick:
        files = (path for path in paths.files.glob("*") if is_digest(path.name))
        for what, contents in (("scenes", paths.scenes.glob("*.json")), ("files", files)):
            every = sorted(contents)
            for i, path in enumerate(every, start=1):
                look.at_file(what, path)
                progress(what, i, len(every))
    return ContentReport(
        counts=look.counts,
        problems=look.problems,
        missing=missing,
        foreign=tuple(foreign),
    )


class _Look:
    """Counts verified contents, and collects the names with each kind of problem.

    With ``hashing`` traces are read, not only measured.
    """

    def __init__(self, paths: StatePaths, hashing: bool) -> None:
        self._paths, self._hashing = paths, hashing
        self.counts: Counter[str] = Counter()
        self.problems: defaultdict[str, list[str]] = defaultdict(list)

    def at_run(
        self, run: str, digest: str, cell: bytes, script: bytes, repeat: int, seed: str,
        trace: str, url: str, expected: str | None, body: bytes | None, *columns: object,
    ) -> None:  # fmt: skip
        """Verify a run's specification, and its result and trace if it has any."""
        self.counts["specifications"] += 1
        if run_digest(text_digest(cell), text_digest(script), repeat, seed) != digest:
            self.problems["specifications differ from their digest"].append(run)
        if body is None:
            return
        self.counts["results"] += 1
        try:
            result = codec.from_json(RunResult, body)
        except ValueError:
            self.problems["results cannot be read"].append(run)
            return
        if result.digest != expected:
            self.problems["results differ from their digest"].append(run)
        if result.spec != digest:
            self.problems["results are of another specification than their run"].append(run)
        if columns != result_columns(result):
            self.problems["verdicts of runs differ from their results"].append(run)
        if not url:
            self._at_trace(trace, result.trace)

    def _at_trace(self, name: str, recorded: TraceInfo) -> None:
        try:
            path = self._paths.trace(name)
            if path.stat().st_size != recorded.size:
                self.problems["traces have another size than was recorded"].append(str(path))
            elif self._hashing and file_sha256(path) != recorded.sha256:
                self.problems["traces differ from their digest"].append(str(path))
        except FileNotFoundError:
            return  # removed to free space, as its run notes
        except (OSError, ValueError) as error:
            self.problems["traces cannot be read"].append(f"{name} ({error})")
        self.counts["traces"] += 1

    def at_file(self, what: str, path: Path) -> None:
        """Verify a scene or a file."""
        self.counts[what] += 1
        try:
            if not is_intact(path) and path.exists():  # housekeeping may have removed it
                self.problems[f"{what} differ from their digest"].append(str(path))
        except OSError as error:
            self.problems[f"{what} cannot be read"].append(f"{path} ({error.strerror})")

    def missing_inputs(self, db: sqlite3.Connection) -> tuple[str, ...]:
        """Return the missing scenes and files of waiting runs."""
        try:
            waiting = needed_inputs(db, waiting=True)
        except sqlite3.OperationalError as error:
            self.problems["specifications name no scene or no files"].append(str(error))
            return ()
        places = (*self._paths.scenes.glob("*.json"), *self._paths.files.glob("*"))
        return tuple(sorted(waiting - {path.stem for path in places}))
