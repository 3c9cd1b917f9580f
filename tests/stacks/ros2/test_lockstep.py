"""How long cycles wait, which answers are late, when a stack is given up."""

import pytest

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.lockstep import HeardAnswer, LockStep
from daemon.stacks.ros2.settings import read_settings

ANSWERED = HeardAnswer(0.002, 0.0, 1, alive=True)
UNSTAMPED = HeardAnswer(0.002, None, 1, alive=True)
NOTHING = HeardAnswer(None, None, 0, alive=False)
ONLY_FEEDBACK = HeardAnswer(None, None, 0, alive=True)


def lock_step(*, late=0.05, real_time=False, tolerance=0.0):
    keys = {"launch": "nav", "late": late, "tolerance": f"{tolerance} s"}
    return LockStep(read_settings(keys), real_time=real_time)


def repeat(steps, *answers):
    for _ in range(1000):
        for answer in answers:
            steps.take(answer, active=True)


def test_a_cycle_without_a_goal_or_before_the_first_command_waits_shortly():
    steps = lock_step()
    assert steps.wait(active=False) == 0.02
    assert steps.wait(active=True) == 0.02
    steps.take(ANSWERED, active=True)
    assert steps.wait(active=True) == 1.0
    assert steps.wait(active=False) == 0.02, "the goal is over"
    assert steps.wait(active=True) == 0.02, "the next goal begins freely again"


def test_a_stack_on_the_wall_clock_is_never_driven_faster_than_real_time():
    steps = lock_step(real_time=True)
    assert steps.wait(active=False) == 0.05
    steps.take(ANSWERED, active=True)
    assert steps.wait(active=True) == 1.0, "an answer may still come at once"


def test_latency_is_told_for_answers_that_were_due_only():
    steps = lock_step()
    assert steps.take(ANSWERED, active=False) == (None, [])
    assert steps.take(ANSWERED, active=True)[0] == 0.002


def test_a_missed_answer_is_late_once_while_the_stack_is_alive():
    steps = lock_step()
    steps.take(ANSWERED, active=True)
    latency, said = steps.take(ONLY_FEEDBACK, active=True)
    assert latency == 1.0
    assert "no command within 1 s" in said[0].text
    assert steps.wait(active=True) == 0.05, "it goes on at the pace of real time"
    for _ in range(200):
        assert steps.take(ONLY_FEEDBACK, active=True) == (None, [])
    assert (steps.late, steps.expected) == (1, 2)
    steps.take(ANSWERED, active=True)
    assert steps.wait(active=True) == 1.0


def test_a_stack_that_says_nothing_at_all_is_given_up_after_ten_seconds():
    steps = lock_step(late=0.99)
    steps.take(ANSWERED, active=True)
    with pytest.raises(SutFailure, match="said nothing for 10 s"):
        repeat(steps, NOTHING)


def test_silence_before_the_first_command_counts_too():
    steps = lock_step()
    with pytest.raises(SutFailure, match="it hangs"):
        repeat(steps, NOTHING)


def test_too_large_a_share_of_late_cycles_ends_the_run_and_says_the_numbers():
    steps = lock_step()
    with pytest.raises(SutFailure, match=r"could not keep up: 6 of 12 cycles \(50 %\)"):
        repeat(steps, ANSWERED, ONLY_FEEDBACK)


def test_pauses_between_waypoints_do_not_make_a_short_run_an_error():
    steps = lock_step()
    for _ in range(5):
        steps.take(ANSWERED, active=True)
        for _ in range(100):
            steps.take(ONLY_FEEDBACK, active=True)
    assert (steps.late, steps.expected) == (5, 10)
    steps.check_share()


def test_a_steady_lag_of_stamps_is_taken_for_what_it_is():
    steps = lock_step()
    lagging = HeardAnswer(None, 0.05, 1, alive=True)
    steps.take(lagging, active=True)
    for _ in range(2):
        assert steps.wait(active=True) == 1.0
        assert "holds" in steps.take(lagging, active=True)[1][0].text
        steps.take(lagging, active=True)
    _, said = steps.take(lagging, active=True)
    assert "0.050 s before the clock" in said[0].text
    assert steps.tolerance == 0.05
    assert steps.wait(active=True) == 1.0


def test_a_stack_that_lags_is_waited_for_before_its_first_answer_too():
    steps = lock_step(real_time=True)
    assert steps.wait(active=True) == 0.05
    steps.take(HeardAnswer(None, 0.4, 1, alive=True), active=True)
    assert steps.wait(active=True) == 1.0


def test_commands_far_behind_are_no_answers():
    steps = lock_step()
    steps.take(ANSWERED, active=True)
    steps.take(HeardAnswer(None, 3.0, 1, alive=True), active=True)
    assert steps.tolerance == 0.0
    assert steps.late == 1


def test_that_commands_without_stamp_are_a_guess_is_said_once():
    steps = lock_step()
    _, said = steps.take(UNSTAMPED, active=True)
    assert "no stamp" in said[0].text
    assert steps.take(UNSTAMPED, active=True)[1] == []
