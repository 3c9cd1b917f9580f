"""What happened to a run: its attempts by the ledger, what it said, what its trace recorded.

Read from a state directory as it is, without a daemon.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import PlaceUnusable
from daemon.batch.ledger import LedgerReader
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import OUTPUT, read_output

if TYPE_CHECKING:
    from daemon.trace import Trace


# Simulated seconds: bodies that bounce or scrape are in contact in some steps and not in others.
_CONTACT_GAP: Final = 0.5


@dataclass(frozen=True, slots=True)
class RunStep:
    """A step in the life of a run: the state it came to, when, and why if there is a reason."""

    at: float
    state: str
    note: str


@dataclass(frozen=True, slots=True)
class RunLogLine:
    """A line of the record of a run, at a moment of simulated time [s]."""

    time: float
    source: str
    text: str
    level: str = "info"


def read_steps(paths: StatePaths, run: str) -> tuple[RunStep, ...]:
    """Return the steps the ledger remembers, the oldest first; the earliest may be forgotten.

    Raises :class:`daemon.batch.errors.DaemonError` when there is no ledger that can be read.
    """
    if not paths.ledger.is_file():
        raise PlaceUnusable(f"{paths.state} is no state directory: choose another with --state")
    with LedgerReader.open(paths) as ledger:
        return tuple(RunStep(*step) for step in ledger.steps(run))


def read_outputs(paths: StatePaths, run: str) -> tuple[str, ...]:
    """Return what attempts on this machine printed that are running or not yet handed over.

    Of each the first and the last part, about a MiB at most.
    """
    files = sorted(paths.spool.glob(f"*/{run}/attempt-*/{OUTPUT}"))
    texts = (read_output(file.parent).decode("utf-8", "replace").strip() for file in files)
    return tuple(filter(None, texts))


def read_run_log(path: Path) -> tuple[RunLogLine, ...]:
    """Return what a trace recorded besides signals: mission, contacts, words of the SUT, in order.

    Raises :class:`daemon.trace.TraceError` for a trace that cannot be read.
    """
    from daemon.trace import read_trace

    trace = read_trace(path)
    found = [*_mission(trace), *_contacts(trace)]
    found += (
        RunLogLine(event.time, event.source, event.text, event.level) for event in trace.events
    )
    end = trace.ended or "cut off: the recording has no end"
    found.append(
        RunLogLine(trace.valid_until, "run", f"{end}{f', {trace.note}' if trace.note else ''}")
    )
    return tuple(sorted(found, key=lambda said: said.time))


def _mission(trace: Trace) -> Iterator[RunLogLine]:
    names = [waypoint.id for waypoint in trace.spec.mission.waypoints]
    before = 0
    for progress in trace.progress:
        for index in range(before, min(progress.reached, len(names))):
            count = f"{index + 1} of {len(names)}"
            yield RunLogLine(progress.time, "mission", f"{names[index]} reached, {count}")
        before = max(before, progress.reached)
        if progress.state != "active":
            yield RunLogLine(progress.time, "mission", progress.state)


def _contacts(trace: Trace) -> Iterator[RunLogLine]:
    """Tell contacts once for as long as they last."""
    last: dict[tuple[str, str], float] = {}
    for contact in trace.contacts:
        pair = (contact.first, contact.second)
        if contact.time - last.get(pair, -1e9) > _CONTACT_GAP:
            text = f"{contact.first} touches {contact.second}"
            yield RunLogLine(contact.time, "contact", text, "warn")
        last[pair] = contact.time
