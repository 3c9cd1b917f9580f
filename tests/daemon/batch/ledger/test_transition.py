from dataclasses import replace

import pytest

from daemon.batch.ledger.transitions import (
    Cancelled,
    Completed,
    ExecutionState,
    Leased,
    Released,
    Renewed,
    Retried,
    RunEvent,
    advance,
)
from daemon.model.messages import LedgerAnswer
from daemon.model.status import RunState

QUEUED = ExecutionState()
RUNNING = advance(QUEUED, Leased("w", 7, 30.0), attempts=3).run


def after(run: ExecutionState, *events: RunEvent) -> ExecutionState:
    for event in events:
        run = advance(run, event, attempts=3).run
    return run


def test_a_lease_makes_a_queued_run_run() -> None:
    expected = ExecutionState(RunState.RUNNING, attempt=1, worker="w", token=7, lease_until=30.0)
    assert expected == RUNNING


def test_only_queued_runs_can_be_leased() -> None:
    change = advance(RUNNING, Leased("v", 8, 40.0), attempts=3)
    assert change.answer is LedgerAnswer.STALE
    assert change.run == RUNNING


def test_renewing_extends_but_never_shortens_a_lease() -> None:
    assert after(RUNNING, Renewed(7, 50.0)).lease_until == 50.0
    assert after(RUNNING, Renewed(7, 10.0)).lease_until == 30.0


def test_a_foreign_token_renews_and_releases_nothing() -> None:
    for event in (Renewed(6, 50.0), Released(6, "x", blame=True)):
        change = advance(RUNNING, event, attempts=3)
        assert change.answer is LedgerAnswer.STALE
        assert change.run == RUNNING


def test_the_first_result_is_recorded_the_second_is_known() -> None:
    first = advance(RUNNING, Completed(7, "aa"), attempts=3)
    assert first.record
    assert first.answer is LedgerAnswer.RECORDED
    assert first.run.state is RunState.DONE
    second = advance(first.run, Completed(7, "aa"), attempts=3)
    assert not second.record
    assert second.answer is LedgerAnswer.KNOWN
    assert second.run == first.run


def test_another_result_is_an_alarm_and_changes_nothing_but_the_reason() -> None:
    done = after(RUNNING, Completed(7, "aa"))
    change = advance(done, Completed(9, "bb"), attempts=3)
    assert change.answer is LedgerAnswer.DIFFERS
    assert not change.record
    assert "nondeterministic" in change.run.reason
    assert replace(change.run, reason="") == done


def test_another_result_of_what_is_not_repeatable_is_not_needed() -> None:
    done = after(replace(RUNNING, repeatable=False), Completed(7, "aa"))
    change = advance(done, Completed(9, "bb"), attempts=3)
    assert (change.answer, change.record, change.run) == (LedgerAnswer.REDUNDANT, False, done)


def test_retried_what_is_not_repeatable_gets_a_new_result() -> None:
    done = after(replace(RUNNING, repeatable=False), Completed(7, "aa"))
    retried = after(done, Retried())
    assert (retried.state, retried.result) == (RunState.QUEUED, "")
    assert after(after(RUNNING, Completed(7, "aa")), Retried()).result == "aa"


def test_a_late_result_is_taken_from_a_lease_that_lapsed() -> None:
    again = after(RUNNING, Released(7, "lapsed", blame=True), Leased("v", 8, 60.0))
    change = advance(again, Completed(7, "aa"), attempts=3)
    assert change.answer is LedgerAnswer.RECORDED
    assert change.run.state is RunState.DONE
    assert advance(change.run, Renewed(8, 90.0), attempts=3).answer is LedgerAnswer.STALE


def test_a_run_is_lost_after_three_bad_endings() -> None:
    run = QUEUED
    for token in range(3):
        assert run.state is RunState.QUEUED
        run = after(run, Leased("w", token, 1.0), Released(token, "crash", blame=True))
    assert run.state is RunState.LOST
    assert run.attempt == 3
    assert run.reason == "crash"


def test_giving_back_without_blame_never_loses_a_run() -> None:
    run = QUEUED
    for token in range(10):
        run = after(run, Leased("w", token, 1.0), Released(token, "leaving", blame=False))
    assert run.state is RunState.QUEUED
    assert run.attempt == 10


def test_a_late_result_revives_a_lost_run() -> None:
    lost = replace(QUEUED, state=RunState.LOST, strikes=3)
    assert after(lost, Completed(2, "aa")).state is RunState.DONE


@pytest.mark.parametrize("run", [QUEUED, RUNNING])
def test_cancelled_runs_take_no_result(run: ExecutionState) -> None:
    cancelled = after(run, Cancelled())
    assert cancelled.state is RunState.CANCELLED
    change = advance(cancelled, Completed(7, "aa"), attempts=3)
    assert change.answer is LedgerAnswer.DROPPED
    assert not change.record


def test_a_retried_run_starts_with_a_clean_slate_and_its_attempts_counted() -> None:
    lost = replace(QUEUED, state=RunState.LOST, strikes=3, attempt=3, reason="crash")
    again = after(lost, Retried())
    assert again == ExecutionState(attempt=3)


def test_repeating_a_done_run_keeps_its_result_whatever_happens() -> None:
    done = after(RUNNING, Completed(7, "aa"))
    again = after(done, Retried(), Leased("w", 9, 1.0))
    assert again.state is RunState.RUNNING
    assert after(again, Cancelled()).state is RunState.DONE
    assert after(again, Completed(9, "aa")).state is RunState.DONE
    assert after(again, Completed(9, "bb")).result == "aa"
    assert after(again, Completed(7, "aa")).state is RunState.RUNNING  # not this repetition's


def test_what_is_under_way_is_not_retried() -> None:
    assert advance(RUNNING, Retried(), attempts=3).answer is LedgerAnswer.STALE
