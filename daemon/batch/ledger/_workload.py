"""What is left to do, read for an estimate of how long it takes."""

from __future__ import annotations

import json
import sqlite3
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.ledger._searches import read_searches
from daemon.batch.time_left import CampaignWork, CellWork, ExecutedRuns, RunInProgress, RunProgress
from daemon.model.search_answer import SearchQuery

_OPEN: Final = (
    "SELECT id, paused, priority,"
    # Of the same name, and over: what its runs took tells what these will, before one is over.
    " ifnull((SELECT before.id FROM campaign AS before WHERE before.name = campaign.name"
    " AND before.serial < campaign.serial ORDER BY before.serial DESC LIMIT 1), '')"
    " FROM campaign WHERE finished_at IS NULL ORDER BY priority DESC, served, serial"
)
_CELLS: Final = (
    "SELECT campaign, scenario, sut, state, count(*), total(wall), total(simulated),"
    " total(time_limit) FROM run WHERE campaign IN (SELECT value FROM json_each(?))"
    " AND cached = '' GROUP BY campaign, scenario, sut, state ORDER BY min(serial)"
)
_RUNNING: Final = (
    "SELECT id, campaign, scenario, sut, time_limit, leased_at FROM run WHERE state = 'running'"
)


@dataclass(slots=True)
class _Cell:
    queued: int = 0
    limit: float = 0.0
    executed: ExecutedRuns = field(default_factory=ExecutedRuns)


def read_workload(
    db: sqlite3.Connection, now: float, progress: Mapping[str, RunProgress]
) -> tuple[CampaignWork, ...]:
    """Return what is left of every open campaign, whose turn it is first.

    ``progress`` is what workers have said of runs that run.
    """
    campaigns = db.execute(_OPEN).fetchall()
    names = {name for row in campaigns for name in (row[0], row[3]) if name}
    cells: dict[str, dict[tuple[str, str], _Cell]] = defaultdict(lambda: defaultdict(_Cell))
    for campaign, scenario, sut, state, runs, wall, sim, limit in db.execute(
        _CELLS, (json.dumps(sorted(names)),)
    ):
        cell = cells[campaign][scenario, sut]
        if state == "queued":
            cell.queued, cell.limit = runs, limit / runs
        elif state == "done":
            cell.executed = ExecutedRuns(runs, wall, sim, limit)
    running: dict[str, list[RunInProgress]] = defaultdict(list)
    for run, campaign, scenario, sut, limit, leased_at in db.execute(_RUNNING):
        elapsed = max(0.0, now - leased_at)
        told = progress.get(run, RunProgress(0.0, now))
        age = min(elapsed, max(0.0, now - told.at))
        running[campaign].append(RunInProgress(scenario, sut, limit, elapsed, told.simulated, age))
    more = {
        row.campaign: max(0, row.task.runs - row.proposed)
        for row in read_searches(db, SearchQuery(running=True))
    }
    return tuple(
        CampaignWork(
            id=name,
            cells=tuple(
                CellWork(*key, one.queued, one.limit, one.executed, _executed(cells, before, key))
                for key, one in cells[name].items()
            ),
            running=tuple(running[name]),
            paused=bool(paused),
            priority=priority,
            more=more.get(name, 0),
        )
        for name, paused, priority, before in campaigns
    )


def _executed(
    cells: Mapping[str, Mapping[tuple[str, str], _Cell]], campaign: str, key: tuple[str, str]
) -> ExecutedRuns:
    found = cells.get(campaign, {}).get(key)
    return found.executed if found is not None else ExecutedRuns()
