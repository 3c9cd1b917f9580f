"""Searches in the ledger: how they stand, what their runs are about, and what these gave."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final, cast

from daemon.batch.errors import Refused
from daemon.model.messages import LARGEST_PAGE, LARGEST_PAGE_BYTES
from daemon.model.proposals import Proposal, ProposalQuery
from daemon.model.search import SearchTask
from daemon.model.search_answer import SearchAnswer, SearchQuery, SearchRow, SearchState
from grammars.text import codec

_SEARCHES: Final = (
    "SELECT id, name, submitted_at, task, search.state, phase, total, note, answer, file,"
    " (SELECT total(runs) FROM tally WHERE tally.campaign = campaign.id"
    " AND tally.state IN ('done', 'lost', 'cancelled'))"
    " FROM search JOIN campaign ON campaign.id = search.campaign"
)
_PROPOSALS: Final = (
    "SELECT position, number, repeat, phase, method, guided, vals, note FROM proposal"
    " WHERE campaign = ? AND position >= ? ORDER BY position LIMIT ?"
)
_INSERT: Final = (
    "INSERT INTO proposal (campaign, position, number, repeat, phase, method, guided, vals, note)"
    " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"
)


def search_state(db: sqlite3.Connection, campaign: str) -> str:
    """Return how a search stands, empty for a campaign that is none."""
    row = db.execute("SELECT state FROM search WHERE campaign = ?", (campaign,)).fetchone()
    return "" if row is None else str(row[0])


def read_task(db: sqlite3.Connection, campaign: str) -> tuple[SearchTask, str]:
    """Return what a search is asked, and its campaign file; refuses when there is none."""
    row = db.execute("SELECT task, file FROM search WHERE campaign = ?", (campaign,)).fetchone()
    if row is None:
        raise Refused(f"there is no search {campaign}")
    return codec.from_json(SearchTask, row[0]), str(row[1])


def insert_proposal(db: sqlite3.Connection, campaign: str, proposal: Proposal) -> None:
    """Write down what a run is about."""
    db.execute(
        _INSERT,
        (
            campaign,
            proposal.position,
            proposal.number,
            proposal.repeat,
            proposal.phase,
            proposal.method,
            proposal.guided,
            json.dumps(proposal.values).encode(),
            proposal.note,
        ),
    )


def read_searches(db: sqlite3.Connection, query: SearchQuery) -> tuple[SearchRow, ...]:
    """Return searches, the newest first.

    Where not one is asked for, the files of answers are left out, and so are the answers of the
    older ones when all together are too large for a page.
    """
    conditions, values = ["TRUE"], []
    if query.campaign:
        conditions.append("search.campaign = ?")
        values.append(query.campaign)
    if query.running:
        conditions.append("search.state = 'running'")
    found, room = [], LARGEST_PAGE_BYTES
    for row in db.execute(
        f"{_SEARCHES} WHERE {' AND '.join(conditions)} ORDER BY serial DESC LIMIT ?",
        (*values, LARGEST_PAGE),
    ):
        answer = _read_answer(row[8]) if query.campaign or room > 0 else None
        if answer is not None and not query.campaign:
            answer = _without_files(answer)
            room -= len(codec.to_json(answer))
        found.append(_search_row(row, answer))
    return tuple(found)


def _read_answer(body: bytes) -> SearchAnswer | None:
    return codec.from_json(SearchAnswer, body) if body else None


def _without_files(answer: SearchAnswer) -> SearchAnswer:
    shrunk = answer.shrunk and replace(answer.shrunk, files=())
    return replace(answer, shrunk=shrunk, found="")


def _search_row(row: Any, answer: SearchAnswer | None) -> SearchRow:
    campaign, name, submitted_at, task, state, phase, total, note, _, file, finished = row
    return SearchRow(
        campaign,
        name,
        submitted_at,
        codec.from_json(SearchTask, task),
        cast(SearchState, state),
        phase,
        int(total),
        int(finished),
        note,
        answer,
        file,
    )


def read_proposals(db: sqlite3.Connection, query: ProposalQuery) -> Iterator[Proposal]:
    """Yield what a page of the runs of a search is about, in order."""
    for row in db.execute(_PROPOSALS, (query.campaign, query.offset, query.limit)):
        position, number, repeat, phase, method, guided, values, note = row
        point = tuple(json.loads(values))
        yield Proposal(position, number, repeat, phase, method, bool(guided), point, note)
