"""Forward kinematics of scene objects."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2
from grammars.model.kinematics import joint_motion, link_poses, link_tracks
from grammars.model.scene import Joint, Link, SceneObject

LEAF = ((0.0, 0.0), (0.0, 0.04), (0.9, 0.04), (0.9, 0.0))
ORIGIN = Pose2()
ANGLES = st.floats(-3.0, 3.0)
METRES = st.floats(-20.0, 20.0)


def link(name):
    return Link(name, (LEAF,), 10.0, 0.0, 2.0)


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


def test_a_rail_moves_its_panel_along_the_axis_of_the_object():
    door = thing(["panel"], [prismatic("panel", (0.0, 1.0))], Pose2(2.0, 3.0, math.pi / 2))
    assert link_poses(door, [0.5])["panel"].apply((0.0, 0.0)) == pytest.approx((1.5, 3.0))


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


@given(ANGLES, METRES, METRES)
def test_the_anchor_of_a_hinge_never_moves(angle, x, y):
    assert joint_motion(revolute("leaf", anchor=(x, y)), angle).apply((x, y)) == pytest.approx(
        (x, y), abs=1e-9
    )


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
    ring = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1))
    item = SceneObject(
        "folding",
        "folding",
        Pose2(2.0, -1.0, 0.7),
        tuple(Link(name, (ring,), 1.0, 0.0, 1.0) for name in ("outer", "inner", "post")),
        (
            Joint("fold", "revolute", "inner", "outer", (1.0, 0.2), (1.0, 0.0), -3.0, 3.0),
            Joint("slide", "prismatic", "world", "inner", (0.0, 0.0), (0.6, 0.8), -1.0, 1.0),
        ),
        (0.0, 0.0),
    )
    tracks = link_tracks(item, np.array(moments))
    for row, positions in enumerate(moments):
        for link, pose in link_poses(item, positions).items():
            x, y, yaw = tracks[link][row]
            assert (x, y) == pytest.approx((pose.x, pose.y), abs=1e-12)
            assert math.remainder(yaw - pose.yaw, math.tau) == pytest.approx(0.0, abs=1e-12)
