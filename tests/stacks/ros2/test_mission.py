"""Missions as goals: what is sent when, and what results mean."""

import math

import pytest

from daemon.model.sut import Progress, SutFailure
from daemon.stacks.ros2.link import GoalUpdate
from daemon.stacks.ros2.mission import GoalSequence
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from tests.stacks.ros2.pretended_link import PretendedLink

MISSION = Mission(
    "courier",
    Pose2(0.0, 0.0, 0.0),
    (Waypoint("desk", 2.0, 0.0, 1.0), Waypoint("door", 2.0, 3.0), Waypoint("home", 0.0, 3.0, 0.5)),
)


def begun(mode):
    link = PretendedLink()
    goals = GoalSequence(MISSION, mode, link, "map")
    goals.send_next(5)
    goals.take(GoalUpdate(0, "accepted"))
    return goals, link


def test_waypoints_are_sent_one_by_one_each_when_the_one_before_is_reached():
    goals, link = begun("waypoints")
    goals.send_next(6)
    assert link.goals == [(0, ((2.0, 0.0, 1.0),), "map", 5)]
    assert goals.active
    goals.take(GoalUpdate(0, "succeeded"))
    assert goals.progress == Progress(1, 1, "active")
    assert not goals.active
    goals.send_next(7)
    # Any heading will do there: the one of the way there is asked for.
    assert link.goals[1] == (1, ((2.0, 3.0, math.pi / 2),), "map", 7)
    goals.take(GoalUpdate(1, "accepted"))
    goals.take(GoalUpdate(1, "succeeded"))
    goals.send_next(8)
    goals.take(GoalUpdate(2, "accepted"))
    goals.take(GoalUpdate(2, "succeeded"))
    assert goals.progress == Progress(3, 3, "succeeded")
    goals.send_next(9)
    assert len(link.goals) == 3


@pytest.mark.parametrize("mode", ["follow", "through"])
def test_all_waypoints_in_one_goal_progress_by_feedback_and_end_by_the_result(mode):
    goals, link = begun(mode)
    assert [len(poses) for _, poses, _, _ in link.goals] == [3]
    told = {"current_waypoint": 1} if mode == "follow" else {"number_of_poses_remaining": 2}
    goals.take(GoalUpdate(0, "feedback", **told))
    assert goals.progress == Progress(1, 1, "active")
    # Not backwards, and not to the end before the result says so.
    for value in (0, 3):
        name = next(iter(told))
        goals.take(GoalUpdate(0, "feedback", **{name: value}))
    goals.take(GoalUpdate(0, "feedback", current_waypoint=9))
    assert goals.progress.state == "active"
    assert goals.progress.reached < 3
    goals.take(GoalUpdate(0, "succeeded"))
    assert goals.progress == Progress(3, 3, "succeeded")


@pytest.mark.parametrize(
    ("mode", "update", "words", "progress"),
    [
        ("follow", GoalUpdate(0, "succeeded", missed_waypoints=(1,)), "door",
         Progress(1, 1, "aborted")),
        ("waypoints", GoalUpdate(0, "aborted", 105, "no valid path"),
         "goal desk aborted, error code 105: no valid path", Progress(0, 0, "aborted")),
    ],
)  # fmt: skip
def test_what_is_the_robots_failure_is_told(mode, update, words, progress):
    goals, _ = begun(mode)
    (said,) = goals.take(update)
    assert words in said.text
    assert said.level == "error"
    assert goals.progress == progress


def test_an_abort_after_a_lost_acknowledgement_is_the_machines():
    goals, _ = begun("waypoints")
    goals.hear_log(
        'Timed out while waiting for action server to acknowledge goal request for "follow_path"'
    )
    with pytest.raises(SutFailure, match="default_server_timeout"):
        goals.take(GoalUpdate(0, "aborted"))


@pytest.mark.parametrize(
    ("state", "words"), [("rejected", "rejected the goal desk"), ("unanswered", "did not answer")]
)
def test_a_goal_that_is_not_taken_is_no_failure_of_the_robot(state, words):
    link = PretendedLink()
    goals = GoalSequence(MISSION, "waypoints", link, "map")
    goals.send_next(0)
    with pytest.raises(SutFailure, match=words):
        goals.take(GoalUpdate(0, state))


def test_what_comes_of_a_goal_that_is_over_changes_nothing():
    goals, _ = begun("waypoints")
    goals.take(GoalUpdate(0, "succeeded"))
    goals.send_next(1)
    assert goals.take(GoalUpdate(0, "aborted")) == ()
    assert goals.progress == Progress(1, 1, "active")


def test_recoveries_are_told_as_their_number_grows():
    goals, _ = begun("waypoints")
    counts = (0, 1, 1, 2)
    said = [goals.take(GoalUpdate(0, "feedback", number_of_recoveries=n)) for n in counts]
    assert [len(lines) for lines in said] == [0, 1, 0, 1]
