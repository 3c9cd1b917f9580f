"""The doctor's look at searches: those that failed, and those whose files are gone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import LedgerReader
from daemon.batch.operation._findings import DoctorFinding, ok, problem, warning
from daemon.batch.paths import StatePaths
from daemon.model.search_answer import SearchQuery, SearchRow

_SHOWN: Final = 3
_LONGEST: Final = 300


def check_searches(paths: StatePaths) -> Iterator[DoctorFinding]:
    """Look at the searches of the ledger; without any there is nothing to say."""
    if not paths.ledger.exists():
        return
    try:
        with LedgerReader.open(paths) as ledger:
            rows = ledger.searches(SearchQuery())
    except DaemonError:
        return  # the ledger's own finding says so
    running = [row for row in rows if row.state == "running"]
    for row in running:
        if not (paths.search(row.campaign) / row.file).is_file():
            words = f"the files of {row.campaign}, which goes on, are gone"
            yield problem("searches", words, "submit it again: they are sent along")
    failed = [row for row in rows if row.state == "failed"]
    for row in failed[:_SHOWN]:
        yield warning("searches", f"{row.campaign} failed: {_note(row)}", _remedy(row))
    if len(failed) > _SHOWN:
        words = f"{len(failed) - _SHOWN} more have failed"
        yield warning("searches", words, "`scenario search --list` names them")
    if rows and not failed:
        yield ok("searches", f"{len(rows)}, {len(running)} of them running")


def _note(row: SearchRow) -> str:
    return " ".join(row.note.split())[:_LONGEST]


def _remedy(row: SearchRow) -> str:
    again = f"`scenario retry {row.campaign}` goes on where it was"
    return f"{again}, `scenario delete {row.campaign}` removes it"
