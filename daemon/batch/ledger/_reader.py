"""Reading the ledger: answers to people's requests from SQLite."""

from __future__ import annotations

import json
import sqlite3
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any, Final, TypeVar

from daemon.batch.errors import PlaceUnusable, Refused
from daemon.batch.ledger._connection import open_reader
from daemon.batch.ledger._entry import RESERVE, read_spec
from daemon.batch.ledger._queries import (
    campaign_filter,
    read_searches,
    run_filter,
    run_order,
    run_row,
    select_runs,
)
from daemon.batch.ledger._results import (
    hold_text,
    read_campaign,
    read_declared,
    read_holds,
    require_era,
    require_lease,
)
from daemon.batch.ledger._time_left import (
    Forecast,
    RunPace,
    TimeLeft,
    read_forecast,
    read_time_left,
)
from daemon.batch.paths import StatePaths
from daemon.model import verbs
from daemon.model.messages import LARGEST_PAGE_BYTES, CampaignQuery, IdRequest, RunQuery
from daemon.model.spec import RunResult
from daemon.model.status import CampaignRow, RunDetail, RunPage, RunRow, count_runs
from daemon.model.submission import CampaignOrigin, Submission
from daemon.model.verdicts import RunState
from grammars.text import codec

A = TypeVar("A")

_LARGEST_NAMES: Final = 2000
"""Largest row of a page without reason and result [B]."""
_RATE_SPAN: Final = 600.0
_RATE_RUNS: Final = 64


