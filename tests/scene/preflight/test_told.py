"""What joints are told to do, and what they sweep through while they do it."""

import dataclasses

import pytest

from grammars.model.behaviour import (
    Hold,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Trigger,
)
from tests.scene.preflight.samples import DOOR, PERSON, messages, mission, scene_with

TASK = mission((3, 0))
FREE = "d is a hinged_door at kitchen\n"


def frames(joint, *positions):
    told = tuple(KeyFrame(float(i), q) for i, q in enumerate(positions))
    return KeyFrames(joint, told, Jump())


def with_limits(scene, lower, upper, initial=0.0):
    body = scene.objects[0]
    joint = dataclasses.replace(body.joints[0], lower=lower, upper=upper)
    changed = dataclasses.replace(body, joints=(joint,), initial=(initial,))
    return dataclasses.replace(scene, objects=(changed, *scene.objects[1:]))


def test_a_frozen_joint_may_only_be_held_where_it_is(robile):
    frozen = scene_with(FREE.replace("\n", ", frozen"))
    moves = "d.hinge is to move, but d is frozen (leave out frozen, or the behaviour)"
    assert messages(robile, frozen, TASK, Hold("d.hinge", 0.0)) == []
    assert messages(robile, frozen, TASK, Hold("d.hinge", 0.1)) == [moves]
    assert messages(robile, frozen, TASK, frames("d.hinge", 0.0)) == [moves]


def test_the_limits_themselves_are_allowed(robile):
    scene = scene_with(FREE)
    assert messages(robile, scene, TASK, frames("d.hinge", 0.0, 2.0)) == []
    hint = "(between 0 and 2)"
    assert messages(robile, scene, TASK, frames("d.hinge", -0.01, 1.0, 2.01, -0.01)) == [
        f"d.hinge is sent to -0.01, outside of its limits {hint}",
        f"d.hinge is sent to 2.01, outside of its limits {hint}",
    ]


def test_a_joint_without_room_may_only_be_held(robile):
    stuck = with_limits(scene_with(FREE), 0.0, 0.0)
    assert messages(robile, stuck, TASK, Hold("d.hinge", 0.0)) == []
    no_room = "d.hinge is to move, but its limits leave no room"
    for told in (
        frames("d.hinge", 0.0),
        Trigger("d.hinge", 0.0, 0.0, 9.0, Servo()),
        Reaction("d.hinge", 0.0, 0.0, LegBegins(1), Jump()),
    ):
        assert messages(robile, stuck, TASK, told) == [no_room]
    little = with_limits(scene_with(FREE), 0.0, 1e-6)
    assert messages(robile, little, TASK, frames("d.hinge", 0.0)) == []


@pytest.mark.parametrize("joint", ["x", "y", "yaw"])
def test_the_joints_of_a_mover_are_walked(robile, joint):
    scene = scene_with(PERSON)
    told = (frames(f"v.{joint}", 0.0),)
    assert messages(robile, scene, TASK, *told) == [f"v.{joint} belongs to a mover (let v walk)"]
    assert messages(robile, scene, TASK, Hold(f"v.{joint}", 0.0)) == []


def test_a_joint_has_one_behaviour(robile):
    twice = (frames("d.hinge", 0.0), Hold("d.hinge", 0.0))
    assert messages(robile, scene_with(FREE), TASK, *twice) == [
        "d.hinge has two behaviours (one must go)"
    ]


def test_only_a_door_in_a_doorway_measures_from_it(robile):
    text = (
        "d.hinge measures from its doorway, but d stands in none (measure from its hinge or leaf)"
    )
    for of, found in (("doorway", [text]), ("hinge", [])):
        trigger = Trigger("d.hinge", 0.0, 1.0, 9.0, Servo(), of)
        assert messages(robile, scene_with(FREE), TASK, trigger) == found
    inside = Trigger("d.hinge", 0.0, 1.0, 9.0, Servo(), "doorway")
    assert messages(robile, scene_with(DOOR), TASK, inside) == []


def test_a_leaf_sweeps_from_its_least_to_its_greatest_angle(robile):
    # The leaf, 0.94 m long, opens into the kitchen from (0.05, 2.4), away from the doorway.
    scene = scene_with(DOOR)
    task = mission((0.4, 3.1))
    over = ["? d sweeps over waypoint w0 (the robot may be hit there)"]
    angle = 0.55  # where the leaf covers it, seen from the closed leaf
    swept = [
        messages(robile, scene, task, frames("d.hinge", *angles)) == over
        for angles in ((0.0, 2.0), (2.0, 0.0), (0.0, 2.0, 1.9), (angle + 0.7, 2.0), (0.0, angle))
    ]
    assert swept == [True, True, True, False, False]
    # Told to stay elsewhere than the scene has it, it sweeps nothing in between.
    assert messages(robile, scene, task, frames("d.hinge", 1.9, 2.0)) == []


def test_leaves_that_are_told_to_meet_are_found(robile):
    scene = scene_with(DOOR + "e is a hinged_door at kitchen, x 0.2 m, y -0.9 m")
    meet = "? d and e can run into each other as they are told to move (the other one: task.yaml)"
    far = mission((3, 0))
    told = (frames("d.hinge", 0.0, 2.0), frames("e.hinge", 0.0, 2.0))
    assert messages(robile, scene, far, *told) == [meet]
    assert messages(robile, scene, far, frames("d.hinge", 0.0, 0.1)) == []
