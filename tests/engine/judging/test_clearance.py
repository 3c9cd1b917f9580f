"""Clearance and distance against shapely and plain geometry, links against their kinematics."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.oracles import SignalSampler
from daemon.trace import JointTrack
from grammars.model.geometry import Pose2
from grammars.model.kinematics import link_poses
from grammars.model.scene import Joint, Link, Scene, SceneObject, Solid
from grammars.oracle import Signal
from tests.engine.judging.traces import (
    CORRIDOR,
    ROBOT,
    along,
    box,
    door,
    make_trace,
    still,
    times,
    wall,
)

COORDINATE = st.floats(-4.0, 4.0).map(lambda value: round(value, 3))
ANGLE = st.floats(-math.pi, math.pi).map(lambda value: round(value, 3))
HALF = st.floats(0.05, 1.0).map(lambda value: round(value, 3))


@st.composite
def convex_rings(draw):
    """A convex polygon: corners on an ellipse, at sorted angles."""
    cx, cy = draw(COORDINATE), draw(COORDINATE)
    rx, ry = draw(HALF), draw(HALF)
    steps = draw(st.lists(st.integers(0, 359), min_size=3, max_size=7, unique=True))
    angles = [math.radians(step) for step in sorted(steps)]
    return tuple((cx + rx * math.cos(a), cy + ry * math.sin(a)) for a in angles)


def reference(ring, pose, centre, half):
    """How much the box must grow on all sides to touch ``ring``: bisection with shapely."""
    obstacle = shapely.Polygon([pose.inverse().apply(corner) for corner in ring])
    hx, hy = half

    def touches(margin):
        x, y = max(hx + margin, 0.0), max(hy + margin, 0.0)
        area = shapely.box(centre[0] - x, centre[1] - y, centre[0] + x, centre[1] + y)
        return bool(area.intersects(obstacle))

    low, high = -min(hx, hy), 20.0
    if touches(low):
        return low
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (low, middle) if touches(middle) else (middle, high)
    return high


def scene_of(*rings):
    solids = tuple(Solid(f"s{i}", "wall", ring, 0.0, 2.0) for i, ring in enumerate(rings))
    return Scene("test", (), (), solids)


def sample(scene, poses, centre, half):
    """Return the clearance of a robot with that box as footprint, and what is nearest, by pose."""
    x, y, yaw = np.array([(p.x, p.y, p.yaw) for p in poses]).T
    motion = replace(still(times((len(poses) - 1) / 20.0)), x=x, y=y, yaw=yaw)
    (cx, cy), (hx, hy) = centre, half
    robot = replace(ROBOT, footprint=box(cx - hx, cy - hy, cx + hx, cy + hy))
    found = SignalSampler(make_trace(motion, scene=scene, robot=robot)).sample(Signal("clearance"))
    return found.values, [found.object_at(index) for index in range(len(poses))]


CLEARANCE = Signal("clearance")
POSES = st.builds(Pose2, COORDINATE, COORDINATE, ANGLE)


@given(
    st.lists(convex_rings(), min_size=1, max_size=4),
    st.lists(POSES, min_size=1, max_size=3),
    st.tuples(st.sampled_from([0.0, 0.1]), st.sampled_from([0.0, -0.2])),
    st.tuples(HALF, HALF),
)
def test_the_kernel_agrees_with_shapely(rings, poses, centre, half):
    values, nearest = sample(scene_of(*rings), poses, centre, half)
    for index, pose in enumerate(poses):
        expected = [reference(ring, pose, centre, half) for ring in rings]
        assert values[index] == pytest.approx(min(expected), abs=1e-6)
        assert expected[int(nearest[index][1:])] == pytest.approx(min(expected), abs=1e-6)


def test_of_equally_near_obstacles_the_first_is_named():
    scene = scene_of(box(-2.0, -1.0, -1.0, 1.0), box(1.0, -1.0, 2.0, 1.0))
    _, nearest = sample(scene, [Pose2(0.1), Pose2(0.0)], (0.0, 0.0), (0.35, 0.233))
    assert nearest == ["s1", "s0"]


def test_what_the_robot_passes_under_or_over_is_no_obstacle():
    scene = Scene(
        "heights",
        (),
        (),
        (
            wall("lintel", 0.0, -1.0, 1.0, 1.0, z_min=1.1),
            wall("ditch", 0.0, -1.0, 1.0, 1.0, z_min=-1.0, z_max=0.0),
            wall("step", 3.0, -1.0, 4.0, 1.0, z_max=0.1),
        ),
    )
    assert SignalSampler(make_trace(still(times(0.0)), scene=scene)).obstacles.names == ("step",)


def swinging(time, angle):
    position = angle.reshape(-1, 1)
    return JointTrack(CORRIDOR.joint_names, time, position, np.zeros_like(position))


def test_a_moment_of_a_long_way_is_judged_as_that_moment_alone():
    time = times(4.0)
    doors = (door("door-1", 9.0, 0.0), door("door-2", 40.0, 1.0))
    solids = tuple(wall(f"s{i}", 3.0 * i, 1.2, 3.0 * i + 1.0, 9.0) for i in range(20))
    scene = Scene("row", (), (), solids, doors)
    # Out slowly and back in leaps; the second door shuts when the robot has long been beside it.
    x = np.concatenate((np.linspace(0.0, 42.0, 61), np.linspace(42.0, 0.0, 20)))
    yaw = np.linspace(0.0, 7.0, 81)
    angle = np.stack((np.where(time < 1.0, 0.0, -1.2), np.where(time < 2.9, 0.4, -1.5)), axis=1)
    joints = JointTrack(scene.joint_names, time, angle, np.zeros_like(angle))
    moving = replace(still(time), x=x, yaw=yaw)
    found = SignalSampler(make_trace(moving, scene=scene, joints=joints)).sample(CLEARANCE)
    for index in range(len(time)):
        here = replace(still(time), x=np.full(81, x[index]), yaw=np.full(81, yaw[index]))
        alone = SignalSampler(make_trace(here, scene=scene, joints=joints)).sample(CLEARANCE)
        assert found.values[index] == alone.values[index]
        assert found.object_at(index) == alone.object_at(index)


def test_frozen_objects_stand_as_they_were_placed():
    ajar = replace(door("door-1", 1.0, 0.0), initial=(math.pi / 2,), frozen=True)
    scene = Scene("ajar", (), (), (), (ajar,))
    values, nearest = sample(scene, [Pose2()], (0.0, 0.0), (0.1, 0.1))
    assert values[0] == pytest.approx(1.0 - 0.02 - 0.1)
    assert nearest == ["door-1.leaf"]


def arm():
    """A sliding carriage that carries a hinged flap."""
    links = tuple(Link(n, (box(0.0, 0.0, 1.0, 0.1),), 1.0, 0.0, 1.0) for n in ("flap", "carriage"))
    slide = Joint("slide", "prismatic", "world", "carriage", (0.0, 0.0), (0.6, 0.8), -1.0, 1.0)
    hinge = Joint("hinge", "revolute", "carriage", "flap", (0.4, 0.1), (0.0, 0.0), -2.0, 2.0)
    return SceneObject("arm", "arm", Pose2(1.0, 2.0, 0.5), links, (hinge, slide), (0.0, 0.0))


def moved(item, positions):
    """A robot that stands still beside an object whose joints are at ``positions`` (n, joints)."""
    time = times((len(positions) - 1) / 20.0)
    scene = Scene("one", (), (), (), (item,))
    joints = JointTrack(scene.joint_names, time, positions, np.zeros_like(positions))
    return SignalSampler(make_trace(still(time), scene=scene, joints=joints))


def test_the_foot_of_a_carried_hinge_moves_with_its_parent():
    item, positions = arm(), np.array([(0.7, 0.0), (0.7, 0.5)])
    found = moved(item, positions).sample(Signal("arm.hinge.distance")).values
    carriage = link_poses(item, (0.7, 0.5))["carriage"]
    assert found[1] == pytest.approx(math.hypot(*carriage.apply((0.4, 0.1))))
    assert found[0] == pytest.approx(math.hypot(*item.pose.apply((0.4, 0.1))))


def test_the_distance_of_a_door_follows_its_leaf():
    time = times(10.0)
    angles = np.linspace(0.0, 1.5, len(time))
    trace = make_trace(along(time), joints=swinging(time, angles))
    found = SignalSampler(trace).sample(Signal("distance", (Signal("robot"), Signal("door-17"))))
    item = CORRIDOR.objects[0]
    for index in range(0, len(time), 40):
        turned = item.pose @ Pose2(0.0, 0.0, float(angles[index]))
        leaf = shapely.Polygon(turned.apply_ring(item.links[0].polygons[0]))
        robot = shapely.Polygon(Pose2(trace.ground_truth.x[index]).apply_ring(ROBOT.footprint))
        assert found.values[index] == pytest.approx(leaf.distance(robot), abs=1e-9)
