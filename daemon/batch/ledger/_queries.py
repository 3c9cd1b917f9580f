"""What questions about campaigns and runs come to in SQL: their filters and their order."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final

from daemon.batch.errors import Refused
from daemon.model.messages import CampaignQuery, RunQuery
from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from grammars.text.diagnostics import did_you_mean

_SEVERITY: Final = (
    "CASE outcome WHEN 'fail' THEN 0 WHEN 'error' THEN 1 WHEN 'inconclusive' THEN 2"
    " WHEN 'pass' THEN 3 ELSE 4 END"
)
_SORTABLE: Final = {
    "index": "serial",
    "campaign": "campaign",
    "scenario": "scenario",
    "sut": "sut",
    "repeat": "repeat",
    "state": "state",
    "attempt": "attempt",
    "worker": "worker",
    "outcome": _SEVERITY,
    "oracle": "oracle",
    "margin": "margin",
    "simulated": "simulated",
    "limit": "time_limit",
    "wall": "wall",
}
_TEXT: Final = (
    "scenario || '/' || sut || '/' || repeat || ' ' || oracle || ' ' || reason || ' ' || id"
)
_WORDS: Final = ("scenario", "sut", "oracle", "id", "repeat", "reason")
"""The columns of that text: what neither slash nor space is in stands in one of them."""
_WILD: Final = re.compile(r"[\\%_]")
_ESCAPED: Final = r"\\\g<0>"
_AFTER_ANY_TEXT: Final = "\U0010ffff"
"""Behind every text that begins with what stands before it."""


def campaign_filter(query: CampaignQuery) -> tuple[str, list[Any]]:
    """Return the condition, and its values, that a question about campaigns comes to."""
    conditions: list[str] = ["finished_at IS NULL"] if query.unfinished else []
    values: list[Any] = []
    for column in ("id", "name"):
        wanted = getattr(query, column)
        if wanted:
            conditions.append(f"{column} = ?")
            values.append(wanted)
    if query.beginning:
        # By comparison, not LIKE: only that uses the index on ids.
        conditions.append("id >= ? AND id < ?")
        values += [query.beginning, query.beginning + _AFTER_ANY_TEXT]
    return ("WHERE " + " AND ".join(conditions) if conditions else ""), values


def run_order(query: RunQuery) -> str:
    """Return what runs are sorted by; raises :class:`Refused` for what is no column."""
    column = _SORTABLE.get(query.sort)
    if column is None:
        raise Refused(f"cannot sort by {query.sort!r}: {did_you_mean(query.sort, _SORTABLE)}")
    if column == "serial" and query.campaign:
        column = "position"  # the same order, and there is an index on it
    order = f"{column} {'DESC' if query.descending else 'ASC'}"
    if column == "margin":
        order = f"margin IS NULL, {order}"  # what has none comes last, either way
    return order if column in ("serial", "position") else f"{order}, serial"


def run_filter(query: RunQuery) -> tuple[str, list[Any]]:
    """Return the condition, and its values, that a question about runs comes to.

    Raises :class:`Refused` for a state or an outcome that there is not.
    """
    conditions: list[str] = []
    values: list[Any] = []
    for column in ("campaign", "state", "outcome", "scenario", "sut"):
        wanted = getattr(query, column)
        if wanted:
            _check_word(column, wanted)
            conditions.append(f"{column} = ?")
            values.append(wanted)
    if query.text:
        # Looking through 100,000 texts put together takes twice as long as through their parts.
        columns = (f"({_TEXT})",) if set(query.text) & {"/", " "} else _WORDS
        found = " OR ".join(f"{column} LIKE ? ESCAPE '\\'" for column in columns)
        conditions.append(f"({found})")
        values += [f"%{_WILD.sub(_ESCAPED, query.text)}%"] * len(columns)
    return ("WHERE " + " AND ".join(conditions) if conditions else ""), values


def _check_word(column: str, word: str) -> None:
    known: Iterable[str] = {"state": RunState, "outcome": Outcome}.get(column, ())
    names = [str(name) for name in known]
    if names and word not in names:
        raise Refused(f"there is no {column} {word!r}: {did_you_mean(word, names)}")
