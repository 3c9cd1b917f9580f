"""Searches in the ledger: their states, tasks and answers."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from typing import Any, Final

from daemon.model.messages import LARGEST_PAGE, LARGEST_PAGE_BYTES
from daemon.model.search import SearchTask
from daemon.model.search_answer import SearchProgress, SearchQuery, SearchRow
from grammars.text import codec

_SEARCHES: Final = (
    "SELECT id, name, submitted_at, task, state, total, file, progress,"
    " (SELECT total(runs) FROM tally WHERE tally.campaign = campaign.id"
    " AND tally.state IN ('done', 'lost', 'cancelled'))"
    " FROM search JOIN campaign ON campaign.id = search.campaign"
)


def no_search(campaign: str) -> str:
    """Return the message for a campaign that is not a search."""
    return f"there is no search {campaign}"


def search_state(db: sqlite3.Connection, campaign: str) -> str:
    """Return the state of a search, empty for other campaigns.

    The ledger does not know clients: an unfinished search is ``waiting``.
    """
    row = db.execute("SELECT state FROM search WHERE campaign = ?", (campaign,)).fetchone()
    return "" if row is None else str(row[0])


def read_searches(db: sqlite3.Connection, query: SearchQuery) -> tuple[SearchRow, ...]:
    """Return searches, the newest first.

    In a list, answers have no files, and the answers of older searches are omitted if all together
    are too large for a page.
    """
    conditions, values = ["TRUE"], []
    if query.campaign:
        conditions.append("search.campaign = ?")
        values.append(query.campaign)
    if query.unfinished:
        conditions.append("state = 'waiting'")
    rows, room = [], LARGEST_PAGE_BYTES
    for row in db.execute(
        f"{_SEARCHES} WHERE {' AND '.join(conditions)} ORDER BY serial DESC LIMIT ?",
        (*values, LARGEST_PAGE),
    ):
        search = _search_row(row)
        if not query.campaign and search.answer is not None:
            answer = replace(search.answer, found="") if room > 0 else None
            search = replace(search, answer=answer)
            room -= len(codec.to_json(answer))
        rows.append(search)
    return tuple(rows)


def _search_row(row: Any) -> SearchRow:
    campaign, name, submitted_at, task, state, total, file, body, finished = row
    progress = codec.from_json(SearchProgress, body)
    return SearchRow(
        campaign,
        name,
        submitted_at,
        codec.from_json(SearchTask, task),
        state,
        progress.phase,
        int(total),
        int(finished),
        progress.note,
        progress.answer,
        file,
    )