class LedgerReader(verbs.CampaignSource):
    """The read side of the ledger on one connection, used by one thread."""

    def __init__(self, connection: sqlite3.Connection, paths: StatePaths) -> None:
        self._db = connection
        self._db.row_factory = sqlite3.Row
        self._paths = paths
        self.where = str(paths.state)

    @classmethod
    @contextmanager
    def open(cls, paths: StatePaths) -> Iterator[LedgerReader]:
        """Open the ledger of a state directory, with or without a running daemon.

        Raises :class:`DaemonError`, also for a query in the block, when there is no ledger, it
        cannot be read or has another schema.
        """
        if not paths.ledger.is_file():
            raise PlaceUnusable(
                f"{paths.state} is not a state directory: name a folder of traces, or choose "
                "another directory with --state"
            )
        with open_reader(paths.ledger) as connection:
            yield cls(connection, paths)

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """Answer all requests in the block from one state of the ledger."""
        self._db.execute("BEGIN")
        try:
            yield
        finally:
            self._db.execute("COMMIT")

    def ask(self, verb: verbs.Verb[..., A], request: object) -> A:
        """Answer a request to a :class:`CampaignSource`."""
        answers: dict[verbs.AnyVerb, Callable[[Any], Any]] = {
            verbs.CAMPAIGNS: self._campaigns,
            verbs.RUNS: self._runs,
            verbs.RUN: self._run,
            verbs.DECLARED: lambda request: read_declared(self._db, request.id),
            verbs.ORIGIN: self._origin,
            verbs.SEARCHES: partial(read_searches, self._db),
        }
        answer: A = answers[verb](request)
        return answer

    def _campaigns(self, query: CampaignQuery) -> tuple[CampaignRow, ...]:
        where, values = campaign_filter(query)
        rows = self._db.execute(
            "SELECT id, name, about, submitted_at, finished_at, total, cached, paused, priority,"
            " acknowledged,"
            " ifnull((SELECT state FROM search WHERE search.campaign = campaign.id), '') AS search"
            f" FROM campaign {where} ORDER BY serial DESC LIMIT ? OFFSET ?",
            (*values, query.limit, query.offset),
        ).fetchall()
        tallied: dict[str, list[tuple[str, str, int]]] = {row["id"]: [] for row in rows}
        for campaign, *tally in self._db.execute(
            "SELECT campaign, state, outcome, runs FROM tally"
            " WHERE campaign IN (SELECT value FROM json_each(?))",
            (json.dumps(list(tallied)),),
        ):
            tallied[campaign].append(tuple(tally))
        return tuple(
            CampaignRow(
                **dict(row)
                | {name: bool(row[name]) for name in ("paused", "acknowledged")}
                | count_runs(tallied[row["id"]])
            )
            for row in rows
        )

    def counts(self) -> tuple[int, dict[str, int]]:
        """Return the number of campaigns, and the counts of their runs.

        The counts are the fields of :class:`RunCounts`, and ``searched``: failures in searches,
        which look for them, do not count as ``failed``.
        """
        campaigns = self._db.execute("SELECT count(*) FROM campaign").fetchone()[0]
        # Summed by SQLite: for 20,000 campaigns this takes a quarter of the time.
        tallied = "SELECT state, outcome, sum(runs) FROM tally GROUP BY state, outcome"
        counts = count_runs(self._db.execute(tallied))
        searched = self._db.execute(
            "SELECT total(runs) FROM search JOIN tally USING (campaign)"
            " WHERE tally.state = 'done' AND outcome = 'fail'"
        ).fetchone()[0]
        return campaigns, counts | {
            "failed": counts["failed"] - int(searched),
            "searched": int(searched),
        }

    def held_runs(self) -> dict[str, tuple[str, ...]]:
        """Return the running runs of each worker, by its id."""
        runs: defaultdict[str, tuple[str, ...]] = defaultdict(tuple)
        for worker, run in self._db.execute(
            "SELECT worker, id FROM run WHERE state = 'running' ORDER BY worker, token"
        ):
            runs[worker] += (run,)
        return runs

    def rate(self, now: float) -> float:
        """Return the number of runs finished per minute lately, 0 with less than two.

        Over the last 64 runs within ten minutes, since the submission of the oldest unfinished
        campaign: idle time does not count.
        """
        came = self._db.execute(
            "SELECT min(submitted_at) FROM campaign WHERE finished_at IS NULL"
        ).fetchone()[0]
        runs, first = self._db.execute(
            "SELECT count(*), min(finished_at) FROM (SELECT finished_at FROM run"
            " WHERE finished_at > ? ORDER BY finished_at DESC LIMIT ?)",
            (max(now - _RATE_SPAN, came or 0.0), _RATE_RUNS),
        ).fetchone()
        if runs < 2 or now <= first:
            return 0.0
        return 60.0 * int(runs - 1) / float(now - first)

    def holds(self) -> tuple[str, ...]:
        """Return the missing inputs of waiting campaigns, in words for people."""
        return tuple(map(hold_text, read_holds(self._db)))

    def time_left(
        self,
        now: float,
        slots: int,
        paces: Mapping[str, RunPace],
        preparing: Collection[str] = (),
    ) -> TimeLeft:
        """Return the expected time of waiting and running runs on so many slots.

        ``paces`` are those of started runs; ``preparing`` workers have started no others.
        """
        return read_time_left(self._db, now, slots, paces, preparing)

    def _runs(self, query: RunQuery) -> RunPage:
        """Return one page; equal values keep the order of submission.

        It has fewer runs than the limit if they have many bytes; ``total`` counts all.
        """
        where, values = run_filter(query)
        rows = select_runs(
            self._db,
            f"{where} ORDER BY {run_order(query)} LIMIT ? OFFSET ?",
            (*values, query.limit, query.offset),
            results=query.results,
        )
        page: list[RunRow] = []
        room, is_whole = LARGEST_PAGE_BYTES, True
        for row in rows:
            if room <= 0:
                is_whole = False
                break
            page.append(run_row(self._db, row, self._paths))
            room -= _LARGEST_NAMES + len(row["reason"]) + len(row["result"] or b"")
        is_last = is_whole and len(page) < query.limit and (page or not query.offset)
        total = query.offset + len(page) if is_last else self._total(query, where, values)
        return RunPage(tuple(page), total)

    def _total(self, query: RunQuery, where: str, values: list[Any]) -> int:
        """Return the number of runs that match the filter."""
        # The tally has the numbers by state, so 100,000 runs need not be counted.
        has_tally = not (query.text or query.scenario or query.sut)
        counting = "total(runs) FROM tally" if has_tally else "count(*) FROM run"
        return int(self._db.execute(f"SELECT {counting} {where}", values).fetchone()[0])

    def _run(self, request: IdRequest) -> RunDetail:
        where = "WHERE id = ? AND state <> ?"
        row = next(select_runs(self._db, where, (request.id, RESERVE), results=True), None)
        if row is None:
            raise Refused(f"there is no run {request.id}")
        return RunDetail(run_row(self._db, row, self._paths), read_spec(self._db, request.id))

    def _origin(self, request: IdRequest) -> CampaignOrigin:
        (origin,) = read_campaign(self._db, request.id, "origin")
        return codec.from_json(CampaignOrigin, origin)

    def forecast(self, submission: Submission) -> Forecast:
        """Return which runs of a submission have results, and their expected times."""
        return read_forecast(self._db, submission)

    def steps(self, run: str) -> tuple[tuple[float, str, str], ...]:
        """Return time, state and reason of a run's changes; the oldest first, early ones may be
        gone.
        """
        rows = self._db.execute(
            "SELECT at, state, note FROM event WHERE kind IN ('run', 'alarm') AND id = ?"
            " ORDER BY seq",
            (run,),
        )
        return tuple((row[0], row[1], row[2]) for row in rows)

    def result_of_trace(self, name: str) -> RunResult | None:
        """Return the result of the run whose own trace has this name."""
        row = self._db.execute(
            "SELECT body FROM result JOIN run ON run.id = result.run WHERE trace_name = ?", (name,)
        ).fetchone()
        return None if row is None else codec.from_json(RunResult, row[0])

    def expected_trace(self, run: str, token: int, era: str) -> tuple[str, bool]:
        """Return the name of a run's trace, and whether a result under that lease is recorded.

        It is not if the run has a result or is cancelled. Refuses a lease that the run never had.
        """
        require_era(self._db, era, token)
        require_lease(self._db, run, token)
        state, outdated, trace = self._db.execute(
            "SELECT state, outdated, trace_name FROM run WHERE id = ?", (run,)
        ).fetchone()
        return trace, state not in (RunState.DONE, RunState.CANCELLED) and token > outdated
