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


def object_with(*joints):
    ring = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1))
    links = tuple(Link(j.child, (ring,), 1.0, 0.0, 1.0) for j in joints)
    return SceneObject("item", "thing", Pose2(2.0, -1.0, 0.7), links, joints, (0.0,) * len(joints))


def pose_of(row):
    x, y, qz, qw = row.tolist()
    return Pose2(x, y, 2.0 * math.atan2(qz, qw))


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
    first, expected = pose_of(poses[0, 0]), world.objects[1].pose
    assert (first.x, first.y, first.yaw) == pytest.approx((expected.x, expected.y, expected.yaw))
    assert pose_of(poses[0, 1]).yaw == pytest.approx(0.3 + 0.5)
