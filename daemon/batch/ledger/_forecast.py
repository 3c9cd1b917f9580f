"""What the ledger knows of runs before they are submitted: their results, and their time."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from daemon.batch.time_left import CampaignWork, CellTimes, CellWork, ExecutedRuns

_AT_ONCE: Final = 500
"""Digests in a question: SQLite takes some thousand values."""
# As results are found for runs that are submitted (``_results._FIND_RESULTS``).
_WITH_RESULT: Final = (
    "SELECT DISTINCT digest FROM run AS old WHERE digest IN ({marks}) AND result <> ''"
    " AND repeatable AND state = 'done' AND outcome <> 'error'"
    " AND NOT EXISTS (SELECT 1 FROM run AS alarm WHERE alarm.digest = old.digest"
    " AND alarm.doubted = 1)"
)
_EXECUTED: Final = (
    "SELECT scenario, sut, count(*), total(wall), total(simulated), total(time_limit) FROM run"
    " WHERE state = 'done' AND cached = '' AND wall > 0 GROUP BY scenario, sut"
)


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """A run by the ``digest`` of its specification, with its ``limit`` [s simulated]; only
    ``repeatable`` ones reuse results.
    """

    digest: str
    scenario: str
    sut: str
    limit: float
    repeatable: bool = True


@dataclass(frozen=True, slots=True)
class Forecast:
    """For each run whether it has a result already, and how long it takes a worker [s].

    The time is reckoned as :mod:`daemon.batch.time_left` does of a queue, from all that was ever
    executed; ``None`` when that is nothing.
    """

    cached: Sequence[bool]
    seconds: Sequence[float | None]


def read_forecast(db: sqlite3.Connection, runs: Sequence[PlannedRun]) -> Forecast:
    """Return which runs need not be executed, and how long each takes."""
    executed = tuple(
        CellWork(scenario, sut, 0, 0.0, ExecutedRuns(*sums))
        for scenario, sut, *sums in db.execute(_EXECUTED)
    )
    times = CellTimes(CampaignWork("", executed), ())
    known = _with_result(db, [run.digest for run in runs if run.repeatable])
    return Forecast(
        tuple(run.repeatable and run.digest in known for run in runs),
        tuple(times.of_run(run.scenario, run.sut, run.limit) for run in runs),
    )


def _with_result(db: sqlite3.Connection, digests: Sequence[str]) -> set[str]:
    found: set[str] = set()
    for start in range(0, len(digests), _AT_ONCE):
        some = digests[start : start + _AT_ONCE]
        marks = ", ".join("?" * len(some))
        found |= {row[0] for row in db.execute(_WITH_RESULT.format(marks=marks), some)}
    return found
