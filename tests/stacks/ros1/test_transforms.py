"""Look-ups of the two transforms at the stamps the stack asks for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.model.sut import LaserScan, Odometry
from daemon.stacks.ros1.scan_buffer import ScanBuffer
from daemon.stacks.ros1.transforms import TransformBuffer
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import Laser, Mount


def at(time, x=0.0, yaw=0.0):
    return Odometry(time, Pose2(x, 0.0, yaw), Twist2())


def moved(*poses, start=Pose2(), delayed=True):  # noqa: B008
    """Return a buffer with odometry at some x at instants 51 ms apart."""
    buffer = TransformBuffer(start, 0.5, delayed=delayed)
    for k, x in enumerate(poses):
        buffer.move(at(0.051 * k, x=x))
    return buffer


def test_before_any_correction_the_robot_is_where_it_was_told_to_be():
    pose = moved(2.0, start=Pose2(5.0, 1.0, math.pi / 2)).base_in_map()
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((5.0, 1.0, math.pi / 2))
    later = moved(2.0, 3.0, start=Pose2(5.0, 1.0, math.pi / 2)).base_in_map()
    assert later.y == pytest.approx(2.0)


def test_a_correction_holds_for_stamped_look_ups_only_after_the_tolerance():
    buffer = moved(0.0)
    buffer.correct(0.0, Pose2(0.1))
    assert buffer.map_to_odom == Pose2(0.1), "the latest correction is there at once"
    assert [buffer.correction_at(time).x for time in (0.4, 0.5, 9.0)] == [0.0, 0.1, 0.1]
    # Without the quirk it holds at once.
    buffer = moved(0.0, delayed=False)
    for tenth in (1, 2):
        buffer.correct(0.1 * tenth, Pose2(0.1 * tenth))
    assert buffer.correction_at(0.2) == Pose2(0.2)


def test_between_two_broadcasts_the_correction_is_interpolated():
    buffer = moved(0.0)
    buffer.correct(1.0, Pose2(0.0, 0.0, math.pi - 0.1))
    buffer.correct(1.1, Pose2(0.2, 0.0, -math.pi + 0.1))
    middle = buffer.correction_at(1.55)
    assert middle.x == pytest.approx(0.1)
    assert abs(middle.yaw) == pytest.approx(math.pi)
    # Look-ups need not come in order.
    assert buffer.correction_at(1.525).x == pytest.approx(0.05)


def test_odometry_is_interpolated_at_the_stamp_of_a_scan():
    buffer = moved()
    for k in range(1000):
        buffer.move(at(0.051 * k, x=0.01 * k))
        buffer.correct(0.051 * k, Pose2())
    assert buffer.base_at(0.051 * 998.5).x == pytest.approx(9.985)
    assert buffer.base_at(99.0).x == pytest.approx(9.99), "held beyond the newest"
    assert len(buffer._stamps) < 300
    assert len(buffer._due) < 300


FRONT = Laser(
    Mount(0.5), 0.3, -1.0, 1.0, 5, 0.05, 5.0, 10.0, 0.0, 0.0, name="front"
)  # fmt: skip
REAR = replace(FRONT, name="rear", mount=Mount(-0.5), z=0.6, rays=3, range_max=3.0)


class Robot:
    """Drives along x at 1 m/s; every scan reads the second it was taken at."""

    def __init__(self, *lasers, keep=0.0, delayed=True):
        self.transforms = TransformBuffer(Pose2(), 0.5, delayed=delayed)
        self.buffer = ScanBuffer(lasers, self.transforms, keep=keep)

    def drive(self, until):
        """Take odometry, 20 times a second, up to ``until`` [s]."""
        begin = self.transforms.time
        for tick in range(round(begin * 20) + 1 if begin >= 0.0 else 0, round(until * 20) + 1):
            now = tick / 20
            self.transforms.move(Odometry(now, Pose2(now), Twist2(1.0)))
        self.buffer.release_known(until)

    def scan(self, time, laser):
        ranges = np.full(laser.rays, time, dtype=np.float32)
        self.buffer.queue(LaserScan(time, ranges, laser.name))


def told(scans):
    return [(scan.laser, scan.time) for scan in scans]


def test_a_scan_is_seen_from_its_own_laser():
    robot = Robot(FRONT, REAR)
    robot.scan(1.0, FRONT)
    robot.scan(1.0, REAR)
    robot.drive(2.0)
    front, rear = robot.buffer.scans("odom")
    assert (front.pose.x, rear.pose.x) == (pytest.approx(1.5), pytest.approx(0.5))
    assert (front.height, rear.height) == (0.3, 0.6)
    assert (len(front.angles), len(rear.angles)) == (5, 3)
    assert (front.range_max, rear.range_max) == (5.0, 3.0)
    assert rear.received == 2.0


def test_a_scan_says_where_its_rays_point_in_single_precision():
    # 0.1 in single precision is 0.100000001490116, and a ray has whole multiples of that.
    laser = replace(FRONT, angle_min=0.1, angle_max=0.5)
    robot = Robot(laser)
    robot.scan(1.0, laser)
    robot.drive(2.0)
    single = 0.10000000149011612
    assert laser.angle_increment == pytest.approx(0.1)
    expected = [single + ray * single for ray in range(5)]
    assert robot.buffer.scans("odom")[0].angles.tolist() == expected


def test_a_scan_waits_until_transforms_reach_beyond_it():
    robot = Robot(FRONT, REAR)
    robot.scan(1.0, FRONT)
    robot.drive(1.0)
    assert robot.buffer.scans("odom") == []
    robot.drive(1.05)
    assert told(robot.buffer.scans("odom")) == [("front", 1.0)]


def test_without_persistence_only_the_newest_of_each_laser_is_there():
    robot = Robot(FRONT, REAR)
    for time in (0.1, 0.2, 0.3):
        robot.scan(time, FRONT)
    robot.scan(0.2, REAR)
    robot.drive(1.0)
    assert told(robot.buffer.scans("odom")) == [("rear", 0.2), ("front", 0.3)]
    assert told(robot.buffer.scans("map")) == told(robot.buffer.scans("odom"))


def test_scans_stay_as_long_as_they_are_wanted_oldest_first():
    robot = Robot(FRONT, REAR, keep=0.5)
    for tick in range(1, 11):
        robot.scan(tick / 10, FRONT)
        if tick in (4, 8):
            robot.scan(tick / 10, REAR)
        robot.drive(tick / 10 + 0.05)
    # Whatever is older than half a second when another one of its laser arrives is gone.
    expected = [(laser, tick / 10) for tick in range(6, 11) for laser in ("front", "rear")
                if laser == "front" or tick == 8]  # fmt: skip
    assert told(robot.buffer.scans("odom")) == [("rear", 0.4), *expected]
    assert [s.ranges[0] for s in robot.buffer.scans("odom")] == pytest.approx(
        [0.4, *(time for _, time in expected)]
    )


def test_what_is_kept_stays_where_it_was_and_the_newest_follows_the_correction():
    robot = Robot(FRONT, keep=2.0, delayed=False)
    robot.scan(0.5, FRONT)
    robot.drive(0.6)
    robot.scan(0.8, FRONT)
    robot.drive(1.0)
    robot.transforms.correct(1.0, Pose2(0.0, 3.0))
    old, new = robot.buffer.scans("map")
    assert (old.pose.x, old.pose.y) == (pytest.approx(1.0), 0.0)
    assert (new.pose.x, new.pose.y) == (pytest.approx(1.3), 3.0)
    assert [s.pose.y for s in robot.buffer.scans("odom")] == [0.0, 0.0]
