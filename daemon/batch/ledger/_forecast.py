"""What the ledger knows of runs before they are submitted: their results, and their time."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from typing import Final

from daemon.model.forecast import Forecast, PlannedRun

_AT_ONCE: Final = 500
"""Digests in a question: SQLite takes some thousand values."""
# As results are found for runs that are submitted (``_results._FIND_RESULTS``).
_WITH_RESULT: Final = (
    "SELECT DISTINCT digest FROM run AS old WHERE digest IN ({marks}) AND result <> ''"
    " AND campaign NOT IN (SELECT id FROM campaign WHERE visible = 0)"
    " AND repeatable AND state = 'done' AND outcome <> 'error'"
    " AND NOT EXISTS (SELECT 1 FROM run AS alarm WHERE alarm.digest = old.digest"
    " AND alarm.doubted = 1)"
    " AND NOT EXISTS (SELECT 1 FROM result JOIN void_key ON void_key.name = result.holder"
    " WHERE result.run = old.id)"
)
_WALLS: Final = (
    "SELECT scenario, sut, avg(wall), count(*) FROM run"
    " WHERE state = 'done' AND cached = '' AND wall > 0 GROUP BY scenario, sut"
)


def read_forecast(db: sqlite3.Connection, runs: Sequence[PlannedRun]) -> Forecast:
    """Return which runs need not be executed, and how long the others took so far."""
    walls, counts = {}, {}
    for scenario, sut, wall, count in db.execute(_WALLS):
        walls[scenario, sut], counts[scenario, sut] = float(wall), int(count)
    spent: dict[str, float] = {}
    executed: dict[str, int] = {}
    for (scenario, sut), wall in walls.items():
        spent[sut] = spent.get(sut, 0.0) + wall * counts[scenario, sut]
        executed[sut] = executed.get(sut, 0) + counts[scenario, sut]
    known = _with_result(db, [run.digest for run in runs if run.repeatable])

    def expected(run: PlannedRun) -> float | None:
        if (run.scenario, run.sut) in walls:
            return walls[run.scenario, run.sut]
        return spent[run.sut] / executed[run.sut] if run.sut in spent else None

    return Forecast(
        tuple(run.repeatable and run.digest in known for run in runs), tuple(map(expected, runs))
    )


def _with_result(db: sqlite3.Connection, digests: Sequence[str]) -> set[str]:
    found: set[str] = set()
    for start in range(0, len(digests), _AT_ONCE):
        some = digests[start : start + _AT_ONCE]
        marks = ", ".join("?" * len(some))
        found |= {row[0] for row in db.execute(_WITH_RESULT.format(marks=marks), some)}
    return found
