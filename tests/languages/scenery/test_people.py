"""Movers, reactions, waiting times, fixed joints and furniture in the scenery language."""

import math

import pytest

from grammars.model.geometry import Pose2
from grammars.model.kinematics import link_poses
from grammars.model.movers import is_mover
from grammars.model.scene import SceneObject
from grammars.scenery import parse_scenery
from grammars.scenery.measure import Measure
from grammars.scenery.model import (
    Alternates,
    At,
    OnLeg,
    OnObject,
    OnWaypoint,
    Reacts,
    Walks,
)
from tests.languages.scenery.samples import DOOR, PEOPLE


def said(text):
    (sentence,) = parse_scenery(text, "s.scenery").sentences
    return sentence


def test_a_mover_hangs_on_a_planar_chain():
    person = parse_scenery(PEOPLE, "p.scenery").models[0]
    assert is_mover(person.joints)
    assert [(j.name, j.kind, j.parent, j.child) for j in person.joints] == [
        ("x", "prismatic", "world", "x_carrier"),
        ("y", "prismatic", "x_carrier", "y_carrier"),
        ("yaw", "revolute", "y_carrier", "body"),
        ("neck", "prismatic", "body", "hat"),
    ]
    assert all(link.polygons == () and link.mass == 0.0 for link in person.links[:2])
    at = SceneObject("p", "p", Pose2(1, 2, math.pi / 2), person.links, person.joints, (0,) * 4)
    poses = link_poses(at, (3.0, 4.0, 0.5, 0.0))
    assert poses["hat"] == poses["body"]
    body = poses["body"]
    assert (body.x, body.y, body.yaw) == pytest.approx((-3.0, 5.0, math.pi / 2 + 0.5))


def test_an_object_is_no_mover():
    assert not is_mover(parse_scenery(DOOR, "d.scenery").models[0].joints)


def test_a_fixed_joint_leaves_no_room():
    table = parse_scenery(PEOPLE, "p.scenery").models[1]
    (glue,) = table.joints
    assert (glue.parent, glue.child, glue.lower, glue.upper) == ("top", "foot", 0.0, 0.0)


def test_furniture_stands_in_a_space():
    table = parse_scenery(PEOPLE, "p.scenery").instances[1]
    assert isinstance(table.place, At)
    assert table.place.inside
    assert str(table.place.frame) == "kitchen"
    assert (table.place.x, table.place.y) == (1.0, 0.5)
    assert table.place.yaw == pytest.approx(math.radians(30))


def test_a_walk_has_a_route_a_pace_and_manners():
    walk = parse_scenery(PEOPLE, "p.scenery").sentences[0]
    assert isinstance(walk, Walks)
    assert [(str(p.frame), p.x, p.y) for p in walk.route] == [
        ("hall", 1.0, 0.0),
        ("hall", 3.0, 0.0),
    ]
    assert (walk.manner, walk.everywhere, walk.facing) == ("back-and-forth", False, "ahead")
    assert str(walk.speed) == "0.8 m/s"
    assert str(walk.pause) == "2 s"
    assert str(walk.yielding) == "1 m"


def test_points_are_in_the_frame_named_next():
    walk = said("v walks along (1 m, 0 m), (2 m, 0 m) of a, (3 m, 0 m) of b.walls[2], once")
    assert isinstance(walk, Walks)
    assert [str(p.frame) for p in walk.route] == ["a", "a", "b.walls[2]"]
    walk = said("v walks along (1 m, 0 m), (2 m, 0 m)")
    assert isinstance(walk, Walks)
    assert [str(p.frame) for p in walk.route] == ["world", "world"]


@pytest.mark.parametrize(
    ("words", "facing"), [("facing ahead", "ahead"), ("facing sideways", "sideways")]
)
def test_a_mover_faces_some_way(words, facing):
    walk = said(f"v walks along (1 m, 0 m), (2 m, 0 m), {words}, not yielding")
    assert isinstance(walk, Walks)
    assert walk.facing == facing


def test_a_mover_may_face_an_angle_and_accelerate_as_told():
    walk = said("v walks along (1 m, 0 m), (2 m, 0 m), facing 30 deg, accelerating at 50 cm/s^2")
    assert isinstance(walk, Walks)
    assert isinstance(walk.facing, Measure)
    assert isinstance(walk.acceleration, Measure)
    assert walk.acceleration.value == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ("leg 2 begins", OnLeg),
        ("waypoint kitchen is reached", OnWaypoint),
        ("waypoint living-room-2 is reached", OnWaypoint),
        ('waypoint "3 m from here" is reached', OnWaypoint),
        ("door_1 fires", OnObject),
        ("door_1.hinge starts to move", OnObject),
    ],
)
def test_events_are_read(words, kind):
    sentence = said(f"d goes from open to closed when {words}, after 2 s, by jump")
    assert isinstance(sentence, Reacts)
    assert isinstance(sentence.occasion, kind)
    assert str(sentence.after) == "2 s"
    walk = said(f"v walks along (1 m, 0 m), (2 m, 0 m), when {words}")
    assert isinstance(walk, Walks)
    assert walk.occasion == sentence.occasion


def test_names_of_waypoints_may_have_dashes_and_blanks():
    for written, name in (("a-1", "a-1"), ('"the 2nd, 3 m on"', "the 2nd, 3 m on"), ("7", "7")):
        sentence = said(f"d goes from open to closed when waypoint {written} is reached")
        assert isinstance(sentence, Reacts)
        assert isinstance(sentence.occasion, OnWaypoint)
        assert sentence.occasion.waypoint == name


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ("uniform 10 s to 40 s", "uniform"),
        ("exponential with mean 20 s", "exponential"),
        ("normal with mean 20 s, deviation 5 s", "normal"),
    ],
)
def test_waiting_times_have_a_distribution(words, kind):
    sentence = said(f"d toggles between open and closed after {words}, from 1 min until 5 min")
    assert isinstance(sentence, Alternates)
    assert sentence.waiting.kind == kind
    assert str(sentence.since) == "1 min"
