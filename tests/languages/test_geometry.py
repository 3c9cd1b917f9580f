"""Poses in the plane, kinematics of scene objects, and routes of movers."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Walk
from grammars.model.free_space import hulls_between
from grammars.model.geometry import Pose2, wrap_angle
from grammars.model.kinematics import link_poses, link_tracks
from grammars.model.movers import (
    CORNER,
    Profile,
    Route,
    chain_positions,
    is_mover,
    with_planar_chain,
)
from grammars.model.scene import Joint, Link, SceneObject
from grammars.preflight._walks import _walked_poses, _without_straight
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


PANEL = ((0.0, 0.0), (0.0, 0.04), (0.9, 0.04), (0.9, 0.0))
ANGLES = st.floats(-3.0, 3.0)
METRES = st.floats(-20.0, 20.0)


ORIGIN = Pose2()


def link(name):
    return Link(name, (PANEL,), 10.0, 0.0, 2.0)


def revolute(child, parent="world", anchor=(0.0, 0.0)):
    return Joint(f"{child}-hinge", "revolute", parent, child, anchor, (1.0, 0.0), -3.0, 3.0)


def prismatic(child, axis, parent="world"):
    return Joint(f"{child}-rail", "prismatic", parent, child, (0.0, 0.0), axis, -3.0, 3.0)


def thing(links, joints, pose=ORIGIN):
    parts = tuple(link(name) for name in links)
    return SceneObject("thing", "thing", pose, parts, tuple(joints), (0.0,) * len(joints))


def test_a_hinge_turns_its_leaf_about_the_anchor():
    door = thing(["frame", "leaf"], [revolute("leaf", "frame", (0.1, 0.2))], Pose2(5.0, 1.0, 0.0))
    poses = link_poses(door, [math.pi / 2])
    assert poses["leaf"].apply((0.1, 0.2)) == pytest.approx((5.1, 1.2))
    assert poses["leaf"].apply((1.0, 0.2)) == pytest.approx((5.1, 2.1))
    assert poses["frame"] == door.pose


@given(ANGLES, ANGLES, METRES, METRES, ANGLES)
def test_a_folding_door_agrees_with_folding_point_by_point(first, second, x, y, yaw):
    joints = [revolute("outer", "inner", (0.5, 0.0)), revolute("inner", anchor=(0.0, 0.0))]
    poses = link_poses(thing(["outer", "inner"], joints, Pose2(x, y, yaw)), [second, first])
    knee = (x + 0.5 * math.cos(yaw + first), y + 0.5 * math.sin(yaw + first))
    tip = (
        knee[0] + 0.5 * math.cos(yaw + first + second),
        knee[1] + 0.5 * math.sin(yaw + first + second),
    )
    assert poses["outer"].apply((0.5, 0.0)) == pytest.approx(knee, abs=1e-9)
    assert poses["outer"].apply((1.0, 0.0)) == pytest.approx(tip, abs=1e-9)
    assert list(poses) == ["outer", "inner"]


@pytest.mark.parametrize(
    ("joints", "positions", "message"),
    [
        ([revolute("a")], [], "1 joints, but 0"),
        ([revolute("a", "c")], [0.0], 'unknown link "c"'),
        ([revolute("world", "a")], [0.0], 'unknown link "world"'),
        ([revolute("a"), prismatic("a", (1.0, 0.0))], [0.0, 0.0], "more than one joint"),
        ([revolute("a", "b"), revolute("b", "a")], [0.0, 0.0], "form a loop"),
    ],
)
def test_joints_that_are_no_forest_are_refused(joints, positions, message):
    with pytest.raises(ValueError, match=message):
        link_poses(thing(["a", "b"], joints), positions)


@given(st.lists(st.tuples(st.floats(-3, 3), st.floats(-1, 1)), min_size=1, max_size=5))
def test_tracks_over_time_are_the_poses_of_each_moment(moments):
    joints = [revolute("outer", "inner", (1.0, 0.2)), prismatic("inner", (0.6, 0.8))]
    item = thing(["outer", "inner", "post"], joints, Pose2(2.0, -1.0, 0.7))
    slid = link_poses(item, (0.0, 0.5))["inner"]
    assert slid.apply((0.0, 0.0)) == pytest.approx(item.pose.apply((0.3, 0.4)))
    tracks = link_tracks(item, np.array(moments))
    for row, positions in enumerate(moments):
        for link, pose in link_poses(item, positions).items():
            x, y, yaw = tracks[link][row]
            assert (x, y) == pytest.approx((pose.x, pose.y), abs=1e-12)
            assert math.remainder(yaw - pose.yaw, math.tau) == pytest.approx(0.0, abs=1e-12)


positive = st.floats(0.1, 5.0)
points = st.lists(
    st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=3, max_size=6, unique=True
)


@given(length=st.floats(0.0, 20.0), share=st.floats(0.0, 1.0), speed=positive, rate=positive)
def test_a_profile_keeps_its_limits_and_ends_at_rest(length, share, speed, rate):
    entry = share * min(speed, math.sqrt(2.0 * rate * length))
    profile = Profile.plan(length, entry, speed, rate)
    assert profile.at(0.0) == pytest.approx((0.0, entry), abs=1e-9)
    assert profile.at(profile.duration) == pytest.approx((length, 0.0), abs=1e-6)
    times = np.linspace(0.0, profile.duration, 400)
    ways, speeds = np.array([profile.at(t) for t in times.tolist()]).T
    assert speeds.max() <= max(speed, entry) + 1e-9
    assert np.diff(ways).min() >= -1e-9
    step = times[1]
    assert np.abs(np.diff(speeds)).max() <= rate * step + 1e-9
    mean = (speeds[1:] + speeds[:-1]) / 2
    assert np.diff(ways) == pytest.approx(mean * step, abs=rate * step**2 + 1e-12)


def test_a_profile_without_end_cruises():
    profile = Profile.plan(math.inf, 0.0, 2.0, 1.0)
    assert profile.duration == math.inf
    assert profile.at(1002.0) == pytest.approx((2.0 + 2000.0, 2.0))


@given(points, st.sampled_from(["once", "round"]))
def test_ways_are_arc_lengths_and_headings_never_jump(corners, manner):
    route = Route(Walk("v", tuple(corners), 1.0, manner=manner))
    ways = np.arange(0.0, route.length * (2 if manner == "round" else 1), 0.01)
    track = np.array([(*route.point(w), route.yaw(w)) for w in ways.tolist()])
    steps = np.hypot(*np.diff(track[:, :2], axis=0).T)
    assert steps.max() <= 0.01 + 1e-9
    assert [route.point(w) for w in route.stops[:1]] == [corners[0]]
    # A corner of half a turn at most, spread evenly over the way around it.
    sharpest = math.pi * 0.01 / (2.0 * CORNER)
    assert np.abs(np.diff(track[:, 2])).max() <= sharpest + 1e-9


THERE_AND_BACK, BEND = ((0.0, 0.0), (3.0, 0.0), (1.0, 0.0)), ((0.0, 0.0), (1.0, 1.0), (2.0, 0.0))


@pytest.mark.parametrize("corners", [THERE_AND_BACK, BEND])
@pytest.mark.parametrize("facing", ["ahead", "fixed"])
def test_poses_left_out_of_a_walk_cover_nothing_more(corners, facing):
    walk = Walk("v", corners, 1.0, manner="back-and-forth", facing=facing)
    poses = _walked_poses(walk)
    every, some = (
        shapely.union_all(hulls_between(each, PANEL), grid_size=1e-9)
        for each in (poses, _without_straight(poses))
    )
    assert shapely.symmetric_difference(every, some, grid_size=1e-9).area < 1e-6


def test_a_closed_route_turns_once_a_lap():
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    route = Route(Walk("v", square, 1.0, manner="round"))
    assert route.length == pytest.approx(8.0)
    for lap in range(4):
        assert route.yaw(8.0 * lap + 1.0) == pytest.approx(math.tau * lap)
        assert route.point(8.0 * lap + 3.0) == pytest.approx((2.0, 1.0))


def test_the_chain_puts_the_body_anywhere():
    links, joints = with_planar_chain((Link("body", (), 1.0, 0.0, 1.0),), (), "body")
    mover = SceneObject("v", "v", Pose2(1.0, 2.0, 0.7), links, joints, (0.0, 0.0, 0.0))
    positions = chain_positions(mover, Pose2(-3.0, 4.0), 9.0)
    there = mover.pose @ Pose2(*positions)
    assert (there.x, there.y) == pytest.approx((-3.0, 4.0))
    assert math.remainder(there.yaw - 9.0, math.tau) == pytest.approx(0.0)


def test_three_joints_of_the_right_names_are_no_planar_chain():
    _, joints = with_planar_chain((), (), "body")
    assert is_mover(joints)
    other = Joint("yaw", "prismatic", "y_carrier", "body", (0.0, 0.0), (1.0, 0.0), 0.0, 1.0)
    assert not is_mover((*joints[:2], other))
