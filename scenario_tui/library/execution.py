"""Execution of a campaign here and now, by a daemon that lives as long as the call."""

from __future__ import annotations

import fcntl
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.analysis.results import CampaignResults, read_results, write_campaign_note
from daemon.batch.client import Client
from daemon.batch.launch import embedded_daemon
from daemon.batch.paths import StatePaths, is_locked
from daemon.judging.assessment import assess
from daemon.model.execution import machine_text
from daemon.model.status import RunRow
from grammars.text.diagnostics import InputError, Where
from scenario_tui.interrupts import stop_if_interrupted
from scenario_tui.library.watching import ENDURANCE, WatchedRuns, watch

if TYPE_CHECKING:
    from daemon.model.submission import Submission

_STATE: Final = ".scenario-"
"""Beginning of the name of a temporary state directory beside the traces."""
_LOCK: Final = "run.lock"
"""File in it that its run holds locked."""


def run_here(
    submission: Submission,
    folder: Path | None,
    workers: int | None,
    *,
    wall: float | None = None,
    attempts: int | None = None,
) -> CampaignResults:
    """Execute every run of a submission and return the results, as the folder of traces has them.

    ``wall`` [s] and ``attempts`` are those of the daemon, whose defaults hold without. Traces end
    up in ``folder``; everything else the daemon needed is removed, also after an interrupt.
    """
    if workers is not None and workers < 1:
        # Every run would wait for ever.
        raise InputError.at(Where("workers"), f"{workers} run nothing", "write 1 or more")
    # A library that loaded may have lost an interrupt.
    stop_if_interrupted()
    target = traces_folder(submission, folder)
    target.mkdir(parents=True, exist_ok=True)
    # First of all: the traces of an interrupted run can be reported with it.
    write_campaign_note(target, submission, at=time.time(), machine=machine_text())
    with (
        _temporary_state(target) as state,
        embedded_daemon(state, slots=workers, wall=wall, attempts=attempts) as endpoint,
    ):
        opened = partial(Client.open, endpoint)
        with opened() as daemon:
            daemon.submit(submission)
        row = watch(opened, WatchedRuns(submission.campaign), endurance=ENDURANCE)
        with opened() as daemon:
            results = read_results(daemon, row)
    rows = tuple(_moved(run, target) for run in results.rows)
    assessment = assess(results.declared, rows)
    return replace(results, rows=rows, assessment=assessment, where=str(target))


def traces_folder(submission: Submission, folder: Path | None) -> Path:
    """Return where the traces of a submission go: ``folder``, or one of their own here."""
    return folder or Path("scenario-results") / submission.campaign


def _moved(run: RunRow, target: Path) -> RunRow:
    """Return a run by the path of its trace, if it has one: no daemon knows its id any more."""
    path = target / Path(run.trace).name
    return replace(run, id=str(path), trace=str(path.absolute())) if run.trace else run


@contextmanager
def _temporary_state(target: Path) -> Iterator[Path]:
    """Yield a state directory beside the traces; at the end move its traces out and remove it."""
    # A run that was killed left its own. With its traces there, cells would have runs twice.
    for earlier in target.glob(f"{_STATE}*"):
        if not (is_locked(earlier / _LOCK) or is_locked(StatePaths(earlier).lock)):
            _move_out(earlier, target)
    # On the file system of the traces, so that moving them out renames and never copies.
    state = Path(tempfile.mkdtemp(prefix=_STATE, dir=target.absolute()))
    with (state / _LOCK).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            yield state
        finally:
            # The daemon inside has ended by now: it is the inner of the two contexts.
            _move_out(state, target)


def _move_out(state: Path, target: Path) -> None:
    try:
        for trace in StatePaths(state).traces.glob("*/*.mcap"):
            trace.replace(target / trace.name)
    finally:
        shutil.rmtree(state, ignore_errors=True)
