import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from daemon.trace import MovingLinks
from grammars.model.geometry import Pose2
from grammars.model.kinematics import cos_sin, link_tracks
from grammars.model.scene import Joint, Link, Scene, SceneObject
from tests.engine.trace.recordings import scene

ANGLES = st.floats(-3.0, 3.0)


def world_of(item):
    return Scene("world", (), (), (), (item,))


def object_with(*joints):
    ring = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1))
    links = tuple(Link(j.child, (ring,), 1.0, 0.0, 1.0) for j in joints)
    return SceneObject("item", "thing", Pose2(2.0, -1.0, 0.7), links, joints, (0.0,) * len(joints))


def pose_of(row):
    x, y, qz, qw = row.tolist()
    return Pose2(x, y, 2.0 * math.atan2(qz, qw))


def assert_same(found, expected):
    assert found.x == pytest.approx(expected.x, abs=1e-12)
    assert found.y == pytest.approx(expected.y, abs=1e-12)
    assert math.remainder(found.yaw - expected.yaw, math.tau) == pytest.approx(0.0, abs=1e-12)


def about(x, y, angle):
    return Pose2(x, y) @ Pose2(0.0, 0.0, angle) @ Pose2(-x, -y)


@given(ANGLES, ANGLES)
def test_a_folding_door_turns_leaf_on_leaf(first, second):
    item = object_with(
        Joint("b", "revolute", "inner", "outer", (1.0, 0.2), (1.0, 0.0), -3.0, 3.0),
        Joint("a", "revolute", "world", "inner", (0.1, 0.0), (1.0, 0.0), -3.0, 3.0),
    )
    links = MovingLinks.of(world_of(item))
    assert links.names == ("item/outer", "item/inner")
    poses = links.poses(np.array([[second, first]]))
    inner = item.pose @ about(0.1, 0.0, first)
    assert_same(pose_of(poses[0, 1]), inner)
    assert_same(pose_of(poses[0, 0]), inner @ about(1.0, 0.2, second))


@given(st.floats(-2.0, 2.0), ANGLES)
def test_a_drawer_slides_along_its_axis_and_carries_its_lid(along, angle):
    item = object_with(
        Joint("slide", "prismatic", "world", "drawer", (0.0, 0.0), (0.6, 0.8), -2.0, 2.0),
        Joint("lid", "revolute", "drawer", "lid", (0.0, 0.5), (1.0, 0.0), -3.0, 3.0),
    )
    poses = MovingLinks.of(world_of(item)).poses(np.array([[along, angle]]))
    drawer = item.pose @ Pose2(0.6 * along, 0.8 * along)
    assert_same(pose_of(poses[0, 0]), drawer)
    assert_same(pose_of(poses[0, 1]), drawer @ about(0.0, 0.5, angle))


@given(
    arrays(
        np.float64,
        st.tuples(st.integers(0, 6), st.just(4)),
        elements=st.sampled_from([0.0, -0.0, 0.7, 1.1, 1e300, math.inf, -math.inf, math.nan]),
    )
)
@np.errstate(invalid="ignore")
def test_poses_have_the_bits_of_a_plain_calculation(positions):
    hinge = Joint("a", "revolute", "world", "leaf", (0.1, -0.3), (1.0, 0.0), -3.0, 3.0)
    slide = Joint("s", "prismatic", "world", "wing", (0.0, 0.0), (0.6, 0.8), -2.0, 2.0)
    lid = Joint("b", "revolute", "wing", "lid", (1.0, 0.2), (1.0, 0.0), -3.0, 3.0)
    posted = replace(hinge, parent="post")
    post = Link("post", (((0.0, 0.0), (0.1, 0.0), (0.1, 0.1)),), 0.0, 0.0, 1.0)
    on_post = object_with(posted)
    items = (
        replace(on_post, links=(post, *on_post.links)),
        replace(object_with(slide, lid), name="drawer"),
        replace(object_with(hinge), name="other", pose=Pose2(-1.0, 4.0, -0.0)),
    )
    poses = MovingLinks.of(Scene("world", (), (), (), items)).poses(positions)
    tracks = [
        track
        for item, columns in zip(items, ([0], [1, 2], [3]), strict=True)
        for link, track in link_tracks(item, positions[:, columns]).items()
        if link != "post"
    ]
    for i, track in enumerate(tracks):
        cosine, sine = cos_sin(track[:, 2] / 2)
        expected = np.column_stack((track[:, 0], track[:, 1], sine, cosine))
        assert poses[:, i].tobytes() == expected.tobytes()


def test_only_links_that_joints_move_are_listed_and_frozen_objects_are_not():
    assert MovingLinks.of(scene()).names == ("door-0/leaf", "door-1/leaf")


def test_columns_of_frozen_objects_are_skipped_over():
    world = scene()
    world = replace(world, objects=world.objects[2:] + world.objects[:2])
    links = MovingLinks.of(world)
    poses = links.poses(np.array([[9.0, 0.0, 0.5]]))
    assert_same(pose_of(poses[0, 0]), world.objects[1].pose)
    assert pose_of(poses[0, 1]).yaw == pytest.approx(0.3 + 0.5)


def test_joints_that_form_a_loop_are_refused():
    item = object_with(
        Joint("a", "revolute", "y", "x", (0.0, 0.0), (1.0, 0.0), -1.0, 1.0),
        Joint("b", "revolute", "x", "y", (0.0, 0.0), (1.0, 0.0), -1.0, 1.0),
    )
    with pytest.raises(ValueError, match="loop"):
        MovingLinks.of(world_of(item))
