"""Binding to a scene: the doors an oracle speaks of must be there."""

from dataclasses import replace

import pytest

from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.movers import with_planar_chain
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject, Solid
from grammars.oracle import (
    check_joint_limits,
    check_references,
    object_signals,
    parse_oracle,
)
from grammars.text.diagnostics import InputError, Where


def leaf(name):
    return Link(name, (((0.0, 0.0), (1.0, 0.0), (1.0, 0.1)),), 10.0, 0.0, 2.0)


def hinge(name, child, kind="revolute"):
    return Joint(name, kind, "world", child, (0.0, 0.0), (1.0, 0.0), -2.0, 2.0)


def thing(name, *joints):
    links = tuple(leaf(joint.child) for joint in joints)
    return SceneObject(name, "thing", Pose2(), links, joints, (0.0,) * len(joints))


SCENE = Scene(
    "hall",
    (),
    (),
    (Solid("wall-3", "wall", ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1)), 0.0, 2.7),),
    (
        thing("door-17", hinge("hinge", "leaf")),
        thing("gate", hinge("left", "a", "prismatic"), hinge("right", "b", "prismatic")),
    ),
)
SOMEWHERE = Mission("m", Pose2(), (Waypoint("a", 1.0, 0.0),))


def findings(text, mission=SOMEWHERE, scene=SCENE):
    oracle = parse_oracle("it", text, Where("o.yaml", 1, 1))
    return [str(d) for d in check_references(oracle, scene, mission)]


@pytest.mark.parametrize(
    "name",
    [
        "door-17.angle",
        "door-17.hinge.angle",
        "door-17.distance",
        "gate.left.position",
        "gate.right.distance",
    ],
)
def test_joints_have_signals(name):
    assert name in object_signals(SCENE)
    assert findings(f"max({name})") == []


@pytest.mark.parametrize("name", ["door-17", "door-17.leaf", "gate", "wall-3"])
def test_clearance_and_contact_can_be_about_one_thing(name):
    assert findings(f"never(contact({name}) or clearance({name}) < 1 m)") == []


PLACES = replace(
    SCENE,
    regions=(Region("kitchen", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))),),
    doorways=(Doorway("way", Pose2(), ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1)), 1.0, 0.0, 2.0),),
)


@pytest.mark.parametrize("name", ["door-17", "door-17.leaf", "gate", "wall-3", "kitchen", "way"])
def test_the_robot_can_be_related_to_things_and_places(name):
    assert findings(f"max(distance(robot, {name}))", scene=PLACES) == []
    inside = findings(f"never(in(robot, {name}))", scene=PLACES)
    assert bool(inside) is (name not in ("kitchen", "way"))


ROUND = Mission("round", Pose2(), tuple(Waypoint(i, 1.0, 0.0) for i in ("a", "kitchen", "a")))


@pytest.mark.parametrize(
    ("leg", "complaint"),
    [
        ("3", ""),
        ("kitchen", ""),
        ("4", 'no leg 4 in mission "round": it has 3 waypoints'),
        ("0", "no leg 0"),
        ("kitchn", 'no waypoint "kitchn" in mission "round": did you mean "kitchen"?'),
        ("a", 'legs 1 and 3 lead to "a": write the number of one'),
    ],
)
def test_a_leg_must_be_one_of_the_mission(leg, complaint):
    found = findings(f"never(contact) on leg {leg}", ROUND)
    assert len(found) == (1 if complaint else 0)
    assert all(complaint in text for text in found)


def test_reaching_an_empty_mission_is_no_requirement():
    assert findings("reached(mission, 1 m)") == []
    assert len(findings("reached(mission, 1 m)", Mission("none", Pose2(), ()))) == 1


def test_signals_are_listed_wherever_they_stand():
    text = "always(abs(loc.error.x) < 1 m or not contact) when speed / elapsed > 0 m/s^2"
    oracle = parse_oracle("it", text, Where("o.yaml"))
    assert [s.name for s in oracle.signals()] == ["loc.error.x", "contact", "speed", "elapsed"]


LINKS, JOINTS = with_planar_chain((leaf("body"),), (), "body")
VISITED = replace(
    SCENE, objects=(SceneObject("visitor", "person", Pose2(), LINKS, JOINTS, (0.0,) * 3),)
)


@pytest.mark.parametrize("name", ["visitor.x", "visitor.y", "visitor.yaw"])
def test_where_a_mover_is_has_a_name(name):
    with pytest.raises(InputError, match=r"distance\(robot, visitor\); visitor\.x\.position"):
        findings(f"max({name})")
    assert findings("max(visitor.x.position + visitor.y.position)", scene=VISITED) == []
    assert findings("max(visitor.yaw.angle)", scene=VISITED) == []


def limits(text, *, mirrored):
    joint = replace(hinge("hinge", "leaf"), lower=-1.9 * mirrored, upper=1.9 * (not mirrored))
    scene = replace(SCENE, objects=(replace(thing("door-17", joint), mirrored=mirrored),))
    oracle = parse_oracle("it", text, Where("o.yaml", 1, 1))
    return [str(d) for d in check_joint_limits(oracle, scene)]


@pytest.mark.parametrize(
    "text",
    [
        "eventually(door-17.angle >= 80 deg)",
        "eventually(not (80 deg < door-17.hinge.angle))",
        "max(door-17.angle) >= 80 deg",
        "never(contact) when door-17.angle >= 80 deg",
        "never(contact) until (-door-17.angle < -80 deg)",
    ],
)
def test_what_a_mirrored_door_cannot_come_to_is_warned_of(text):
    assert limits(text, mirrored=False) == []
    (found,) = limits(text, mirrored=True)
    assert "warning: " in found
    assert "can never hold: door-17." in found
    assert "goes from -108.9 deg to 0 deg" in found
    assert "write abs(door-17." in found


@pytest.mark.parametrize(
    "text",
    [
        "eventually(abs(door-17.angle) >= 80 deg)",
        "eventually(door-17.angle <= 80 deg)",
        "max(door-17.angle)",
        "always(door-17.distance >= 80 m)",
        "always(door-17.angle >= 2 deg)",
        "always(door-17.angle + door-17.angle >= 80 deg)",
        "always(1 m >= 2 m or door-71.angle > 5 rad)",
    ],
)
def test_what_may_hold_is_not_warned_of(text):
    assert limits(text, mirrored=True) == []


def test_a_door_that_is_no_mirror_image_has_limits_too():
    assert limits("eventually(abs(door-17.angle) > 110 deg)", mirrored=False) == []
    (found,) = limits("eventually(abs(door-17.angle) > 130 deg)", mirrored=False)
    assert "abs(door-17.angle) > 130 deg can never hold: door-17.angle goes from 0 deg" in found
    assert "mirror" not in found
