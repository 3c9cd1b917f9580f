import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2, wrap_angle
from grammars.text import codec

coordinates = st.floats(-1e3, 1e3)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(Pose2, coordinates, coordinates, angles)


def assert_same_pose(a, b):
    assert (a.x, a.y) == pytest.approx((b.x, b.y), abs=1e-8)
    assert wrap_angle(a.yaw - b.yaw) == pytest.approx(0.0, abs=1e-9)


@given(poses)
def test_a_pose_times_its_inverse_is_the_identity(pose):
    assert_same_pose(pose @ pose.inverse(), Pose2())
    assert_same_pose(pose.inverse() @ pose, Pose2())


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    assert_same_pose((a @ b) @ c, a @ (b @ c))


@given(poses, poses, coordinates, coordinates)
def test_composing_poses_composes_what_they_do_to_points(a, b, x, y):
    assert (a @ b).apply((x, y)) == pytest.approx(a.apply(b.apply((x, y))), abs=1e-7)


def test_yaw_turns_counter_clockwise():
    assert Pose2(1.0, 2.0, math.pi / 2).apply((1.0, 0.0)) == pytest.approx((1.0, 3.0))


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_lie_in_one_turn_and_point_the_same_way(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(poses)
def test_values_survive_json_without_loss(pose):
    assert codec.from_json(Pose2, codec.to_json(pose)) == pose


def test_json_with_a_wrong_type_is_refused():
    with pytest.raises(ValueError, match="yaw"):
        codec.from_json(Pose2, b'{"x": 1, "y": 2, "yaw": "north"}')


def test_equal_values_have_equal_digests_and_different_ones_do_not():
    assert codec.digest(Pose2(1, 2, 3)) == codec.digest(Pose2(1.0, 2.0, 3.0))
    assert codec.digest(Pose2(1, 2, 3)) != codec.digest(Pose2(1, 2, 3.0000001))
