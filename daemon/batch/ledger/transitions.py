"""The life of a run as a pure function: an event in, the new record and an answer out.

    queued ──lease, renew──▶ running ──complete──▶ done
       ▲                       │
       └────release, lapse─────┘   after ``attempts`` strikes, or MOST_LAPSES in a row ──▶ lost
    queued, running ──cancel──▶ cancelled          lost, cancelled, done ──retry──▶ queued
    queued, running, lost ──complete, under whatever lease──▶ done

A lease belongs to the work that is done under it, not to a connection. One that is not renewed in
time lapses: the run is queued for others, and nobody is to blame. Who held it may still be at work,
cut off, and comes back with a renewal: if the run still waits it goes on under its old lease; if
another has it by then, both go on. A strike is what the worker itself reports: the process of the
run died or hung.

Execution is at least once, the result is exactly one: the first one wins, also a late one from
a lease that lapsed. Runs are deterministic, so a second result that differs raises an alarm; for
systems under test that are not repeatable it is as good as the first one, and not needed.

Whoever retries a run that is done wants another execution than those under way or on their way:
leases granted before are outdated. They hold nothing and settle nothing, and where the old result
was forgotten, so that the next one takes its place, theirs does not. Retried runs that were lost or
cancelled had no result: theirs are as good as any.

Tokens are taken for what they are said to be: whoever calls has looked up that they were granted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from daemon.model.messages import LedgerAnswer
from daemon.model.run_state import RunState
from daemon.model.status import NONDETERMINISTIC

MOST_LAPSES: Final = 20
"""Leases of one run that lapse one after the other before it is taken for the cause.

A run that brings down its machine never gets a strike: nobody is left to report it. Cables that are
pulled twenty times, each time before a worker came back, are less likely.
"""


@dataclass(frozen=True, slots=True)
class ExecutionState:
    """What the ledger knows about a run's execution.

    ``attempt`` counts leases, ``strikes`` those that ended badly, ``lapses`` those that lapsed in a
    row. ``token`` is that of the lease it is running under, ``granted`` that of the latest one,
    also when that is over; those up to ``outdated`` are of before a retry. ``result`` is the digest
    of the recorded result, empty while there is none. ``repeatable`` never changes: whether the
    same run gives the same result again. ``nondeterministic`` is one that did not, although it is
    repeatable; ``reason`` says how, and both are forgotten together.
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
    """The ``worker`` is still at it under ``token``, its own lease or one it has taken over."""

    worker: str
    token: int


@dataclass(frozen=True, slots=True)
class Completed:
    """A result with this digest arrived, executed under ``token``; ``worker`` brought it.

    It is not ``comparable`` with the recorded one when the wall clock ended one of them: such a run
    differs every time.
    """

    token: int
    digest: str
    worker: str = ""
    comparable: bool = True


@dataclass(frozen=True, slots=True)
class Released:
    """The lease ``token`` ended without a result; ``blame`` makes it a strike.

    With ``died`` its worker died: as bad as one that fell silent.
    """

    token: int
    reason: str
    blame: bool
    died: bool = False


@dataclass(frozen=True, slots=True)
class Lapsed:
    """The lease ``token`` was not renewed in time; nobody knows what became of the work."""

    token: int


@dataclass(frozen=True, slots=True)
class Cancelled:
    """Somebody does not want the run any more."""


@dataclass(frozen=True, slots=True)
class Retried:
    """Somebody wants the run executed again; ``stopped`` is one that the wall clock ended."""

    stopped: bool = False


RunEvent: TypeAlias = Leased | Renewed | Completed | Released | Lapsed | Cancelled | Retried


@dataclass(frozen=True, slots=True)
class RunTransition:
    """The record afterwards and the answer to whoever caused it; ``record`` keeps the result."""

    run: ExecutionState
    answer: LedgerAnswer
    record: bool = False


def advance(run: ExecutionState, event: RunEvent, *, attempts: int) -> RunTransition:
    """Return what ``event`` makes of ``run``; a run is lost after ``attempts`` strikes."""
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
    taken = replace(
        run,
        state=RunState.RUNNING,
        attempt=run.attempt + 1,
        worker=event.worker,
        token=event.token,
        granted=event.token,
    )
    return RunTransition(taken, LedgerAnswer.DONE)


def _renew(run: ExecutionState, event: Renewed) -> RunTransition:
    """Answer a renewal: done means that the work is still wanted, whoever else is at it too."""
    if run.state in (RunState.DONE, RunState.CANCELLED) or event.token <= run.outdated:
        return RunTransition(run, LedgerAnswer.STALE)
    if _holds(run, event.token):
        return RunTransition(replace(run, worker=event.worker), LedgerAnswer.DONE)
    if run.state is not RunState.QUEUED:
        # Another has it, or it is lost: work that is well is not stopped, its result may be first.
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
    # Whatever lease it comes from: work that is done is not thrown away because it came late.
    if not run.result:
        if token <= run.outdated:
            return RunTransition(run, LedgerAnswer.REDUNDANT)
        # Whose result it is, which may be another one than who has the lease.
        worker = event.worker or run.worker
        done = replace(_at_rest(run, RunState.DONE, ""), result=digest, worker=worker, lapses=0)
        return RunTransition(done, LedgerAnswer.RECORDED, record=True)
    if run.result == digest:
        return RunTransition(_settled(run, token), LedgerAnswer.KNOWN)
    if not (run.repeatable and event.comparable):
        return RunTransition(_settled(run, token), LedgerAnswer.REDUNDANT)
    told = f"another attempt gave {digest[:12]}, recorded is {run.result[:12]}"
    differing = replace(run, reason=f"{NONDETERMINISTIC}: {told}", nondeterministic=True)
    return RunTransition(_settled(differing, token), LedgerAnswer.DIFFERS)


def _settled(run: ExecutionState, token: int) -> ExecutionState:
    """A result was there before: only what was executed since ends the repetition under way."""
    if token > run.outdated and run.state in (RunState.QUEUED, RunState.RUNNING):
        return replace(run, state=RunState.DONE, token=0, lapses=0)
    return run


def _give_back(run: ExecutionState, reason: str, blame: bool, attempts: int) -> ExecutionState:
    # Leases, not strikes, would count a worker's shutdown or a full disk against the run.
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
        told = f"{lapses} workers in a row died with it or fell silent: it may bring down machines"
        resting = _at_rest(run, state, told)
    return replace(resting, lapses=lapses)


def _retry(run: ExecutionState, stopped: bool) -> ExecutionState:
    again = replace(_at_rest(run, RunState.QUEUED, ""), strikes=0, lapses=0)
    if run.state is not RunState.DONE:
        return again
    # What comes is another result, not the same again: it takes the place of the first.
    result = run.result if run.repeatable and not stopped else ""
    return replace(again, result=result, outdated=run.granted)
