"""Removal of traces of finished campaigns, the oldest first, to free space.

The ledger keeps every run, verdict and margin; rows of runs note the missing trace. Traces are
removed under the ledger's write lock, a few at a time, after another check that their campaign is
finished: a running daemon cannot restart the campaign in between.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.ledger._connection import UNREADABLE, check_current, check_present
from daemon.batch.paths import StatePaths
from grammars.text.files import matching_paths

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
