"""``distance(robot, …)`` and ``in(robot, …)``: against geometry worked out by other means."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import SignalSampler
from daemon.trace import JointTrack
from grammars.model.geometry import Pose2
from grammars.model.scene import Doorway, Region
from grammars.oracle import Signal
from tests.engine.judging.oracles.traces import (
    CORRIDOR,
    ROBOT,
    along,
    box,
    make_trace,
    times,
    verdict,
)

HALL = Region("hall", box(-5.0, -1.0, 4.0, 1.0))
ROOM = Region("room", box(4.2, -1.0, 9.0, 1.0))
DOORWAY = Doorway("doorway", Pose2(4.0, 0.0), box(4.0, -0.5, 4.2, 0.5), 1.0, 0.0, 2.0)
SCENE = replace(CORRIDOR, regions=(HALL, ROOM), doorways=(DOORWAY,))


def driving():
    """From x = 0 to x = 5 m at 0.5 m/s, while the door swings shut."""
    time = times(10.0)
    angles = np.linspace(0.0, 1.5, len(time))[:, None]
    swing = JointTrack(("door-17.hinge",), time, angles, np.zeros_like(angles))
    return make_trace(along(time), scene=SCENE, joints=swing)


def sampled(trace, name, thing):
    return SignalSampler(trace).sample(Signal(name, (Signal("robot"), Signal(thing)))).values


def _to_segment(p, a, b):
    length = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    t = ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / length
    t = min(1.0, max(0.0, t))
    return math.hypot(p[0] - a[0] - t * (b[0] - a[0]), p[1] - a[1] - t * (b[1] - a[1]))


def _apart(one, other):
    """Distance of two outlines that do not overlap: from a corner of one to a side of the other."""
    return min(
        _to_segment(corner, ring[i - 1], ring[i])
        for corners, ring in ((one, other), (other, one))
        for corner in corners
        for i in range(len(ring))
    )


def test_the_distance_of_a_door_follows_its_leaf():
    trace = driving()
    found = sampled(trace, "distance", "door-17")
    leaf, item = CORRIDOR.objects[0].links[0], CORRIDOR.objects[0]
    angles = trace.joints.position[:, 0]
    for index in range(0, len(found), 40):
        x, y = trace.ground_truth.x[index], trace.ground_truth.y[index]
        turned = item.pose @ Pose2(0.0, 0.0, float(angles[index]))
        door = [turned.apply(corner) for corner in leaf.polygons[0]]
        robot = [(x + cx, y + cy) for cx, cy in ROBOT.footprint]
        assert found[index] == pytest.approx(_apart(robot, door), abs=1e-9)
    assert found[0] > found[-1] > 0.0
    assert sampled(trace, "distance", "door-17.leaf") == pytest.approx(found)


def test_the_distance_of_a_wall_is_straight_across():
    found = sampled(driving(), "distance", "wall-north")
    assert found == pytest.approx(np.full(len(found), 1.0 - 0.233))


def test_what_touches_or_overlaps_is_at_no_distance():
    assert sampled(driving(), "distance", "hall")[0] == 0.0


def test_places_are_measured_from_the_footprint_and_entered_by_the_base():
    trace = driving()
    x = trace.ground_truth.x
    to_room = np.maximum(0.0, 4.2 - (x + 0.35))
    assert sampled(trace, "distance", "room") == pytest.approx(to_room)
    assert sampled(trace, "in", "hall").tolist() == (x <= 4.0).tolist()
    assert sampled(trace, "in", "doorway").tolist() == ((x >= 4.0) & (x <= 4.2)).tolist()


def test_verdicts_name_what_was_near_and_when():
    trace = driving()
    near = verdict(trace, "always(distance(robot, doorway) >= 1 m)")
    assert (near.outcome, near.evidence.object) == ("fail", "doorway")
    assert near.evidence.value == 0.0
    assert verdict(trace, "eventually(in(robot, room))").outcome == "pass"
    assert verdict(trace, "time(in(robot, doorway)) <= 1 s").outcome == "pass"
    assert verdict(trace, "never(in(robot, room)) on leg 1").outcome != "pass"
    door = verdict(trace, "min(distance(robot, door-17)) when in(robot, hall)")
    assert door.evidence.object == "door-17.leaf"


def test_what_hangs_above_the_robot_has_no_distance():
    found = verdict(driving(), "always(distance(robot, lintel) >= 1 m)")
    assert found.outcome == "inconclusive"
