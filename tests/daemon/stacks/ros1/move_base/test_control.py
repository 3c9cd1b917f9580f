"""The states, timers and patience of move_base, with everything around it faked."""

import numpy as np
import pytest

from grammars.model.geometry import Twist2
from tests.daemon.stacks.ros1.move_base.bench import FORWARD, Bench, without


def test_a_goal_is_planned_for_and_then_followed():
    bench = Bench()
    bench.accept()
    bench.run(1.0)
    assert bench.states == [(0.05, "controlling")]
    assert bench.commands[0] == (0.1, FORWARD)
    assert np.diff([time for time, _ in bench.commands]) == pytest.approx(0.1)


def test_plans_are_made_at_the_planner_s_frequency_from_start_to_start():
    bench = Bench()
    bench.accept()
    bench.run(2.0)
    assert np.diff(bench.planned) == pytest.approx(0.2)
    assert bench.controller.plans == len(bench.planned)


def test_planning_as_often_as_controlling_leaves_a_cycle_without_a_new_plan_now_and_then():
    bench = Bench(parameters={"controller_frequency": 20.0, "planner_frequency": 20.0})
    bench.accept()
    bench.run(60.0)
    cycles = len(bench.commands)
    assert cycles == pytest.approx(1199, abs=1)
    # A millisecond in fifty is lost to being woken: of fifty-one cycles one has the old plan.
    assert cycles - bench.controller.plans == pytest.approx(cycles / 51, abs=2)


def test_with_a_planner_frequency_of_zero_there_is_one_plan_per_request():
    bench = Bench(works=lambda now: now < 1.0 or now > 1.35, parameters={"planner_frequency": 0.0})
    bench.accept()
    bench.run(3.0)
    # The controller fails at 1.0 s and asks for a plan; it tries that one at 1.1 s, and so on.
    assert bench.planned == pytest.approx([0.05, 1.05, 1.15, 1.25, 1.35])


def test_the_robot_stops_when_it_arrives():
    bench = Bench()
    bench.accept()
    bench.run(1.0)
    bench.controller.arrived = True
    bench.run(2.0)
    assert bench.result == "succeeded"
    assert bench.commands[-1] == (pytest.approx(1.1), Twist2())
    planned = len(bench.planned)
    bench.result = None
    bench.run(3.0)
    assert len(bench.planned) == planned, "without a goal nothing is planned"


def test_without_a_plan_recoveries_begin_after_the_planner_s_patience():
    bench = Bench(plans=lambda now: False)
    bench.accept()
    bench.run(60.0)
    begun = [time for time, _ in bench.tried]
    # Every recovery restarts the patience; its end is noticed by the next plan and the next cycle.
    assert begun == pytest.approx([5.1, 10.2, 15.3, 20.4])
    assert bench.result == "aborted"
    assert bench.now == pytest.approx(25.5)
    assert bench.said("goal aborted: no valid plan, even after recoveries") == 1


def test_while_a_plan_is_waited_for_every_control_cycle_wakes_the_planner():
    bench = Bench(plans=lambda now: now > 2.0)
    bench.accept()
    bench.run(2.0)
    assert np.diff(bench.planned) == pytest.approx(0.1)


def test_a_number_of_retries_may_end_the_wait_before_patience_does():
    bench = Bench(plans=lambda now: False, parameters={"max_planning_retries": 3})
    bench.accept()
    bench.run(2.0)
    assert bench.tried[0][0] < 0.6


def test_controller_patience_ends_in_all_recoveries_at_once_and_an_abort():
    bench = Bench(works=lambda now: now < 3.0, parameters={"oscillation_timeout": 0.0})
    bench.accept()
    bench.run(60.0)
    assert [name for _, name in bench.tried] == ["r0", "r1", "r2", "r3"]
    first, last = bench.tried[0][0], bench.tried[-1][0]
    assert first == pytest.approx(2.9 + 15.0, abs=0.25)
    assert last - first < 1.3
    assert bench.result == "aborted"
    assert bench.now - first < 1.6
    assert bench.said("goal aborted: no valid velocity command, even after recoveries") == 1


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


def test_a_robot_that_does_not_get_on_goes_into_recoveries_after_ten_seconds():
    bench = Bench(speed=0.0)
    bench.accept()
    bench.run(60.0)
    assert bench.tried[0][0] == pytest.approx(10.2, abs=0.2)
    assert np.diff([time for time, _ in bench.tried]) == pytest.approx(10.2, abs=0.3)
    assert bench.said("goal aborted: it does not get on, even after recoveries") == 1


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


def test_a_recovery_that_takes_time_blocks_the_loop():
    bench = Bench(
        works=lambda now: now < 1.0,
        recoveries=(3.0,),
        parameters={"oscillation_timeout": 0.0, "controller_patience": 2.0},
    )
    bench.accept()
    bench.run(60.0)
    begun = bench.tried[0][0]
    assert bench.result == "aborted"
    assert 3.0 <= bench.now - begun < 3.5


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
