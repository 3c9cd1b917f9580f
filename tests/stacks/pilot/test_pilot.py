import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.model.sut import Observation
from daemon.stacks.pilot import driver
from daemon.stacks.registry import make_sut
from grammars.model.geometry import Pose2, Twist2, wrap_angle
from grammars.model.robot import Mount, OdometryNoise
from tests.stacks.pilot.world import DOOR, ONE_DOORWAY, SIZE, TWO_DOORWAYS, a_robot, drive

START = Pose2(1.2, 3.6, 0.0)
ACROSS = (7.6, 1.5)


def worst_error(log):
    return max(math.hypot(t.x - e.pose.x, t.y - e.pose.y) for t, e in log.estimates)


def inside_two_sigma(log):
    """Share of estimates with x and y both within two standard deviations of the truth."""
    off = np.array([(t.x - e.pose.x, t.y - e.pose.y) for t, e in log.estimates])
    variances = np.array([np.diag(e.covariance)[:2] for _, e in log.estimates])
    return float(np.mean((off**2 <= 4.0 * variances).all(axis=1)))


@pytest.mark.parametrize("kind", ["omnidirectional", "differential"])
def test_it_drives_through_a_doorway_without_touching_it(kind):
    slow = {"max_speed": 0.4, "acceleration": 0.3}
    log = drive(ONE_DOORWAY, SIZE, START, [ACROSS, (1.2, 3.6)], robot=a_robot(kind), **slow)
    assert (log.state, log.collided) == ("succeeded", False)
    assert log.last.progress.reached == 2
    assert math.hypot(log.poses[-1].x - 1.2, log.poses[-1].y - 3.6) < 0.15
    assert worst_error(log) < 0.15
    assert inside_two_sigma(log) > 0.95
    speeds = np.array([(c.vx, c.vy, c.wz) for c in log.commands])
    assert kind == "omnidirectional" or (speeds[:, 1] == 0.0).all()
    assert np.hypot(speeds[:, 0], speeds[:, 1]).max() <= 0.4 + 1e-9
    assert np.abs(speeds[:, 2]).max() <= 1.0 + 1e-9
    assert np.diff(speeds[:, 0]).max() <= 0.3 * 0.05 + 1e-9
    assert [text for _, text in log.events] == [
        "waypoint 1 reached", "waypoint 2 reached", "mission complete",
    ]  # fmt: skip


def test_it_stays_at_a_waypoint_as_long_as_the_mission_says():
    # Longer than its patience, which a stay does not wear down.
    log = drive(ONE_DOORWAY, SIZE, START, [(2.5, 2.5, None, 70.0), (2.5, 3.5, None, 5.0)])
    (first, _), (second, _), (last, _) = log.events
    assert (log.state, log.last.progress.reached) == ("succeeded", 2)
    assert 70.0 < second - first < 80.0
    assert last - second == pytest.approx(5.0, abs=0.06)


@pytest.mark.parametrize("yaw", [math.pi / 2, -2.5])
def test_a_waypoint_with_a_heading_is_left_with_that_heading(yaw):
    log = drive(ONE_DOORWAY, SIZE, START, [(2.5, 2.5, yaw)])
    assert log.state == "succeeded"
    assert abs(wrap_angle(log.poses[-1].yaw - yaw)) < 0.12


def test_it_waits_for_a_door_to_open_and_goes_on():
    log = drive(ONE_DOORWAY, SIZE, START, [ACROSS], doors={DOOR: lambda now: now < 25.0})
    assert (log.state, log.collided) == ("succeeded", False)
    waiting, free = log.said("blocked, waiting"), log.said("the way is free again")
    assert waiting < 25.0 <= free < 30.0


def test_it_drives_around_through_another_door():
    log = drive(TWO_DOORWAYS, SIZE, Pose2(1.2, 1.5), [ACROSS], doors={DOOR: lambda now: now > 1.0})
    assert (log.state, log.collided) == ("succeeded", False)
    assert log.said("replanning around an obstacle") is not None
    assert max(pose.y for pose in log.poses if abs(pose.x - 4.5) < 0.2) > 3.5


