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
from daemon.model.run_state import RunState

QUEUED = ExecutionState()
RUNNING = advance(QUEUED, Leased("w", 7), attempts=3).run


def after(run, *events):
    for event in events:
        run = advance(run, event, attempts=3).run
    return run


def test_a_lease_makes_a_queued_run_run():
    expected = ExecutionState(RunState.RUNNING, attempt=1, worker="w", token=7, granted=7)
    assert expected == RUNNING


def test_only_queued_runs_can_be_leased():
    change = advance(RUNNING, Leased("v", 8), attempts=3)
    assert change.answer is LedgerAnswer.STALE
    assert change.run == RUNNING


def test_a_renewal_says_who_has_the_lease_now():
    assert after(RUNNING, Renewed("w", 7)) == RUNNING
    assert after(RUNNING, Renewed("heir", 7)) == replace(RUNNING, worker="heir")


@pytest.mark.parametrize("event", [Released(6, "x", blame=True), Lapsed(6)])
def test_an_older_lease_that_ends_ends_nothing(event):
    change = advance(RUNNING, event, attempts=3)
    assert (change.answer, change.run) == (LedgerAnswer.STALE, RUNNING)


def test_a_lapse_is_nobodys_fault_and_a_renewal_takes_the_run_back():
    waiting = after(RUNNING, Lapsed(7))
    assert (waiting.state, waiting.strikes, waiting.lapses) == (RunState.QUEUED, 0, 1)
    back = advance(waiting, Renewed("adopter", 7), attempts=3)
    assert back.answer is LedgerAnswer.DONE
    assert back.run == replace(RUNNING, worker="adopter")


def test_two_that_are_at_a_run_both_go_on_until_one_has_the_result():
    replaced = after(RUNNING, Lapsed(7), Leased("v", 8))
    change = advance(replaced, Renewed("w", 7), attempts=3)
    assert (change.answer, change.run) == (LedgerAnswer.DONE, replaced)
    for first, other in ((7, 8), (8, 7)):
        done = after(replaced, Completed(first, "aa"))
        assert done.state is RunState.DONE
        change = advance(done, Renewed("x", other), attempts=3)
        assert (change.answer, change.run) == (LedgerAnswer.STALE, done)
    left = after(replaced, Released(8, "crash", blame=True))
    assert after(left, Renewed("w", 7)).token == 7


def test_a_run_whose_workers_all_fall_silent_is_lost_in_the_end():
    run = QUEUED
    for token in range(1, MOST_LAPSES + 1):
        assert run.state is RunState.QUEUED
        run = after(run, Leased("w", token), Renewed("w", token), Lapsed(token))
    assert (run.state, run.strikes) == (RunState.LOST, 0)
    assert run.reason.startswith(f"{MOST_LAPSES} workers in a row died with it or fell silent")
    # Whoever is still at it may go on, and is not too late.
    assert advance(run, Renewed("w", 3), attempts=3).answer is LedgerAnswer.DONE
    assert after(run, Completed(3, "aa")).state is RunState.DONE
    assert after(run, Retried()).lapses == 0


@pytest.mark.parametrize("heard", [Renewed("w", 7), Released(8, "full", blame=False)])
def test_lapses_count_in_a_row_only(heard):
    waiting = after(RUNNING, Lapsed(7))
    events = (heard,) if isinstance(heard, Renewed) else (Leased("v", 8), heard)
    assert after(waiting, *events).lapses == 0


def test_the_first_result_is_recorded_the_second_is_known():
    first = advance(RUNNING, Completed(7, "aa"), attempts=3)
    assert first.record
    assert first.answer is LedgerAnswer.RECORDED
    assert first.run.state is RunState.DONE
    second = advance(first.run, Completed(7, "aa"), attempts=3)
    assert not second.record
    assert second.answer is LedgerAnswer.KNOWN
    assert second.run == first.run


def test_another_result_is_an_alarm_and_changes_nothing_else():
    done = after(RUNNING, Completed(7, "aa"))
    change = advance(done, Completed(9, "bb"), attempts=3)
    assert change.answer is LedgerAnswer.DIFFERS
    assert not change.record
    assert change.run.nondeterministic
    assert "another attempt gave bb" in change.run.reason
    assert replace(change.run, reason="", nondeterministic=False) == done


def test_an_alarm_lasts_until_the_run_is_retried():
    done = after(RUNNING, Completed(7, "aa"))
    differing = after(done, Completed(9, "bb"))
    assert after(differing, Completed(10, "aa")) == differing
    assert not after(differing, Retried()).nondeterministic


