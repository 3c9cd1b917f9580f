"""What happened to a run: its attempts by the ledger, what it said, what its trace recorded.

Read from a state directory as it is, without a daemon.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from daemon.batch.errors import PlaceUnusable
from daemon.batch.ledger import LedgerReader
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import OUTPUT, read_output
from grammars.text.files import matching_paths

if TYPE_CHECKING:
    from daemon.model.live_judgement import LogLine


@dataclass(frozen=True, slots=True)
class RunStep:
    """A step in the life of a run: the state it came to, when, and why if there is a reason."""

    at: float
    state: str
    note: str


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
    files = sorted(matching_paths(paths.spool, f"*/{run}/attempt-*/{OUTPUT}"))
    texts = (read_output(file.parent).decode("utf-8", "replace").strip() for file in files)
    return tuple(filter(None, texts))


def read_run_log(path: Path) -> tuple[LogLine, ...]:
    """Return what a trace recorded besides signals: mission, contacts, words of the SUT, in order.

    Raises :class:`daemon.trace.TraceError` for a trace that cannot be read.
    """
    from daemon.judging.run_log import run_log
    from daemon.model.live_judgement import LogLine
    from daemon.trace import read_trace

    trace = read_trace(path)
    end = trace.ended or "cut off: the recording has no end"
    lines = run_log(trace)
    # The reason of a system that cannot go on is an event, too.
    note = "" if any(line.text == trace.note for line in lines) else trace.note
    last = LogLine(trace.valid_until, "run", f"{end}{f', {note}' if note else ''}")
    return (*lines, last)
