"""Look-ups of the two transforms at the stamps the stack asks for."""

import math

import pytest

from daemon.model.sut import Odometry
from daemon.stacks.ros1.transforms import TransformBuffer
from grammars.model.geometry import Pose2, Twist2


def at(time, x=0.0, yaw=0.0):
    return Odometry(time, Pose2(x, 0.0, yaw), Twist2())


def test_before_any_correction_the_robot_is_where_it_was_told_to_be():
    buffer = TransformBuffer(Pose2(5.0, 1.0, math.pi / 2), 0.5, delayed=True)
    buffer.move(at(0.0, x=2.0))
    pose = buffer.base_in_map()
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((5.0, 1.0, math.pi / 2))
    buffer.move(at(0.051, x=3.0))
    assert buffer.base_in_map().y == pytest.approx(2.0)


def test_a_correction_holds_for_stamped_look_ups_only_after_the_tolerance():
    buffer = TransformBuffer(Pose2(), 0.5, delayed=True)
    buffer.move(at(0.0))
    buffer.correct(0.0, Pose2(0.1))
    assert buffer.map_to_odom == Pose2(0.1), "the latest correction is there at once"
    assert buffer.correction_at(0.4) == Pose2()
    assert buffer.correction_at(0.5) == Pose2(0.1)
    assert buffer.correction_at(9.0) == Pose2(0.1)


def test_between_two_broadcasts_the_correction_is_interpolated():
    buffer = TransformBuffer(Pose2(), 0.5, delayed=True)
    buffer.move(at(0.0))
    buffer.correct(1.0, Pose2(0.0, 0.0, math.pi - 0.1))
    buffer.correct(1.1, Pose2(0.2, 0.0, -math.pi + 0.1))
    middle = buffer.correction_at(1.55)
    assert middle.x == pytest.approx(0.1)
    assert abs(middle.yaw) == pytest.approx(math.pi)
    # Look-ups need not come in order.
    assert buffer.correction_at(1.525).x == pytest.approx(0.05)


def test_without_the_quirk_corrections_hold_at_once():
    buffer = TransformBuffer(Pose2(), 0.5, delayed=False)
    buffer.move(at(0.0))
    buffer.correct(0.1, Pose2(0.1))
    buffer.correct(0.2, Pose2(0.2))
    assert buffer.correction_at(0.2) == Pose2(0.2)


def test_odometry_is_interpolated_at_the_stamp_of_a_scan():
    buffer = TransformBuffer(Pose2(), 0.5, delayed=True)
    for k in range(1000):
        buffer.move(at(0.051 * k, x=0.01 * k))
        buffer.correct(0.051 * k, Pose2())
    assert buffer.base_at(0.051 * 998.5).x == pytest.approx(9.985)
    assert buffer.base_at(99.0).x == pytest.approx(9.99), "held beyond the newest"
    assert len(buffer._stamps) < 300
    assert len(buffer._due) < 300
