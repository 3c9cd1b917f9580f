"""Provenance of the numbers of a report: when, which file at which commit, on what, with what.

A page is a function of its data: no clock and no folder is read here. Unknown facts are left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from typing import Final

from daemon.analysis.report._data import ReportData
from daemon.model.spec import own_version
from daemon.model.submission import CampaignOrigin
from grammars.text.words import count_noun

_SHOWN_OF_HASH: Final = 12
_MOST_KINDS: Final = 4
"""Machines, or sets of versions, that are told; of more their number."""


def provenance(data: ReportData) -> tuple[tuple[str, str], ...]:
    """Return what is known of where the runs of a report are from, as names and values."""
    return tuple((name, value) for name, value in _facts(data) if value)


def _facts(data: ReportData) -> Iterator[tuple[str, str]]:
    origin = data.input.origin
    yield "executed", _span(data.input.submitted_at, data.input.finished_at)
    if origin.file:
        yield "campaign file", f"{origin.file}, SHA-256 {origin.digest[:_SHOWN_OF_HASH]}…"
        yield "version control", _commit(origin)
    yield "seed", "" if origin.seed is None else str(origin.seed)
    results = [run.record.result for run in data.runs if run.record.result is not None]
    machines = Counter(result.machine for result in results if result.machine)
    yield "machine", _kinds(machines, len(results))
    reused = sum(bool(run.record.cached) for run in data.runs)
    yield "used again", f"{count_noun(reused, 'result')} of earlier campaigns" if reused else ""
    versions = Counter(_versions(run.versions) for run in data.runs if run.versions)
    yield "simulated with", _kinds(versions, len(data.runs))
    yield "page written by", own_version()


def _span(start: float | None, end: float | None) -> str:
    """Return a date and its times: ``2026-11-23, 15:20 to 15:22 UTC``."""
    if start is None:
        return ""
    began = datetime.fromtimestamp(start, UTC)
    if end is None:
        return f"{began:%Y-%m-%d, %H:%M} UTC"
    ended = datetime.fromtimestamp(end, UTC)
    day = "" if ended.date() == began.date() else f"{ended:%Y-%m-%d, }"
    return f"{began:%Y-%m-%d, %H:%M} to {day}{ended:%H:%M} UTC"


def _commit(origin: CampaignOrigin) -> str:
    if origin.changed is None:
        return "no git repository"
    commit = f"commit {origin.commit[:_SHOWN_OF_HASH]}" if origin.commit else "no commit yet"
    branch = f" on {origin.branch}" if origin.branch else ""
    changed = "with changes that are not committed" if origin.changed else "nothing uncommitted"
    return f"{commit}{branch}, {changed}"


def _versions(versions: Iterable[tuple[str, str]]) -> str:
    """Return versions as a trace has them in a line, our own first."""
    others = dict(versions)
    ours = [f"{n} {others.pop(n)}" for n in ("scenario-tui", "engine") if others.get(n)]
    return ", ".join((*ours, *(f"{name} {version}" for name, version in sorted(others.items()))))


def _kinds(counts: Counter[str], whole: int) -> str:
    """Return one thing as it is, of several how many runs each has."""
    if len(counts) > _MOST_KINDS:
        return f"{len(counts)} different ones"
    alone = len(counts) == 1 and counts.total() == whole
    return "; ".join(
        name if alone else f"{name} ({count_noun(count, 'run')})" for name, count in counts.items()
    )
