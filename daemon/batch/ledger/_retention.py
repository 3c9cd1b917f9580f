"""Which traces go when space is wanted back: those of finished campaigns, the oldest first.

The ledger keeps every run, verdict and margin; rows of runs say that the trace is gone. Traces are
removed under the ledger's write lock, a few at a time, after another look at what is finished: a
daemon that keeps working meanwhile cannot start a campaign again in between.
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
# By either sign: what is removed is gone for ever, so one of them is enough to keep traces.
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
"""Traces of finished campaigns that unfinished ones took results from."""


@dataclass(frozen=True, slots=True)
class RetentionPolicy:
    """What to keep: traces of the ``newest`` finished campaigns, of those finished at most
    ``age`` seconds ago, and at most ``size`` bytes of traces in all; ``None`` sets no bound.
    """

    newest: int | None = None
    age: float | None = None
    size: int | None = None

    def choose(
        self, stored: Sequence[StoredTrace], everything: int, now: float
    ) -> tuple[StoredTrace, ...]:
        """Return which of the ``stored`` traces of finished campaigns go, oldest first.

        ``everything`` is what all traces take, also those that cannot go.
        """
        campaigns = list(dict.fromkeys(trace.campaign for trace in stored))
        newest = len(campaigns) if self.newest is None else self.newest
        outnumbered = set(campaigns[: max(0, len(campaigns) - newest)])
        left, gone = everything, []
        for trace in stored:
            old = self.age is not None and now - trace.finished_at > self.age
            much = self.size is not None and left > self.size
            if old or much or trace.campaign in outnumbered:
                gone.append(trace)
                left -= trace.size
        return tuple(gone)


@dataclass(frozen=True, slots=True)
class StoredTrace:
    """A trace that lies there: of a finished campaign, ``size`` bytes, below the traces."""

    campaign: str
    name: str
    size: int
    finished_at: float


@dataclass(frozen=True, slots=True)
class SweepResult:
    """What went, or would go: by trace, oldest first; ``kept`` bytes of traces stay."""

    gone: tuple[StoredTrace, ...]
    kept: int

    @property
    def freed(self) -> int:
        """Bytes given back."""
        return sum(trace.size for trace in self.gone)


def sweep_traces(
    paths: StatePaths, policy: RetentionPolicy, now: float, *, dry: bool = False
) -> SweepResult:
    """Remove the traces that ``policy`` does not keep; with ``dry`` only say which.

    ``now`` is the wall clock [s]. A daemon may be running. Raises :class:`DaemonError` when there
    is no ledger of this version, and ``OSError`` when a trace cannot be removed.
    """
    with _ledger(paths) as db:
        everything = stored_bytes(paths)
        chosen = policy.choose(tuple(_stored(db, paths)), everything, now)
        gone = chosen if dry else _remove(db, paths, chosen)
    return SweepResult(gone, everything - sum(trace.size for trace in gone))


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
    """Bytes of all traces there are, also of unfinished and unknown campaigns."""
    return sum(_size(path) or 0 for path in matching_paths(paths.traces, "*/*.mcap"))


def _remove(
    db: sqlite3.Connection, paths: StatePaths, chosen: tuple[StoredTrace, ...]
) -> tuple[StoredTrace, ...]:
    gone: list[StoredTrace] = []
    for start in range(0, len(chosen), _BATCH):
        # The write lock, although nothing is written: while it is ours, no daemon can start one of
        # these campaigns again or take results from them between the look and the removal.
        db.execute("BEGIN IMMEDIATE")
        try:
            finished = {row[0] for row in db.execute(_FINISHED)}
            used = {row[0] for row in db.execute(_USED)}
            for trace in chosen[start : start + _BATCH]:
                if trace.campaign in finished and trace.name not in used:
                    paths.trace(trace.name).unlink(missing_ok=True)
                    gone.append(trace)
        finally:
            db.execute("ROLLBACK")
    return tuple(gone)
