"""How long cycles wait, which answers are late, when a stack is given up."""

from functools import partial

import pytest

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.lockstep import HeardAnswer, LockStep
from daemon.stacks.ros2.settings import read_settings

ANSWERED = HeardAnswer(0.002, 0.0, 1, alive=True)
UNSTAMPED = HeardAnswer(0.002, None, 1, alive=True)
NOTHING = HeardAnswer(None, None, 0, alive=False)
FEEDBACK = HeardAnswer(None, None, 0, alive=True)
LAGGING = HeardAnswer(None, 0.05, 1, alive=True)


def lock_step(*answers, late=0.05, real_time=False):
    """Return the lock step after answers to cycles with an active goal."""
    steps = LockStep(read_settings({"launch": "nav", "late": late}), real_time=real_time)
    for answer in answers:
        steps.take(answer, active=True)
    return steps


@pytest.mark.parametrize(
    ("answers", "real_time", "with_goal", "without"),
    [
        ((), False, 0.02, 0.02),
        ((ANSWERED,), False, 1.0, 0.02),
        # A stack on the wall clock is never driven faster than real time, but may answer at once.
        ((), True, 0.05, 0.05),
        ((ANSWERED,), True, 1.0, 0.05),
        # After a missed answer it goes on at the pace of real time, until the next one.
        ((ANSWERED, FEEDBACK), False, 0.05, 0.02),
        ((ANSWERED, FEEDBACK, ANSWERED), False, 1.0, 0.02),
        # One that lags is waited for before its first answer too.
        ((HeardAnswer(None, 0.4, 1, alive=True),), True, 1.0, 0.05),
    ],
)
def test_cycles_wait_as_long_as_an_answer_is_due(answers, real_time, with_goal, without):
    assert lock_step(*answers, real_time=real_time).wait(active=True) == with_goal
    steps = lock_step(*answers, real_time=real_time)
    assert steps.wait(active=False) == without
    # The next goal begins freely again.
    assert steps.wait(active=True) == without


def test_latency_is_told_for_answers_that_were_due_only():
    steps = lock_step()
    assert steps.take(ANSWERED, active=False) == (None, [])
    assert steps.take(ANSWERED, active=True)[0] == 0.002


def test_a_missed_answer_is_late_once_while_the_stack_is_alive():
    steps = lock_step(ANSWERED)
    latency, said = steps.take(FEEDBACK, active=True)
    assert latency == 1.0
    assert "no command within 1 s" in said[0].text
    for _ in range(200):
        assert steps.take(FEEDBACK, active=True) == (None, [])
    assert (steps.late, steps.expected) == (1, 2)


@pytest.mark.parametrize(
    ("first", "late", "answers", "words"),
    [
        ((ANSWERED,), 0.99, (NOTHING,), "said nothing for 10 s"),
        ((), 0.05, (NOTHING,), "it hangs"),
        ((), 0.05, (ANSWERED, FEEDBACK), r"could not keep up: 6 of 12 cycles \(50 %\)"),
    ],
)
def test_a_stack_that_is_silent_or_too_often_late_is_given_up(first, late, answers, words):
    steps = lock_step(*first, late=late)
    with pytest.raises(SutFailure, match=words):
        list(map(partial(steps.take, active=True), 1000 * answers))


def test_pauses_between_waypoints_do_not_make_a_short_run_an_error():
    steps = lock_step(*5 * (ANSWERED, *100 * (FEEDBACK,)))
    assert (steps.late, steps.expected) == (5, 10)
    steps.check_share()


def test_a_steady_lag_of_stamps_is_taken_for_what_it_is():
    steps = lock_step(LAGGING)
    for _ in range(2):
        assert steps.wait(active=True) == 1.0
        assert "holds" in steps.take(LAGGING, active=True)[1][0].text
        steps.take(LAGGING, active=True)
    _, said = steps.take(LAGGING, active=True)
    assert "0.050 s before the clock" in said[0].text
    assert steps.tolerance == 0.05
    assert steps.wait(active=True) == 1.0


def test_commands_far_behind_are_no_answers():
    steps = lock_step(ANSWERED, HeardAnswer(None, 3.0, 1, alive=True))
    assert (steps.tolerance, steps.late) == (0.0, 1)


def test_that_commands_without_stamp_are_a_guess_is_said_once():
    steps = lock_step()
    assert "no stamp" in steps.take(UNSTAMPED, active=True)[1][0].text
    assert steps.take(UNSTAMPED, active=True)[1] == []
