"""Invalid traces: what is wrong with them is an error, never a failure of the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import judge, overall_outcome, trace_problems
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome
from daemon.trace import CommandTrack, Trace
from tests.daemon.judging.oracles.traces import along, cut, make_trace, mission, still, times, track

FAILING = (OracleText("a", "max(speed) <= 0.1 m/s"), OracleText("b", "reached(mission, 0.1 m)"))


def driving(**fields: object) -> Trace:
    time = times(10.0)
    motion = along(time)
    return make_trace(motion, estimate=track(time, motion.x), goal=mission((9.0, 0.0)), **fields)


def assert_invalid(trace: Trace, reason: str) -> None:
    (problem,) = trace_problems(trace)
    assert reason in problem
    verdicts = judge(trace, FAILING)
    assert {v.outcome for v in verdicts} == {Outcome.ERROR}
    assert all(reason in v.evidence.note for v in verdicts)
    assert overall_outcome(trace, verdicts) is Outcome.ERROR


def test_a_sound_trace_may_fail() -> None:
    trace = driving()
    assert trace_problems(trace) == ()
    assert overall_outcome(trace, judge(trace, FAILING)) is Outcome.FAIL


@pytest.mark.parametrize("track_name", ["estimate", "command", "joints"])
def test_numbers_that_are_none_make_a_trace_invalid(track_name: str) -> None:
    trace = driving()
    recorded = getattr(trace, track_name)
    channel = {"estimate": "x", "command": "vx", "joints": "position"}[track_name]
    values = getattr(recorded, channel).copy()
    values[0] = np.nan
    broken = replace(trace, **{track_name: replace(recorded, **{channel: values})})
    assert_invalid(broken, "not finite")


def test_a_clock_that_runs_backwards() -> None:
    trace = driving()
    truth = trace.ground_truth
    back = np.where(truth.time > 3.0, truth.time - 1.0, truth.time)
    assert_invalid(replace(trace, ground_truth=replace(truth, time=back)), "backwards")


def test_a_leap_no_robot_can_make() -> None:
    trace = driving()
    truth = trace.ground_truth
    x = np.where(truth.time >= 3.0, truth.x + 4.0, truth.x)
    assert_invalid(replace(trace, ground_truth=replace(truth, x=x)), "leaps 4.03 m at 3.00 s")


@pytest.mark.parametrize(
    ("speed", "told"), [(0.0, "every command was zero"), (0.3, "commanded up to 0.30 m/s")]
)
def test_a_robot_that_never_moved_though_asked_to(speed: float, told: str) -> None:
    time = times(10.0)
    command = CommandTrack(
        time, np.full(len(time), speed), np.zeros(len(time)), np.zeros(len(time))
    )
    trace = make_trace(still(time), goal=mission((2.0, 0.0)), command=command)
    assert_invalid(trace, told)


def test_a_robot_that_may_stay_or_may_still_set_off_is_fine() -> None:
    time = times(10.0)
    assert trace_problems(make_trace(still(time), goal=mission((0.05, 0.0)))) == ()
    assert trace_problems(make_trace(still(time), goal=mission())) == ()
    assert trace_problems(cut(make_trace(still(time), goal=mission((2.0, 0.0))), 5.0)) == ()


def test_a_robot_that_only_turns_on_the_spot_fails() -> None:
    time = times(10.0)
    motion = replace(still(time), yaw=0.3 * time, wz=np.full(len(time), 0.3))
    trace = make_trace(motion, goal=mission((2.0, 0.0)))
    assert trace_problems(trace) == ()
    assert overall_outcome(trace, judge(trace, FAILING[1:])) is Outcome.FAIL
