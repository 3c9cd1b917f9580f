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
GOALS = (Pose2(1.0, 0.0, 0.5), Pose2(2.0, 0.0, 0.0), Pose2(3.0, 0.0, 0.0))
HERE = Pose2(0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("steps", "progress"),
    [
        # A goal at once, the next one with its result, but not within a second of the one before.
        ([(0.0, "", 0), (0.05, "", None), (20.0, "succeeded", 1), (20.3, "succeeded", None),
          (20.95, "", None), (21.0, "", 2), (30.0, "succeeded", None)], (2, 3, "succeeded")),
        ([(0.0, "", 0), (10.0, "succeeded", 1), (20.0, "aborted", None), (30.0, "", None)],
         (1, 1, "aborted")),
    ],
)  # fmt: skip
def test_goals_are_sent_one_after_the_other(steps, progress):
    asked = []
    parameters = DispatcherParameters()
    dispatcher = WaypointDispatcher(parameters, WAYPOINTS, lambda *ends: asked.append(ends))
    for time, result, sent in steps:
        goal = dispatcher.step(time, result or None, HERE)
        assert goal == (None if sent is None else GOALS[sent]), time
    now = dispatcher.progress
    assert (now.current, now.reached, now.state) == progress
    # A plan from where amcl last saw the robot.
    assert asked == [(HERE, GOALS[sent]) for _, _, sent in steps if sent is not None]


def test_a_waypoint_without_a_heading_gets_that_of_the_parameters():
    given = DispatcherParameters(default_yaw=1.0, make_plan=False)
    dispatcher = WaypointDispatcher(given, WAYPOINTS[1:], pytest.fail)
    assert dispatcher.step(0.0, None, HERE) == Pose2(2.0, 0.0, 1.0)