def test_it_gives_up_when_a_door_stays_shut_and_backing_off_takes_nothing_from_its_patience(
    monkeypatch,
):
    shut = {DOOR: lambda _: True}
    moving = drive(ONE_DOORWAY, SIZE, START, [ACROSS], doors=shut, patience=15.0)
    assert (moving.state, moving.collided) == ("aborted", False)
    assert moving.said("giving up: no way to waypoint 1") is not None
    assert 15.0 < moving.time < 40.0
    monkeypatch.setattr(driver, "_RETREATS", 0)
    standing = drive(ONE_DOORWAY, SIZE, START, [ACROSS], doors=shut, patience=15.0)
    assert moving.said("to make room") is not None
    assert standing.said("to make room") is None
    assert moving.time > standing.time + 1.0


def test_it_gives_up_at_once_when_the_map_shows_no_way():
    log = drive([*ONE_DOORWAY, DOOR], SIZE, START, [(2.0, 2.0), ACROSS])
    assert (log.state, log.last.progress.reached) == ("aborted", 1)
    assert log.events[-1][1] == "giving up: no way to waypoint 2"
    assert log.events[-1][0] == log.said("waypoint 1 reached")


def test_it_goes_on_when_what_boxed_it_in_is_taken_away():
    """Crates all around, too close to turn or back off, until somebody removes them."""
    crates = [
        (1.7, 2.8, 1.8, 4.2), (0.6, 2.8, 0.7, 4.2), (0.6, 3.95, 1.8, 4.05), (0.6, 3.1, 1.8, 3.2),
    ]  # fmt: skip
    doors = {crate: (lambda now: now < 30.0) for crate in crates}
    robot = a_robot(view=1.99 * math.pi, rays=300)
    log = drive(ONE_DOORWAY, SIZE, Pose2(1.2, 3.575), [(3.0, 2.0)], doors=doors, robot=robot)
    assert (log.state, log.collided) == ("succeeded", False)
    assert log.time > 30.0


def short_sighted(*, z=0.3, kind="omnidirectional"):
    """A robot whose first laser sees half a metre far; a slower one sees far and behind."""
    robot = a_robot(kind)
    near = replace(robot.laser, name="near", range_max=0.5)
    far = replace(
        robot.laser, name="far", mount=Mount(0.0), z=z, rate=5.0,
        angle_min=-math.pi, angle_max=math.pi, rays=240,
    )  # fmt: skip
    return replace(robot, laser=near, other_lasers=(far,))


def test_every_laser_at_the_height_of_the_map_tells_where_it_is():
    log = drive(ONE_DOORWAY, SIZE, START, [ACROSS], robot=short_sighted())
    assert (log.state, log.collided) == ("succeeded", False)
    assert worst_error(log) < 0.1
    # One at another height would meet other walls; the map is not held against what it sees.
    above = drive(ONE_DOORWAY, SIZE, START, [ACROSS], robot=short_sighted(z=1.0))
    assert worst_error(above) > worst_error(log)


def test_what_any_laser_sees_is_in_the_way():
    robot = short_sighted(z=1.0)
    log = drive(
        TWO_DOORWAYS, SIZE, Pose2(1.2, 1.5), [ACROSS], doors={DOOR: lambda now: now > 1.0},
        robot=replace(robot, odometry=OdometryNoise(20.0, 0.0, 0.0, 0.0)),
    )  # fmt: skip
    assert (log.state, log.collided) == ("succeeded", False)
    replanned = log.said("replanning around an obstacle")
    assert replanned is not None
    # From far away, as the first laser could not.
    assert 4.47 - log.poses[round(replanned / 0.05)].x > 1.0


def test_the_idle_system_stands_still_and_takes_no_parameters():
    decision = make_sut("idle", {}).update(Observation(0.0, (), ()))
    assert decision.command == Twist2()
    assert decision.progress.state == "active"
    with pytest.raises(ValueError, match="speed"):
        make_sut("idle", {"speed": 1.0})
