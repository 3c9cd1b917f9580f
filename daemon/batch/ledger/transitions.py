"""The life of a run as a pure function: an event in, the new record and an answer out.

    queued ──lease, renew──▶ running ──complete──▶ done
       ▲                       │
       └────release, lapse─────┘   after ``attempts`` strikes, or MOST_LAPSES in a row ──▶ lost
    queued, running ──cancel──▶ cancelled          lost, cancelled, done ──retry──▶ queued
    queued, running, lost ──complete, under whatever lease──▶ done

A lease belongs to the work under it, not to a connection. A lease that is not renewed in time
lapses: the run is queued for others, without blame. Its holder may still be at work without a
connection, and come back with a renewal. If the run still waits, it goes on under the old lease; if
another worker has it by then, both go on. A strike is reported by the worker itself: the process of
the run died or hung.

Execution is at least once, the result is exactly one: the first one wins, even a late one from
a lapsed lease. Runs are deterministic, so a second, different result raises an alarm; for systems
under test that are not repeatable it is valid, but redundant.

The retry of a done run asks for a new execution: leases granted before are outdated. They hold
and settle nothing, and their results do not replace a removed one. Retried runs that were lost or
cancelled had no result: results under their old leases count.

Callers must check that tokens were granted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from daemon.model.messages import LedgerAnswer
from daemon.model.status import NONDETERMINISTIC
from daemon.model.verdicts import RunState

MOST_LAPSES: Final = 20
"""Lapses of one run in a row after which the run counts as their cause.

