"""Running a campaign without a daemon of its own: one that lives as long as the command."""

from __future__ import annotations

import shutil
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

from daemon.assessment import RunRecord
from daemon.client import Client
from daemon.launch import embedded
from daemon.places import Places
from daemon.protocol import RunRow
from daemon.report import leave_note
from scenario_tui.cli._output import out, say
from scenario_tui.cli._progress import watch
from scenario_tui.cli._summary import print_summary
from scenario_tui.summary import Results, gather
from scenario_tui.wording import counted

if TYPE_CHECKING:
    from daemon.protocol import Submission

Run = TypeVar("Run", RunRow, RunRecord)
_ENDURANCE: Final = 20.0
"""Seconds without a worker, or with a full disk, after which nobody is going to help."""


def run_here(
    submission: Submission, folder: Path | None, slots: int | None, as_json: bool
) -> Results:
    """Run every run of ``submission``, print the summary unless it is for JSON, return the results.

    Traces end up in ``folder``; everything else the daemon needed is removed, also when the
    command is interrupted.
    """
    target = (folder or Path("scenario-results") / submission.campaign).absolute()
    target.mkdir(parents=True, exist_ok=True)
    leave_note(target, submission)
    started = time.perf_counter()
    with _workshop(target, submission.campaign) as state, embedded(state, slots=slots) as endpoint:
        opened = partial(Client.open, endpoint)
        with opened() as daemon:
            daemon.submit(submission)
        row = watch(opened, submission.campaign, endurance=_ENDURANCE)
        with opened() as daemon:
            found = gather(daemon, row)
    results = replace(
        found,
        rows=tuple(_moved(run, target) for run in found.rows),
        records=tuple(_moved(record, target) for record in found.records),
    )
    if not as_json:
        print_summary(results, took=time.perf_counter() - started)
        kept = sum(1 for run in results.rows if run.trace)
        out().print(f"{counted(kept, 'trace')} in {shown(target)}\n", markup=False, soft_wrap=True)
    return results


@contextmanager
def _workshop(target: Path, campaign: str) -> Iterator[Path]:
    """Lend a state directory beside the traces; at the end its traces move out, it goes away."""
    state = Path(tempfile.mkdtemp(prefix=".scenario-", dir=target))
    # Being told to end is being interrupted: what has finished is kept, nothing else is left.
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield state
    except KeyboardInterrupt:
        kept = _move_traces(state, target, campaign)
        say(f"\ninterrupted; {counted(kept, 'finished trace')} in {shown(target)}")
        raise
    else:
        _move_traces(state, target, campaign)
    finally:
        signal.signal(signal.SIGTERM, before)
        shutil.rmtree(state, ignore_errors=True)


def _move_traces(state: Path, target: Path, campaign: str) -> int:
    traces = sorted((Places(state).traces / campaign).glob("*.mcap"))
    for trace in traces:
        trace.replace(target / trace.name)
    return len(traces)


def _moved(run: Run, target: Path) -> Run:
    return replace(run, trace=str(target / Path(run.trace).name)) if run.trace else run


def shown(path: Path) -> str:
    """Return a path the way people type it."""
    try:
        return f"{path.relative_to(Path.cwd())}/"
    except ValueError:
        return f"{path}/"
