"""Waypoints one by one, at most one a second, none after a failure."""

from daemon.stacks.ros1.move_base import DispatcherParameters
from daemon.stacks.ros1.move_base.dispatcher import WaypointDispatcher
from grammars.model.geometry import Pose2
from grammars.model.mission import Waypoint

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
