"""Invalid traces: what is wrong with them is an error, never a failure of the robot."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import judge, overall_outcome, trace_problems
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome
from daemon.trace import CommandTrack, ContactRecord, ProgressRecord
from tests.engine.judging.traces import (
    ROBOT,
    along,
    cut,
    make_trace,
    mission,
    still,
    times,
    track,
)

FAILING = (OracleText("a", "max(speed) <= 0.1 m/s"), OracleText("b", "reached(mission, 0.1 m)"))


def driving(**fields):
    time = times(10.0)
    motion = along(time)
    return make_trace(motion, estimate=track(time, motion.x), goal=mission((9.0, 0.0)), **fields)


def assert_invalid(trace, reason):
    (problem,) = trace_problems(trace)
    assert reason in problem
    verdicts = judge(trace, FAILING)
    assert {v.outcome for v in verdicts} == {Outcome.ERROR}
    assert all(reason in v.evidence.note for v in verdicts)
    assert overall_outcome(trace, verdicts) is Outcome.ERROR


def test_a_sound_trace_may_fail():
    trace = driving()
    assert trace_problems(trace) == ()
    assert overall_outcome(trace, judge(trace, FAILING)) is Outcome.FAIL


def test_a_recording_its_reader_doubts_is_invalid():
    assert_invalid(replace(driving(), problems=("the clock jumped at 3.20 s",)), "clock jumped")


def test_a_leap_no_robot_can_make():
    trace = driving()
    truth = trace.ground_truth
    x = np.where(truth.time >= 3.0, truth.x + 4.0, truth.x)
    assert_invalid(replace(trace, ground_truth=replace(truth, x=x)), "leaps 4.03 m at 3.00 s")


def standing(vx=0.0, wz=0.0, vy=0.0, **fields):
    """A robot that stays where it is, whatever it is told, and should be 2 m further."""
    time = times(10.0)
    given = CommandTrack(time, *(np.full(len(time), value) for value in (vx, vy, wz)))
    return make_trace(still(time), **{"goal": mission((2.0, 0.0)), "command": given} | fields)


def assert_fails(trace, reason):
    """The run is judged, the mission has failed, and it is said what the robot was told."""
    assert trace_problems(trace) == ()
    (found,) = judge(trace, FAILING[1:])
    assert (found.outcome, found.margin) == (Outcome.FAIL, pytest.approx(-1.9))
    assert f"the robot never moved: {reason}" in found.evidence.note
    assert overall_outcome(trace, (found,)) is Outcome.FAIL


@pytest.mark.parametrize("told", [{"vx": 0.3}, {"vx": -0.3}, {"vy": 0.3}, {"wz": 0.3}])
def test_a_world_that_did_not_move_makes_a_trace_invalid(told):
    speed, turning = max(map(abs, (told.get("vx", 0.0), told.get("vy", 0.0)))), told.get("wz", 0.0)
    said = f"though it was commanded up to {speed:.2f} m/s and {turning:.2f} rad/s"
    assert_invalid(standing(**told), said)


def test_a_robot_that_was_never_told_to_move_fails():
    assert_fails(standing(), "every command was zero")
    none = np.empty(0)
    assert_fails(standing(command=CommandTrack(none, none, none, none)), "no command was given")


@pytest.mark.parametrize(
    ("state", "said"), [("aborted", "was given up"), ("succeeded", "was called done")]
)
def test_a_stack_that_ends_its_mission_before_it_sets_off_fails(state, said):
    progress = (ProgressRecord(0.0, 0, 0, "active"), ProgressRecord(0.1, 0, 0, state))
    told = f"every command was zero, the mission {said} at 0.10 s"
    assert_fails(standing(progress=progress), told)


def test_a_robot_that_cannot_do_what_it_is_told_fails():
    held = ContactRecord(0.0, "robot", "wall-north", (0.0, 1.0), (0.0, 1.0), 0.01)
    assert_fails(standing(0.3, contacts=(held,)), "it was commanded up to 0.30 m/s")
    sideways = replace(ROBOT, drive=replace(ROBOT.drive, kind="differential"))
    assert_fails(standing(vy=0.3, robot=sideways), "it was commanded up to 0.30 m/s")
    stiff = replace(ROBOT, drive=replace(ROBOT.drive, friction_loss=0.4))
    assert_fails(standing(0.3, robot=stiff), "it was commanded up to 0.30 m/s")


def test_commands_too_short_to_be_followed_are_no_fault_of_the_world():
    time = times(10.0)
    there_and_back = np.where(np.arange(len(time)) % 2, 0.3, -0.3)
    zero = np.zeros(len(time))
    given = CommandTrack(time, there_and_back, zero, zero)
    assert_fails(standing(command=given), "it was commanded up to 0.30 m/s")
    last = CommandTrack(time[-1:], there_and_back[:1], zero[:1], zero[:1])
    assert_fails(standing(command=last), "it was commanded up to 0.30 m/s")


def test_a_robot_that_may_stay_or_may_still_set_off_is_fine():
    time = times(10.0)
    assert trace_problems(make_trace(still(time), goal=mission((0.05, 0.0)))) == ()
    assert trace_problems(make_trace(still(time), goal=mission())) == ()
    assert trace_problems(cut(make_trace(still(time), goal=mission((2.0, 0.0))), 5.0)) == ()


def test_a_robot_that_only_turns_on_the_spot_fails():
    time = times(10.0)
    motion = replace(still(time), yaw=0.3 * time, wz=np.full(len(time), 0.3))
    trace = make_trace(motion, goal=mission((2.0, 0.0)))
    assert trace_problems(trace) == ()
    assert overall_outcome(trace, judge(trace, FAILING[1:])) is Outcome.FAIL
