"""Executing a campaign to its end: by a daemon that lives as long as the command, or that stays.

Imports the client and the launcher; commands import this module when they need it.
"""

from __future__ import annotations

import shlex
import shutil
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.analysis.results import CampaignResults, read_results
from daemon.batch.client import Client
from daemon.batch.launch import embedded_daemon, ensure_daemon, running_daemon
from daemon.batch.paths import StatePaths, endpoint_text
from daemon.model.execution import machine_text
from daemon.model.status import RunRow
from grammars.text.words import count_noun
from scenario_tui.cli.compare import compare_with_baseline, final_code, print_comparison
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.output import print_commands, say, stdout_console
from scenario_tui.cli.results import emit_results, print_summary
from scenario_tui.library.watching import watch
from scenario_tui.source import DaemonTarget

if TYPE_CHECKING:
    from daemon.model.submission import Submission

_MAX_TROUBLE: Final = 20.0
"""Seconds without a worker, or with a full disk, after which nobody is going to help."""


def run_here(
    submission: Submission,
    folder: Path | None,
    slots: int | None,
    as_json: bool,
    *,
    wall: float = 0.0,
    attempts: int | None = None,
) -> CampaignResults:
    """Run every run of ``submission``, print the summary unless it is for JSON, return the results.

    ``wall`` [s] and ``attempts`` are those of the daemon, whose defaults hold without. Traces end
    up in ``folder``; everything else the daemon needed is removed, also when the command is
    interrupted.
    """
    # Reading the ledger and traces comes with it: for who only submits, a seventh of the time.
    from daemon.analysis.results import write_campaign_note

    target = (folder or Path("scenario-results") / submission.campaign).absolute()
    target.mkdir(parents=True, exist_ok=True)
    # First of all: with it the traces of a run that is interrupted can still be reported.
    write_campaign_note(target, submission, at=time.time(), machine=machine_text())
    started = time.perf_counter()
    with (
        _temporary_state(target, submission.campaign) as state,
        embedded_daemon(state, slots=slots, wall=wall, attempts=attempts) as endpoint,
    ):
        opened = partial(Client.open, endpoint)
        with opened() as daemon:
            daemon.submit(submission)
        row = watch(opened, submission.campaign, endurance=_MAX_TROUBLE)
        with opened() as daemon:
            found = read_results(daemon, row)
    results = replace(found, rows=tuple(_with_moved_trace(run, target) for run in found.rows))
    if not as_json:
        print_summary(_naming_traces(results), took=time.perf_counter() - started)
        kept = sum(1 for run in results.rows if run.trace)
        stdout_console().print(
            f"{count_noun(kept, 'trace')} in {typed_path(target)}\n", markup=False, soft_wrap=True
        )
    return results


@contextmanager
def _temporary_state(target: Path, campaign: str) -> Iterator[Path]:
    """Lend a state directory beside the traces; at the end its traces move out, it goes away."""
    # On the file system of the traces, so that moving them out renames and never copies.
    state = Path(tempfile.mkdtemp(prefix=".scenario-", dir=target))
    # Being told to end is being interrupted: what has finished is kept, nothing else is left.
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield state
    except KeyboardInterrupt:
        kept = _move_traces(state, target, campaign)
        say(f"\ninterrupted; {count_noun(kept, 'finished trace')} in {typed_path(target)}")
        raise
    else:
        _move_traces(state, target, campaign)
    finally:
        # The daemon inside has ended by now: it is the inner of the two contexts.
        signal.signal(signal.SIGTERM, before)
        shutil.rmtree(state, ignore_errors=True)


def _move_traces(state: Path, target: Path, campaign: str) -> int:
    traces = sorted((StatePaths(state).traces / campaign).glob("*.mcap"))
    for trace in traces:
        trace.replace(target / trace.name)
    return len(traces)


def _with_moved_trace(run: RunRow, target: Path) -> RunRow:
    return replace(run, trace=str(target / Path(run.trace).name)) if run.trace else run


def _naming_traces(results: CampaignResults) -> CampaignResults:
    """Return results whose surprises name traces: no daemon keeps these runs by their ids."""
    traces = {row.id: Path(row.trace) for row in results.rows if row.trace}
    surprises = tuple(
        replace(found, run=f"{typed_path(traces[found.run].parent)}{traces[found.run].name}")
        if found.run in traces
        else found
        for found in results.assessment.surprises
    )
    return replace(results, assessment=replace(results.assessment, surprises=surprises))


def typed_path(path: Path) -> str:
    """Return the path of a folder the way people type it."""
    try:
        return f"{path.relative_to(Path.cwd())}/"
    except ValueError:
        return f"{path}/"


def start_daemon_if_needed(target: DaemonTarget, slots: int | None) -> None:
    """See to it that the daemon answers; one is started unless people named it themselves."""
    started = "" if target.named else launch_daemon(target, slots)
    if started:
        say(started)


def launch_daemon(target: DaemonTarget, slots: int | None = None) -> str:
    """Start the daemon of this machine if none answers; return what to say, "" if one does.

    Raises :class:`~daemon.batch.errors.LaunchFailed` when it does not come up.
    """
    state = StatePaths.find(target.state).state
    if running_daemon(state) is not None:
        return ""
    where = endpoint_text(ensure_daemon(state, slots=slots))
    named = ("--state", str(target.state)) if target.state is not None else ()
    end = shlex.join(("scenario", "daemon", "--stop", *named))
    return f"started a daemon on this machine at {where} (`{end}` ends it)"


def watch_to_end(
    target: DaemonTarget,
    campaign: str,
    as_json: bool,
    baseline: str = "",
    worse_by: float | None = None,
) -> int:
    """Watch a campaign, print its summary, return the exit code it deserves.

    Ctrl-C ends the watching only.
    """
    try:
        row = watch(target.open, campaign)
    except KeyboardInterrupt:
        say(f"\n{campaign} goes on; come back with `scenario tui` or `scenario results {campaign}`")
        return ExitCode.INTERRUPTED
    with target.open() as daemon:
        results = read_results(daemon, row)
    between = compare_with_baseline(results, baseline, worse_by, target)
    if as_json:
        emit_results(results, comparison=between)
    else:
        took = (row.finished_at or row.submitted_at) - row.submitted_at
        print_summary(results, took=took)
        if between is not None:
            print_comparison(between)
        print_commands(
            ("scenario tui", "look at it in the dashboard"),
            (f"scenario results {campaign} --runs", "every run and its trace"),
        )
    return final_code(results, between)
