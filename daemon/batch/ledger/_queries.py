"""Queries for campaigns, runs and searches in SQL: columns, filters, order, rows as answers."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

from daemon.batch.errors import Refused
from daemon.batch.ledger._entry import RESERVE
from daemon.batch.paths import StatePaths
from daemon.model.messages import LARGEST_PAGE, LARGEST_PAGE_BYTES, CampaignQuery, RunQuery
from daemon.model.search import Proposal, SearchTask
from daemon.model.search_answer import SearchProgress, SearchQuery, SearchRow
from daemon.model.spec import RunResult
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome, RunState, join_notes
from grammars.text import codec
from grammars.text.diagnostics import did_you_mean

# Columns named like the fields of RunRow, and those that locate its trace.
_ROW: Final = (
    'id, campaign, position AS "index", scenario, sut, repeat, state, attempt, worker, outcome,'
    ' oracle, margin, unit, simulated, time_limit AS "limit", wall, reason, cached, repeatable,'
    " nondeterministic, digest, seed, trace_name, trace_at"
)
_RESULTS: Final = (
    "(SELECT body FROM result WHERE result.run = run.id) AS result,"
    " (SELECT body FROM proposal WHERE proposal.run = run.id) AS proposal"
)
_SEVERITY: Final = (
    "CASE outcome WHEN 'fail' THEN 0 WHEN 'error' THEN 1 WHEN 'inconclusive' THEN 2"
    " WHEN 'pass' THEN 3 ELSE 4 END"
)
_COLUMNS: Final = (
    "campaign", "scenario", "sut", "repeat", "state", "attempt", "worker", "oracle", "margin",
    "simulated", "wall",
)  # fmt: skip
_SORTABLE: Final = dict(zip(_COLUMNS, _COLUMNS, strict=True)) | {
    "index": "serial",
    "outcome": _SEVERITY,
    "limit": "time_limit",
}
_TEXT: Final = (
    "scenario || '/' || sut || '/' || repeat || ' ' || oracle || ' ' || reason || ' ' || id"
)
_WORDS: Final = ("scenario", "sut", "oracle", "id", "repeat", "reason")
"""The columns of that text: a word without slash and space is in one of them."""
_SEARCHES: Final = (
    "SELECT search.campaign, name, submitted_at, task, state, total AS proposed, file, progress,"
    " (SELECT total(runs) FROM tally WHERE tally.campaign = campaign.id"
    " AND tally.state IN ('done', 'lost', 'cancelled')) AS finished"
    " FROM search JOIN campaign ON campaign.id = search.campaign"
)
_WILD: Final = re.compile(r"[\\%_]")
_ESCAPED: Final = r"\\\g<0>"
_AFTER_ANY_TEXT: Final = "\U0010ffff"
"""Suffix that makes a text sort after every text with this prefix."""


def _equal(
    query: CampaignQuery | RunQuery | SearchQuery, *columns: str
) -> tuple[list[str], list[Any]]:
    """Return the conditions of columns for which a query has a value, and these values."""
    given = [column for column in columns if getattr(query, column)]
    conditions = ["TRUE", *(f"{column} = ?" for column in given)]
    return conditions, [getattr(query, column) for column in given]


def campaign_filter(query: CampaignQuery) -> tuple[str, list[Any]]:
    """Return the condition of a query for campaigns, and its values."""
    conditions, values = _equal(query, "id", "name")
    if query.unfinished:
        conditions.append("finished_at IS NULL")
    if query.beginning:
        # By comparison, not LIKE: it uses the index on ids.
        conditions.append("id >= ? AND id < ?")
        values += [query.beginning, query.beginning + _AFTER_ANY_TEXT]
    return f"WHERE {' AND '.join(conditions)}", values


def run_order(query: RunQuery) -> str:
    """Return the order of runs in SQL; raises :class:`Refused` for an unknown column."""
    column = _SORTABLE.get(query.sort)
    if column is None:
        raise Refused(f"cannot sort by {query.sort!r}: {did_you_mean(query.sort, _SORTABLE)}")
    if column == "serial" and query.campaign:
        column = "position"  # the same order, and there is an index on it
    order = f"{column} {'DESC' if query.descending else 'ASC'}"
    if column == "margin":
        order = f"margin IS NULL, {order}"  # runs without a margin come last, either way
    return order if column in ("serial", "position") else f"{order}, serial"


def run_filter(query: RunQuery) -> tuple[str, list[Any]]:
    """Return the condition of a query for runs, and its values.

    Raises :class:`Refused` for an unknown state or outcome.
    """
    _check_word("state", query.state, RunState)
    _check_word("outcome", query.outcome, Outcome)
    conditions, values = _equal(query, "campaign", "state", "outcome", "scenario", "sut")
    conditions.append("state <> ?")
    values.append(RESERVE)
    if query.text:
        # Searching 100,000 concatenated texts takes twice as long as searching their parts.
        columns = (f"({_TEXT})",) if set(query.text) & {"/", " "} else _WORDS
        matches = " OR ".join(f"{column} LIKE ? ESCAPE '\\'" for column in columns)
        conditions.append(f"({matches})")
        values += [f"%{_WILD.sub(_ESCAPED, query.text)}%"] * len(columns)
    return f"WHERE {' AND '.join(conditions)}", values


def _check_word(column: str, word: str, words: Iterable[str]) -> None:
    names = [str(name) for name in words]
    if word and word not in names:
        raise Refused(f"there is no {column} {word!r}: {did_you_mean(word, names)}")


def select_runs(
    db: sqlite3.Connection, where: str, values: Sequence[Any], *, results: bool = False
) -> Iterator[sqlite3.Row]:
    """Return the rows of runs for :func:`run_row`; ``where`` also has their order."""
    cursor = db.cursor()
    cursor.row_factory = sqlite3.Row
    more = _RESULTS if results else "NULL AS result, NULL AS proposal"
    return cursor.execute(f"SELECT {_ROW}, {more} FROM run {where}", values)


def run_row(db: sqlite3.Connection, row: sqlite3.Row, paths: StatePaths | None = None) -> RunRow:
    """Return a run; with ``paths`` its trace is located, which reads the disk."""
    values = dict(row)
    names = (values.pop("trace_name"), values["cached"], values.pop("trace_at"))
    result, proposal = values["result"], values["proposal"]
    outcome = Outcome(values["outcome"]) if values["outcome"] else None
    trace = note = ""
    if outcome is not None and paths is not None:
        trace = _find_trace(db, paths, *names)
        if not trace:
            source = values["cached"]
            note = f"the trace of {source} is gone" if source else "its trace is gone"
    values |= {
        "state": RunState(values["state"]),
        "outcome": outcome,
        "trace": trace,
        "repeatable": bool(values["repeatable"]),
        "nondeterministic": bool(values["nondeterministic"]),
        "reason": join_notes(values["reason"], note),
        "seed": int(values["seed"]),  # text in the table: 64 unsigned bits do not fit SQLite
        "result": None if result is None else codec.from_json(RunResult, result),
        "proposal": None if proposal is None else codec.from_json(Proposal, proposal),
    }
    return RunRow(**values)


def _find_trace(
    db: sqlite3.Connection, paths: StatePaths, name: str, source: str, location: str
) -> str:
    """Return the location of a run's trace: the ``location`` in a store, else the path of its file.

    A run without a trace of its own has that of ``source``, whose result it reuses. Empty if the
    file was deleted; stores are not checked.
    """
    if location:
        return location
    own = paths.traces / name
    if own.exists():
        return str(own)
    if not source:
        return ""
    row = db.execute("SELECT trace_name FROM run WHERE id = ?", (source,)).fetchone()
    path = paths.traces / row[0] if row else None
    return str(path) if path is not None and path.exists() else ""


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
    conditions, values = _equal(query, "campaign")
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


def _search_row(row: sqlite3.Row) -> SearchRow:
    values = dict(row)
    progress = codec.from_json(SearchProgress, values.pop("progress"))
    values |= {
        "task": codec.from_json(SearchTask, values["task"]),
        "finished": int(values["finished"]),
        "phase": progress.phase,
        "note": progress.note,
        "answer": progress.answer,
    }
    return SearchRow(**values)
