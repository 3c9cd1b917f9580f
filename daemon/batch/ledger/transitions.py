"""The life of a run as a pure function: an event in, the new record and an answer out.

    queued ──lease──▶ running ──complete──▶ done
       ▲                │
       └─release/expire─┘   after ``attempts`` strikes ──▶ lost
    queued, running ──cancel──▶ cancelled          lost, cancelled, done ──retry──▶ queued
                                                   done ──void──▶ queued

Execution is at least once, the result is exactly one: the first one wins, also a late one from
a lease that expired. Runs are deterministic, so a second result that differs raises an alarm; for
systems under test that are not repeatable it is as good as the first one, and not needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

from daemon.model.messages import LedgerAnswer
from daemon.model.status import NONDETERMINISTIC, RunState


@dataclass(frozen=True, slots=True)
class ExecutionState:
    """What the ledger knows about a run's execution.

    ``attempt`` counts leases, ``strikes`` those that ended badly. ``result`` is the digest of
    the recorded result, empty while there is none. ``repeatable`` never changes: whether the same
    run gives the same result again.
    """

    state: RunState = RunState.QUEUED
    attempt: int = 0
    strikes: int = 0
    worker: str = ""
    token: int = 0
    lease_until: float = 0.0
    result: str = ""
    reason: str = ""
    repeatable: bool = True


@dataclass(frozen=True, slots=True)
class Leased:
    """A worker takes the run."""

    worker: str
    token: int
    until: float


@dataclass(frozen=True, slots=True)
class Renewed:
    """The worker that holds ``token`` is still at it."""

    token: int
    until: float


@dataclass(frozen=True, slots=True)
class Completed:
    """A result with this digest arrived, executed under ``token``."""

    token: int
    digest: str


@dataclass(frozen=True, slots=True)
class Released:
    """The lease ``token`` ended without a result; ``blame`` makes it a strike."""

    token: int
    reason: str
    blame: bool


@dataclass(frozen=True, slots=True)
class Cancelled:
    """Somebody does not want the run any more."""


@dataclass(frozen=True, slots=True)
class Retried:
    """Somebody wants the run executed again; ``stopped`` is one that the wall clock ended."""

    stopped: bool = False


@dataclass(frozen=True, slots=True)
class Voided:
    """The result does not count any more, for a ``reason``: the run wants another one."""

    reason: str


RunEvent: TypeAlias = Leased | Renewed | Completed | Released | Cancelled | Retried | Voided


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
        case Renewed(token, until):
            if not _holds(run, token):
                return RunTransition(run, LedgerAnswer.STALE)
            # The later of both: renewals may overtake each other on the way.
            return RunTransition(
                replace(run, lease_until=max(until, run.lease_until)), LedgerAnswer.DONE
            )
        case Completed(token, digest):
            return _complete(run, token, digest)
        case Released(token, reason, blame):
            if not _holds(run, token):
                return RunTransition(run, LedgerAnswer.STALE)
            return RunTransition(_give_back(run, reason, blame, attempts), LedgerAnswer.DONE)
        case Cancelled():
            if run.state not in (RunState.QUEUED, RunState.RUNNING):
                return RunTransition(run, LedgerAnswer.STALE)
            state = RunState.DONE if run.result else RunState.CANCELLED
            return RunTransition(_at_rest(run, state, "cancelled"), LedgerAnswer.DONE)
        case Retried(stopped):
            if run.state in (RunState.QUEUED, RunState.RUNNING):
                return RunTransition(run, LedgerAnswer.STALE)
            # What comes is another result, not the same again: it takes the place of the first.
            result = run.result if run.repeatable and not stopped else ""
            queued = replace(_at_rest(run, RunState.QUEUED, ""), strikes=0, result=result)
            return RunTransition(queued, LedgerAnswer.DONE)
        case Voided(reason):
            return _void(run, reason)


def _void(run: ExecutionState, reason: str) -> RunTransition:
    """Forget the result: a repetition under way, or waiting, brings the one that counts."""
    if not run.result:
        return RunTransition(run, LedgerAnswer.STALE)
    forgotten = replace(run, result="", strikes=0, reason=reason)
    if run.state in (RunState.QUEUED, RunState.RUNNING):
        return RunTransition(forgotten, LedgerAnswer.DONE)
    return RunTransition(_at_rest(forgotten, RunState.QUEUED, reason), LedgerAnswer.DONE)


def _holds(run: ExecutionState, token: int) -> bool:
    return run.state is RunState.RUNNING and run.token == token


def _at_rest(run: ExecutionState, state: RunState, reason: str) -> ExecutionState:
    return replace(run, state=state, token=0, lease_until=0.0, reason=reason)


def _lease(run: ExecutionState, event: Leased) -> RunTransition:
    if run.state is not RunState.QUEUED:
        return RunTransition(run, LedgerAnswer.STALE)
    taken = replace(
        run,
        state=RunState.RUNNING,
        attempt=run.attempt + 1,
        worker=event.worker,
        token=event.token,
        lease_until=event.until,
    )
    return RunTransition(taken, LedgerAnswer.DONE)


def _complete(run: ExecutionState, token: int, digest: str) -> RunTransition:
    if run.state is RunState.CANCELLED:
        return RunTransition(run, LedgerAnswer.DROPPED)
    # Whatever lease it comes from: work that is done is not thrown away because it came late.
    if not run.result:
        done = replace(_at_rest(run, RunState.DONE, ""), result=digest)
        return RunTransition(done, LedgerAnswer.RECORDED, record=True)
    if run.result == digest:
        return RunTransition(_settled(run, token, run.reason), LedgerAnswer.KNOWN)
    if not run.repeatable:
        return RunTransition(_settled(run, token, run.reason), LedgerAnswer.REDUNDANT)
    told = f"another attempt gave {digest[:12]}, recorded is {run.result[:12]}"
    reason = f"{NONDETERMINISTIC}: {told}"
    return RunTransition(_settled(run, token, reason), LedgerAnswer.DIFFERS)


def _settled(run: ExecutionState, token: int, reason: str) -> ExecutionState:
    """A result was there before: only the holder of the lease ends the repetition under way."""
    if _holds(run, token):
        return _at_rest(run, RunState.DONE, reason)
    return replace(run, reason=reason)


def _give_back(run: ExecutionState, reason: str, blame: bool, attempts: int) -> ExecutionState:
    # Leases, not strikes, would count a worker's shutdown or a full disk against the run.
    strikes = run.strikes + blame
    if strikes < attempts:
        state = RunState.QUEUED
    else:
        state = RunState.DONE if run.result else RunState.LOST
    return replace(_at_rest(run, state, reason), strikes=strikes)
