"""Patience, recoveries and quirks of move_base in long runs; ``test_instants`` has each instant."""

import numpy as np
import pytest

from daemon.stacks.ros1.move_base import DispatcherParameters
from daemon.stacks.ros1.move_base.dispatcher import WaypointDispatcher
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2, Twist2
from grammars.model.mission import Waypoint
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


@pytest.mark.parametrize(
    ("quirks", "state", "command"),
    [(FAST, "controlling", FORWARD), (without("failed_replanning_ignored"), "planning", Twist2())],
)
def test_a_failed_replanning_is_ignored_while_the_controller_works(quirks, state, command):
    bench = Bench(plans=lambda now: now < 1.0, quirks=quirks)
    bench.accept()
    bench.run(3.0)
    assert bench.states[-1][1] == state
    assert bench.commands[-1][1] == command
    assert bench.tried == []


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


WAYPOINTS = (Waypoint("a", 1.0, 0.0, 0.5), Waypoint("b", 2.0, 0.0), Waypoint("c", 3.0, 0.0))
HERE = Pose2(0.1, 0.2, 0.3)


def make(**given):
    asked = []
    parameters = DispatcherParameters(**given)
    return WaypointDispatcher(parameters, WAYPOINTS, lambda a, b: asked.append((a, b))), asked


def test_it_sends_the_first_goal_at_once_and_waits_for_its_result():
    dispatcher, asked = make()
    assert dispatcher.step(0.0, None, HERE) == Pose2(1.0, 0.0, 0.5)
    assert dispatcher.step(0.05, None, HERE) is None
    assert asked == [(HERE, Pose2(1.0, 0.0, 0.5))], "a plan from where amcl last saw the robot"


def test_a_waypoint_without_a_heading_gets_the_one_missions_of_the_original_have():
    dispatcher, _ = make()
    dispatcher.step(0.0, None, HERE)
    assert dispatcher.step(20.0, "succeeded", HERE) == Pose2(2.0, 0.0, 0.0)
    dispatcher, _ = make(default_yaw=1.0)
    dispatcher.step(0.0, None, HERE)
    assert dispatcher.step(20.0, "succeeded", HERE) == Pose2(2.0, 0.0, 1.0)


def test_after_a_long_goal_the_next_is_sent_at_once_and_after_a_short_one_later():
    dispatcher, _ = make()
    dispatcher.step(0.0, None, HERE)
    assert dispatcher.step(20.0, "succeeded", HERE) is not None
    assert dispatcher.step(20.3, "succeeded", HERE) is None
    assert dispatcher.step(20.95, None, HERE) is None
    assert dispatcher.step(21.0, None, HERE) is not None


def test_the_mission_succeeds_with_the_last_waypoint():
    dispatcher, _ = make()
    for time in (0.0, 10.0, 20.0):
        assert dispatcher.step(time, "succeeded" if time else None, HERE) is not None
    assert dispatcher.step(30.0, "succeeded", HERE) is None
    progress = dispatcher.progress
    assert (progress.current, progress.reached, progress.state) == (2, 3, "succeeded")


def test_an_aborted_goal_ends_the_mission():
    dispatcher, asked = make()
    dispatcher.step(0.0, None, HERE)
    dispatcher.step(10.0, "succeeded", HERE)
    assert dispatcher.step(20.0, "aborted", HERE) is None
    assert dispatcher.step(30.0, None, HERE) is None
    progress = dispatcher.progress
    assert (progress.current, progress.reached, progress.state) == (1, 1, "aborted")
    assert len(asked) == 2
