"""Campaigns that a daemon executes: submitting, following and awaiting them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from daemon.batch.launch import ensure_daemon, running_daemon
from daemon.batch.paths import endpoint_text
from grammars.text.words import count_noun
from scenario_tui.interrupts import stop_if_interrupted
from scenario_tui.library.results import Results, Run
from scenario_tui.library.watching import (
    LOG,
    PATIENCE,
    SUBMIT_PATIENCE,
    CollectedRuns,
    ProgressDisplay,
    WatchedRuns,
    ask_patiently,
    follow,
    watch,
)
from scenario_tui.source import DaemonTarget

if TYPE_CHECKING:
    from daemon.model.status import SubmissionReceipt
    from daemon.model.submission import Submission


@dataclass(frozen=True, slots=True)
class Job:
    """A campaign that was submitted to a daemon; it continues after this program."""

    receipt: SubmissionReceipt
    """The answer of the daemon, with the numbers of runs and of those with a result."""
    _target: DaemonTarget

    def __repr__(self) -> str:
        return f"Job({self.id!r}, {count_noun(self.receipt.runs, 'run')})"

    @property
    def id(self) -> str:
        """The id of the campaign."""
        return self.receipt.campaign

    def results(self) -> Iterator[Run]:
        """Yield every run once it has a result or never gets one, as they come.

        Waits 120 s for a daemon that does not answer, then raises :class:`DaemonError`.
        """
        work, yielded = CollectedRuns(self.id), set[str]()
        for _ in follow(self._target.open, work, ProgressDisplay(None)):
            arrived = [row for row in work.rows if row.settled and row.id not in yielded]
            yielded |= {row.id for row in arrived}
            yield from (Run(row, self._target) for row in arrived)

    def wait(self, timeout: float | None = None) -> Results:
        """Return the results once every run has ended, or those so far after ``timeout`` seconds.

        A bar shows the progress on a terminal and in a notebook. Raises :class:`DaemonError` if the
        daemon does not answer any more.
        """
        return wait_for(self._target, self.id, limit=math.inf if timeout is None else timeout)

    def cancel(self) -> int:
        """Cancel all queued and running runs, and return their number."""
        return ask_patiently(self._target, lambda daemon: daemon.cancel(self.id), SUBMIT_PATIENCE)


def wait_for(
    target: DaemonTarget, campaign: str, *, patience: float = PATIENCE, limit: float = math.inf
) -> Results:
    """Return the results of a campaign once its last run has ended, or after ``limit`` seconds.

    Waits ``patience`` seconds for a daemon that does not answer.
    """
    # Imported here: the reader of ledgers takes a seventh of the time of a submission.
    from daemon.analysis.results import read_results

    work = WatchedRuns(campaign, target.command)
    row = watch(target.open, work, patience=patience, limit=limit)
    value = ask_patiently(target, lambda daemon: read_results(daemon, row), PATIENCE)
    return Results(value, target)


def submit_to(target: DaemonTarget, submission: Submission, workers: int | None = None) -> Job:
    """Submit to a daemon; the daemon of this machine is started if necessary."""
    # The load of a library may have lost an interrupt.
    stop_if_interrupted()
    start_daemon_if_needed(target, workers)
    # A repeated request submits nothing twice: the daemon knows the campaign by its id.
    return Job(ask_patiently(target, lambda d: d.submit(submission), SUBMIT_PATIENCE), target)


def start_daemon_if_needed(target: DaemonTarget, workers: int | None = None) -> None:
    """Start the daemon of this machine unless it answers or people named another."""
    started = "" if target.named else launch_daemon(target, workers)
    if started:
        LOG.info("%s", started)


def launch_daemon(target: DaemonTarget, workers: int | None = None) -> str:
    """Start the daemon of this machine if none answers; return a message, "" if one does.

    Raises :class:`~daemon.batch.errors.LaunchFailed` if it does not come up.
    """
    state = target.paths.state
    if running_daemon(state) is not None:
        return ""
    where = endpoint_text(ensure_daemon(state, slots=workers))
    end = target.command("daemon", "--stop")
    return f"started a daemon on this machine at {where} (`{end}` ends it)"
