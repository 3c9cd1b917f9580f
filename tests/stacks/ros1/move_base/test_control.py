"""Patience, recoveries and quirks of move_base in long runs; ``test_instants`` has each instant."""

import numpy as np
import pytest

from grammars.model.geometry import Twist2
from tests.stacks.ros1.move_base.bench import FORWARD, Bench, without


def test_planning_as_often_as_controlling_leaves_a_cycle_without_a_new_plan_now_and_then():
    bench = Bench(parameters={"controller_frequency": 20.0, "planner_frequency": 20.0})
    bench.accept()
    bench.run(60.0)
    cycles = len(bench.commands)
    assert cycles == pytest.approx(1199, abs=1)
    # A millisecond in fifty is lost to being woken: of fifty-one cycles one has the old plan.
    assert cycles - bench.controller.plans == pytest.approx(cycles / 51, abs=2)


def test_controller_patience_starts_anew_after_a_recovery_without_the_quirk():
    bench = Bench(
        works=lambda now: now < 3.0,
        quirks=without("control_patience_survives_recovery"),
        parameters={"oscillation_timeout": 0.0},
    )
    bench.accept()
    bench.run(120.0)
    assert np.diff([time for time, _ in bench.tried]) == pytest.approx(15.2, abs=0.3)


def test_a_controller_that_fails_for_a_while_goes_back_to_planning_and_stops():
    bench = Bench(works=lambda now: not 2.0 <= now < 4.0)
    bench.accept()
    bench.run(6.0)
    held = [command for time, command in bench.commands if 2.0 < time < 4.0]
    assert set(held) == {Twist2()}
    assert bench.tried == []
    assert bench.said("no valid velocity command, planning again") == 1
    assert bench.said("velocity commands again after 2.") == 1


def test_a_robot_that_gets_on_again_has_all_its_recoveries_again():
    bench = Bench(speed=0.0)
    bench.accept()
    bench.run(23.0)
    bench.speed = 0.2
    bench.run(30.0)
    bench.speed = 0.0
    bench.run(42.0)
    assert [name for _, name in bench.tried] == ["r0", "r1", "r0"]


def test_a_failed_replanning_is_ignored_while_the_controller_works():
    bench = Bench(plans=lambda now: now < 1.0)
    bench.accept()
    bench.run(20.0)
    assert bench.states == [(0.05, "controlling")]
    assert bench.commands[-1][1] == FORWARD
    assert bench.tried == []


def test_without_the_quirk_a_failed_replanning_stops_the_robot():
    bench = Bench(plans=lambda now: now < 1.0, quirks=without("failed_replanning_ignored"))
    bench.accept()
    bench.run(3.0)
    assert bench.states[-1][1] == "planning"
    assert bench.commands[-1][1] == Twist2()


def test_disabled_recoveries_abort_at_once():
    bench = Bench(plans=lambda now: False, recoveries=())
    bench.accept()
    bench.run(60.0)
    assert bench.now < 5.3
    assert bench.said("goal aborted: no valid plan") == 1


def test_patience_begins_anew_with_a_new_goal():
    bench = Bench(plans=lambda now: not now < 10.0, recoveries=())
    bench.accept()
    bench.run(60.0)
    assert bench.result == "aborted"
    bench.result = None
    bench.now = 9.0
    bench.accept()
    bench.run(12.0)
    assert bench.result is None
    assert bench.status.state == "controlling"
