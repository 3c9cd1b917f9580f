"""Every order in which two workers can work on three runs: each run gets exactly one result.

The pure function of the ledger is searched exhaustively, up to four leases. Workers are alike, and
so are runs of one kind: states that differ in names only are one state. A worker has one lease at a
time, which may be over without its knowing.
"""

from dataclasses import replace
from functools import cache

import pytest

from daemon.batch.ledger.transitions import (
    Cancelled,
    Completed,
    ExecutionState,
    Lapsed,
    Leased,
    Released,
    Renewed,
    Retried,
    advance,
)
from daemon.model.messages import LedgerAnswer
from daemon.model.run_state import RunState

WORKERS = 2
LEASES = 4
ATTEMPTS = 2
WAITING = (RunState.QUEUED, RunState.RUNNING)


def happen(run, event):
    """Let an event happen to a run; reasons are no part of a state."""
    change = advance(run, event, attempts=ATTEMPTS)
    check(run, event, change)
    return replace(change, run=replace(change.run, reason="", attempt=0))


def check(run, event, change):
    """Hold a step against the promise: whatever is recorded is the only result, and stays."""
    after = change.run
    assert bool(after.result) or after.state is not RunState.DONE
    assert not after.result or after.state not in (RunState.LOST, RunState.CANCELLED)
    assert (after.state is RunState.RUNNING) == bool(after.token)
    if change.record:
        assert (run.result, change.answer) == ("", LedgerAnswer.RECORDED)
        assert after.result == event.digest
    elif after.result != run.result:
        assert isinstance(event, Retried)
        assert not run.repeatable
    match event:
        case Completed(token) if token <= run.outdated:
            assert (after.state, change.record) == (run.state, False)
        case Completed():
            # Work that is wanted is never thrown away, whatever became of its lease.
            dropped = run.state is RunState.CANCELLED
            assert after.state is (RunState.CANCELLED if dropped else RunState.DONE)
            assert change.answer is not LedgerAnswer.DIFFERS
        case Leased():
            assert run.state is RunState.QUEUED or after == run
        case Renewed(_, token):
            over = run.state in (RunState.DONE, RunState.CANCELLED)
            unwanted = over or token <= run.outdated
            assert (change.answer is LedgerAnswer.STALE) == unwanted
            if unwanted or run.state is not RunState.QUEUED:
                assert after == run  # another has it: both go on
        case Lapsed():
            assert after.strikes == run.strikes
        case Retried() if run.state is RunState.DONE:
            assert after.outdated == run.granted
    if after.state in WAITING:
        # Whatever has happened, the run can still be executed.
        leased = after if after.token else advance(after, Leased("w", 99), attempts=1).run
        done = advance(leased, Completed(leased.token, "last"), attempts=1)
        assert done.run.state is RunState.DONE


@cache
def steps(run, held):
    """All that may become of a run and of the leases on it that workers ``held``."""
    found = set()
    if run.token:
        found.add((happen(run, Lapsed(run.token)).run, held))
    for token in set(held):
        rest = list(held)
        rest.remove(token)
        rest = tuple(rest)
        found.add((run, rest))  # its worker dies
        digest = "same" if run.repeatable else f"of {token}"
        done = happen(run, Completed(token, digest)).run
        found |= {(done, rest), (done, held)}  # the answer may be lost
        for blame, died in ((False, False), (True, False), (False, True)):
            found.add((happen(run, Released(token, "", blame, died)).run, rest))
        renewal = happen(run, Renewed("w", token))
        unwanted = renewal.answer is LedgerAnswer.STALE
        found.add((renewal.run, rest if unwanted else held))
    return tuple(found)


@cache
def lease(run, held):
    """The run after a worker has leased it, or ``None`` when it does not wait."""
    token = run.granted + 1
    change = happen(run, Leased("w", token))
    if change.answer is LedgerAnswer.STALE:
        return None
    return change.run, tuple(sorted((*held, token)))


@cache
def steered(run, held, event):
    """The run after somebody has cancelled or retried the campaign."""
    return happen(run, event).run, held


def successors(state):
    """Every state that one step leads to."""
    granted = sum(run.granted for run, _ in state)
    free = sum(len(held) for _, held in state) < WORKERS and granted < LEASES
    for number, one in enumerate(state):
        others = state[:number] + state[number + 1 :]
        changed = steps(*one)
        if free and (taken := lease(*one)):
            changed = (*changed, taken)
        for after in changed:
            yield in_order((*others, after))
    for event in (Cancelled(), Retried(stopped=False)):
        yield in_order([steered(*one, event) for one in state])


def in_order(state):
    return tuple(sorted(state, key=order))


@cache
def order(one):
    return repr(one)


@pytest.mark.parametrize("repeatable", [(True, True, True), (True, True, False)])
def test_whatever_two_workers_do_in_whatever_order_three_runs_have_one_result_each(repeatable):
    start = in_order([(ExecutionState(repeatable=one), ()) for one in repeatable])
    seen, front = {start}, [start]
    while front:
        front = list({after for state in front for after in successors(state)} - seen)
        seen.update(front)
    states = {tuple(run.state for run, _ in state) for state in seen}
    assert set().union(*states) == set(RunState)
    assert (RunState.DONE,) * 3 in states
