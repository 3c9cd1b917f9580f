"""The life of a run as a pure function: events in, the new state and an answer out."""

from dataclasses import replace

import pytest

from daemon.batch.ledger.transitions import (
    MOST_LAPSES,
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
from daemon.model.verdicts import RunState

QUEUED = ExecutionState()
RUNNING = ExecutionState(RunState.RUNNING, attempt=1, worker="w", token=7, granted=7)
VARYING = replace(RUNNING, repeatable=False)
LOST = replace(QUEUED, state=RunState.LOST, strikes=3, attempt=3, reason="crash")


def after(run, *events):
    for event in events:
        run = advance(run, event, attempts=3).run
    return run


CANCELLED = after(RUNNING, Cancelled())
DONE = after(RUNNING, Completed(7, "aa"))
VARIED = after(VARYING, Completed(7, "aa"))
WAITING = after(RUNNING, Lapsed(7))
REPLACED = after(WAITING, Leased("v", 8))
AGAIN = after(DONE, Retried(), Leased("w", 9))
LAPSED_AGAIN = after(AGAIN, Lapsed(9))


@pytest.mark.parametrize(
    ("run", "event", "answer"),
    [
        (RUNNING, Leased("v", 8), LedgerAnswer.STALE),
        (RUNNING, Released(6, "of an older lease", blame=True), LedgerAnswer.STALE),
        (RUNNING, Lapsed(6), LedgerAnswer.STALE),
        (RUNNING, Retried(), LedgerAnswer.STALE),
        (RUNNING, Renewed("w", 7), LedgerAnswer.DONE),
        # Both go on until one has the result.
        (REPLACED, Renewed("w", 7), LedgerAnswer.DONE),
        (after(REPLACED, Completed(7, "aa")), Renewed("x", 8), LedgerAnswer.STALE),
        (after(REPLACED, Completed(8, "aa")), Renewed("x", 7), LedgerAnswer.STALE),
        (DONE, Completed(7, "aa"), LedgerAnswer.KNOWN),
        (VARIED, Completed(9, "bb"), LedgerAnswer.REDUNDANT),
        (DONE, Completed(9, "bb", comparable=False), LedgerAnswer.REDUNDANT),
        (CANCELLED, Renewed("w", 7), LedgerAnswer.STALE),
        (CANCELLED, Completed(7, "aa"), LedgerAnswer.DROPPED),
        (after(QUEUED, Cancelled()), Completed(7, "aa"), LedgerAnswer.DROPPED),
        # Executed before a retry, it is not what was asked for.
        (LAPSED_AGAIN, Renewed("w", 7), LedgerAnswer.STALE),
        (LAPSED_AGAIN, Completed(7, "aa"), LedgerAnswer.KNOWN),
        (AGAIN, Completed(7, "aa"), LedgerAnswer.KNOWN),
        (after(VARIED, Retried()), Completed(7, "aa"), LedgerAnswer.REDUNDANT),
        (after(DONE, Retried(stopped=True)), Completed(7, "aa"), LedgerAnswer.REDUNDANT),
        (after(VARIED, Retried(), Leased("v", 8)), Renewed("w", 7), LedgerAnswer.STALE),
    ],
)
def test_what_changes_nothing_has_an_answer(run, event, answer):
    change = advance(run, event, attempts=3)
    assert (change.answer, change.run, change.record) == (answer, run, False)


@pytest.mark.parametrize(
    "run", [RUNNING, WAITING, REPLACED, LOST, after(CANCELLED, Retried()), after(LOST, Retried())]
)
def test_the_first_result_is_recorded_from_whatever_lease(run):
    change = advance(run, Completed(2, "aa"), attempts=3)
    assert (change.answer, change.record) == (LedgerAnswer.RECORDED, True)
    assert (change.run.state, change.run.result) == (RunState.DONE, "aa")


@pytest.mark.parametrize(
    ("run", "changes"),
    [
        (after(RUNNING, Renewed("heir", 7)), {"worker": "heir"}),
        (after(WAITING, Renewed("heir", 7)), {"worker": "heir"}),  # nobody is to blame
        (
            after(REPLACED, Released(8, "crash", blame=True), Renewed("w", 7)),
            {"attempt": 2, "strikes": 1, "granted": 8},
        ),
    ],
)
def test_a_renewal_says_who_has_the_run_and_takes_it_back_where_it_waits(run, changes):
    assert run == replace(RUNNING, **changes)


def test_a_run_whose_workers_all_fall_silent_is_lost_in_the_end():
    run = QUEUED
    for token in range(1, MOST_LAPSES + 1):
        assert run.state is RunState.QUEUED
        died = Released(token, "its worker died", blame=False, died=True)
        end = died if token % 2 else Lapsed(token)
        run = after(run, Leased("w", token), Renewed("w", token), end)
    assert (run.state, run.strikes) == (RunState.LOST, 0)
    assert run.reason.startswith(f"{MOST_LAPSES} workers in a row died with it or fell silent")
    # Whoever is still at it may go on, and is not too late.
    assert advance(run, Renewed("w", 3), attempts=3).answer is LedgerAnswer.DONE
    assert after(run, Retried()).lapses == 0


@pytest.mark.parametrize(
    "events",
    [
        (Renewed("w", 7),),
        (Completed(7, "aa"),),
        (Leased("v", 8), Released(8, "full", blame=False)),
    ],
)
def test_lapses_count_in_a_row_only(events):
    assert after(WAITING, *events).lapses == 0


def test_another_result_is_an_alarm_until_the_run_is_retried():
    change = advance(DONE, Completed(9, "bb"), attempts=3)
    assert (change.answer, change.record) == (LedgerAnswer.DIFFERS, False)
    assert change.run.nondeterministic
    assert "another attempt gave bb" in change.run.reason
    assert replace(change.run, reason="", nondeterministic=False) == DONE
    assert after(change.run, Completed(10, "aa")) == change.run
    assert not after(change.run, Retried()).nondeterministic


@pytest.mark.parametrize(("blame", "state"), [(True, RunState.LOST), (False, RunState.QUEUED)])
def test_a_run_is_lost_after_three_bad_endings_and_by_none_without_blame(blame, state):
    run = QUEUED
    for token in range(3):
        assert run.state is RunState.QUEUED
        run = after(run, Leased("w", token), Released(token, "why", blame))
    assert (run.state, run.attempt, run.reason) == (state, 3, "why")


def test_a_retried_run_starts_with_a_clean_slate_and_its_attempts_counted():
    assert after(LOST, Retried()) == ExecutionState(attempt=3)
    # What is not repeatable gets a new result.
    assert (after(VARIED, Retried()).state, after(VARIED, Retried()).result) == ("queued", "")


@pytest.mark.parametrize(
    ("run", "event"),
    [
        (AGAIN, Cancelled()),
        (replace(AGAIN, strikes=2), Released(9, "crash", blame=True)),
        (replace(AGAIN, lapses=MOST_LAPSES - 1), Lapsed(9)),
    ],
)
def test_repeating_a_done_run_keeps_its_result_whatever_happens(run, event):
    assert (after(run, event).state, after(run, event).result) == (RunState.DONE, "aa")