def test_another_result_of_what_is_not_repeatable_is_not_needed():
    done = after(replace(RUNNING, repeatable=False), Completed(7, "aa"))
    change = advance(done, Completed(9, "bb"), attempts=3)
    assert (change.answer, change.record, change.run) == (LedgerAnswer.REDUNDANT, False, done)


def test_retried_what_is_not_repeatable_gets_a_new_result():
    done = after(replace(RUNNING, repeatable=False), Completed(7, "aa"))
    retried = after(done, Retried())
    assert (retried.state, retried.result) == (RunState.QUEUED, "")
    assert after(after(RUNNING, Completed(7, "aa")), Retried()).result == "aa"


def test_a_late_result_is_taken_from_a_lease_that_lapsed():
    again = after(RUNNING, Lapsed(7), Leased("v", 8))
    change = advance(again, Completed(7, "aa"), attempts=3)
    assert change.answer is LedgerAnswer.RECORDED
    assert change.run.state is RunState.DONE
    assert advance(change.run, Renewed("v", 8), attempts=3).answer is LedgerAnswer.STALE


def test_a_run_is_lost_after_three_bad_endings():
    run = QUEUED
    for token in range(3):
        assert run.state is RunState.QUEUED
        run = after(run, Leased("w", token), Released(token, "crash", blame=True))
    assert run.state is RunState.LOST
    assert run.attempt == 3
    assert run.reason == "crash"


def test_giving_back_without_blame_never_loses_a_run():
    run = QUEUED
    for token in range(10):
        run = after(run, Leased("w", token), Released(token, "leaving", blame=False))
    assert run.state is RunState.QUEUED
    assert run.attempt == 10


def test_a_late_result_revives_a_lost_run():
    lost = replace(QUEUED, state=RunState.LOST, strikes=3)
    assert after(lost, Completed(2, "aa")).state is RunState.DONE


@pytest.mark.parametrize("run", [QUEUED, RUNNING])
def test_cancelled_runs_take_no_result(run):
    cancelled = after(run, Cancelled())
    assert cancelled.state is RunState.CANCELLED
    change = advance(cancelled, Completed(7, "aa"), attempts=3)
    assert change.answer is LedgerAnswer.DROPPED
    assert not change.record


def test_a_retried_run_starts_with_a_clean_slate_and_its_attempts_counted():
    lost = replace(QUEUED, state=RunState.LOST, strikes=3, attempt=3, reason="crash")
    again = after(lost, Retried())
    assert again == ExecutionState(attempt=3)


def test_repeating_a_done_run_keeps_its_result_whatever_happens():
    done = after(RUNNING, Completed(7, "aa"))
    again = after(done, Retried(), Leased("w", 9))
    assert again.state is RunState.RUNNING
    assert after(again, Cancelled()).state is RunState.DONE
    assert after(again, Completed(9, "aa")).state is RunState.DONE
    assert after(again, Completed(9, "bb")).result == "aa"
    assert after(again, Completed(7, "aa")).state is RunState.RUNNING  # not this repetition's
    lapsed = after(again, Lapsed(9))
    assert after(lapsed, Completed(9, "aa")).state is RunState.DONE
    assert after(lapsed, Completed(7, "aa")).state is RunState.QUEUED
    assert advance(lapsed, Renewed("w", 7), attempts=3).answer is LedgerAnswer.STALE


@pytest.mark.parametrize(
    ("repeatable", "stopped", "answer"),
    [
        (False, False, LedgerAnswer.REDUNDANT),
        (True, True, LedgerAnswer.REDUNDANT),
        (True, False, LedgerAnswer.KNOWN),
    ],
)
def test_what_was_executed_before_a_retry_is_not_what_was_asked_for(repeatable, stopped, answer):
    first = after(replace(RUNNING, repeatable=repeatable), Completed(7, "aa"))
    for again in (
        after(first, Retried(stopped)),
        after(first, Retried(stopped), Leased("v", 8)),
    ):
        change = advance(again, Completed(7, "aa"), attempts=3)
        assert (change.answer, change.record, change.run) == (answer, False, again)
        assert advance(again, Renewed("w", 7), attempts=3).answer is LedgerAnswer.STALE


@pytest.mark.parametrize("repeatable", [True, False])
def test_a_late_result_of_a_lost_or_cancelled_run_is_as_good_after_a_retry(repeatable):
    run = replace(RUNNING, repeatable=repeatable)
    for ended in (after(run, Cancelled()), replace(run, state=RunState.LOST, token=0)):
        again = after(ended, Retried())
        assert after(again, Completed(7, "aa")).result == "aa"
        assert after(again, Renewed("w", 7)).state is RunState.RUNNING


def test_what_is_under_way_is_not_retried():
    assert advance(RUNNING, Retried(), attempts=3).answer is LedgerAnswer.STALE