A run that brings down its machine never gets a strike, since no worker is left to report it. Twenty
lost connections in a row are less likely.
"""


@dataclass(frozen=True, slots=True)
class ExecutionState:
    """State of a run's execution in the ledger.

    ``attempt`` counts leases, ``strikes`` those that ended badly, ``lapses`` those that lapsed in a
    row. ``token`` is that of the current lease, ``granted`` that of the latest one, current or not;
    tokens up to ``outdated`` are from before a retry. ``result`` is the digest of the recorded
    result, or empty. ``repeatable`` never changes: equal runs must give equal results.
    ``nondeterministic``: this one did not, although it is repeatable; ``reason`` has the
    difference, and both are reset together.
    """

    state: RunState = RunState.QUEUED
    attempt: int = 0
    strikes: int = 0
    worker: str = ""
    token: int = 0
    result: str = ""
    reason: str = ""
    repeatable: bool = True
    granted: int = 0
    outdated: int = 0
    lapses: int = 0
    nondeterministic: bool = False


@dataclass(frozen=True, slots=True)
class Leased:
    """A worker takes the run."""

    worker: str
    token: int


@dataclass(frozen=True, slots=True)
class Renewed:
    """The ``worker`` still executes it under ``token``, its own lease or one it has taken over."""

    worker: str
    token: int


@dataclass(frozen=True, slots=True)
class Completed:
    """A result with this digest arrived, executed under ``token``; ``worker`` brought it.

    It is not ``comparable`` with the recorded one if the wall clock ended one of them: such a run
    differs every time.
    """

    token: int
    digest: str
    worker: str = ""
    comparable: bool = True


@dataclass(frozen=True, slots=True)
class Released:
    """The lease ``token`` ended without a result; ``blame`` makes it a strike.

    With ``died`` its worker died, which counts as a lapse.
    """

    token: int
    reason: str
    blame: bool
    died: bool = False


@dataclass(frozen=True, slots=True)
class Lapsed:
    """The lease ``token`` was not renewed in time; the state of the work is unknown."""

    token: int


@dataclass(frozen=True, slots=True)
class Cancelled:
    """A person has cancelled the run."""


@dataclass(frozen=True, slots=True)
class Retried:
    """A person asks for a new execution; ``stopped``: the wall clock ended the run."""

    stopped: bool = False


RunEvent: TypeAlias = Leased | Renewed | Completed | Released | Lapsed | Cancelled | Retried


@dataclass(frozen=True, slots=True)
class RunTransition:
    """The new state and the answer to the sender; with ``record`` the result is stored."""

    run: ExecutionState
    answer: LedgerAnswer
    record: bool = False


def advance(run: ExecutionState, event: RunEvent, *, attempts: int) -> RunTransition:
    """Return the effect of ``event`` on ``run``; a run is lost after ``attempts`` strikes."""
    match event:
        case Leased():
            return _lease(run, event)
        case Renewed():
            return _renew(run, event)
        case Completed():
            return _complete(run, event)
        case Released(token, reason, blame, died):
            if not _holds(run, token):
                return RunTransition(run, LedgerAnswer.STALE)
            if died:
                return RunTransition(_lapse(run, reason), LedgerAnswer.DONE)
            return RunTransition(_give_back(run, reason, blame, attempts), LedgerAnswer.DONE)
        case Lapsed(token):
            if not _holds(run, token):
                return RunTransition(run, LedgerAnswer.STALE)
            return RunTransition(_lapse(run, "the worker fell silent"), LedgerAnswer.DONE)
        case Cancelled():
            if run.state not in (RunState.QUEUED, RunState.RUNNING):
                return RunTransition(run, LedgerAnswer.STALE)
            state = RunState.DONE if run.result else RunState.CANCELLED
            return RunTransition(_at_rest(run, state, "cancelled"), LedgerAnswer.DONE)
        case Retried(stopped):
            if run.state in (RunState.QUEUED, RunState.RUNNING):
                return RunTransition(run, LedgerAnswer.STALE)
            return RunTransition(_retry(run, stopped), LedgerAnswer.DONE)


def _holds(run: ExecutionState, token: int) -> bool:
    return run.state is RunState.RUNNING and run.token == token


def _at_rest(run: ExecutionState, state: RunState, reason: str) -> ExecutionState:
    return replace(run, state=state, token=0, reason=reason, nondeterministic=False)


def _lease(run: ExecutionState, event: Leased) -> RunTransition:
    if run.state is not RunState.QUEUED:
        return RunTransition(run, LedgerAnswer.STALE)
    running = replace(
        run,
        state=RunState.RUNNING,
        attempt=run.attempt + 1,
        worker=event.worker,
        token=event.token,
        granted=event.token,
    )
    return RunTransition(running, LedgerAnswer.DONE)


def _renew(run: ExecutionState, event: Renewed) -> RunTransition:
    """Answer a renewal: done means that the work goes on, even if another worker has the run."""
    if run.state in (RunState.DONE, RunState.CANCELLED) or event.token <= run.outdated:
        return RunTransition(run, LedgerAnswer.STALE)
    if _holds(run, event.token):
        return RunTransition(replace(run, worker=event.worker), LedgerAnswer.DONE)
    if run.state is not RunState.QUEUED:
        # Another worker has it, or it is lost: the work goes on, since its result may be first.
        return RunTransition(run, LedgerAnswer.DONE)
    back = replace(
        run,
        state=RunState.RUNNING,
        worker=event.worker,
        token=event.token,
        reason="",
        nondeterministic=False,
        lapses=0,
    )
    return RunTransition(back, LedgerAnswer.DONE)


def _complete(run: ExecutionState, event: Completed) -> RunTransition:
    token, digest = event.token, event.digest
    if run.state is RunState.CANCELLED:
        return RunTransition(run, LedgerAnswer.DROPPED)
    # Under any lease: late results count too.
    if not run.result:
        if token <= run.outdated:
            return RunTransition(run, LedgerAnswer.REDUNDANT)
        # The worker that brought the result may differ from the holder of the lease.
        worker = event.worker or run.worker
        done = replace(_at_rest(run, RunState.DONE, ""), result=digest, worker=worker, lapses=0)
        return RunTransition(done, LedgerAnswer.RECORDED, record=True)
    if run.result == digest:
        return RunTransition(_settled(run, token), LedgerAnswer.KNOWN)
    if not (run.repeatable and event.comparable):
        return RunTransition(_settled(run, token), LedgerAnswer.REDUNDANT)
    words = f"another attempt gave {digest[:12]}, recorded is {run.result[:12]}"
    differing = replace(run, reason=f"{NONDETERMINISTIC}: {words}", nondeterministic=True)
    return RunTransition(_settled(differing, token), LedgerAnswer.DIFFERS)


def _settled(run: ExecutionState, token: int) -> ExecutionState:
    """End a repetition of a run with a result, unless ``token`` is from before the retry."""
    if token > run.outdated and run.state in (RunState.QUEUED, RunState.RUNNING):
        return replace(run, state=RunState.DONE, token=0, lapses=0)
    return run


def _give_back(run: ExecutionState, reason: str, blame: bool, attempts: int) -> ExecutionState:
    # Count strikes, not leases: a worker's shutdown or a full disk is not the run's fault.
    strikes = run.strikes + blame
    if strikes < attempts:
        state = RunState.QUEUED
    else:
        state = RunState.DONE if run.result else RunState.LOST
    return replace(_at_rest(run, state, reason), strikes=strikes, lapses=0)


def _lapse(run: ExecutionState, reason: str) -> ExecutionState:
    lapses = run.lapses + 1
    if lapses < MOST_LAPSES:
        resting = _at_rest(run, RunState.QUEUED, reason)
    else:
        state = RunState.DONE if run.result else RunState.LOST
        words = f"{lapses} workers in a row died with it or fell silent: it may bring down machines"
        resting = _at_rest(run, state, words)
    return replace(resting, lapses=lapses)


def _retry(run: ExecutionState, stopped: bool) -> ExecutionState:
    again = replace(_at_rest(run, RunState.QUEUED, ""), strikes=0, lapses=0)
    if run.state is not RunState.DONE:
        return again
    # The next result may differ, and then replaces the first.
    result = run.result if run.repeatable and not stopped else ""
    return replace(again, result=result, outdated=run.granted)
