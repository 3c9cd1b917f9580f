"""The pre-flight of scenes and runs that no text says; test_findings.py has the others."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import (
    Hold,
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Spring,
    Trigger,
    Walk,
)
from grammars.model.free_space import inscribed_radius
from grammars.model.geometry import Pose2
from grammars.preflight import check_limit, check_run, check_scene, places_of
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Where
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import (
    DOOR,
    OTHER,
    PERSON,
    ROBILE,
    messages,
    mission,
    scene_with,
    shown,
)

TASK = mission((3, 0), (4, 0))
FREE = "d is a hinged_door at kitchen\n"
PLACE = Where("campaign.yaml", 4, 1)
LEAF = """
object some
    link leaf  box {width} m x 4 cm at ({middle} m, 0 m) from 1 cm to 1.95 m, mass 15 kg
    joint hinge revolute from world to leaf at (0 m, 0 m), between 0 deg and 100 deg
    state closed: hinge 0 deg
l is a some in kitchen_doorway, hinge left, opening into kitchen
"""
BLOCK = "object block link body box 0.5 m x 0.5 m from 0 m to 1 m, mass 5 kg\n"


def found(scene):
    return [d.message for d in check_scene(scene)]


def frames(joint, *positions):
    return KeyFrames(joint, tuple(KeyFrame(float(i), q) for i, q in enumerate(positions)), Jump())


@given(st.floats(0.2, 0.99))
def test_a_gap_beside_a_leaf_is_reported_when_it_is_more_than_a_fifth(width):
    width = round(width, 3)
    gap = f"l closes {width:.2f} m of kitchen_doorway, which is 1.00 m wide"
    scene = scene_with(LEAF.format(width=width, middle=width / 2))
    assert [text.partition(":")[0] for text in found(scene)] == [gap] * (width < 0.8)


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_blocks_stand_in_each_other_where_their_outlines_do(x, y):
    x, y = round(x, 2), round(y, 2)
    text = f"{BLOCK}a is a block in hall, x 0 m\nb is a block in hall, x {x} m, y {y} m"
    depth = min(0.5 - abs(x), 0.5 - abs(y))
    # A strip of 2 cm is taken for touching: no more than 1 cm of it lies within its outline.
    if abs(depth - 0.02) > 1e-6:
        inside = [text for text in found(scene_with(text)) if "run into" not in text]
        assert bool(inside) is (depth > 0.02)


def test_objects_have_names_of_their_own_and_joints_start_within_their_limits():
    scene = scene_with(FREE)
    (body,) = scene.objects
    twice = dataclasses.replace(scene, objects=(body, body))
    assert 'there are two objects called "d"' in found(twice)
    for initial, outside in ((0.0, 0), (2.0, 0), (-1e-6, 1), (2.000001, 1)):
        moved = dataclasses.replace(body, initial=(initial,))
        texts = found(dataclasses.replace(scene, objects=(moved,)))
        message = f"d.hinge starts at {initial:g}, outside of its limits"
        assert [text for text in texts if "limits" in text] == [message] * outside


def test_findings_are_where_their_object_or_waypoint_was_written():
    doors = layer("d is a hinged_door at hall.walls[0], x -3 m, y 0.1 m, turned -90 deg")
    scene = compile_scene(two_rooms(), [doors])
    places = places_of([doors], two_rooms())
    assert {"d", "kitchen_doorway", "way_out"} <= set(places)
    assert [d.where for d in check_scene(scene, places=places)] == [places["d"]]
    assert [d.where for d in check_scene(scene)] == [Where(scene.name)]
    assert [d.where for d in check_scene(scene, places={"e": places["d"]})] == [Where(scene.name)]
    (outside,) = check_run(scene_with(DOOR), ROBILE, mission((20, 0)), (), places={"w0": PLACE})
    assert outside.where == PLACE


def test_a_robot_fits_under_a_lintel_by_its_height_and_through_a_gap_by_its_narrow_side():
    tall = dataclasses.replace(ROBILE, height=2.1)
    (message,) = messages("", mission((0.5, 2.2)), robot=tall)
    assert message.startswith("waypoint w0 is inside of ")
    narrow = ((0.3, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.3, -0.2))
    assert inscribed_radius(narrow) == pytest.approx(0.2)


def test_a_frozen_joint_may_only_be_held_where_it_is():
    frozen = FREE.replace("\n", ", frozen")
    moves = "d.hinge is to move, but d is frozen (leave out frozen, or the behaviour)"
    assert messages(frozen, TASK, Hold("d.hinge", 0.0)) == []
    assert messages(frozen, TASK, Hold("d.hinge", 0.1)) == [moves]
    assert messages(frozen, TASK, frames("d.hinge", 0.0)) == [moves]


def test_the_limits_themselves_are_allowed():
    assert messages(FREE, TASK, frames("d.hinge", 0.0, 2.0)) == []
    outside = "outside of its limits (between 0 and 2)"
    assert messages(FREE, TASK, frames("d.hinge", -0.01, 1.0, 2.01, -0.01)) == [
        f"d.hinge is sent to -0.01, {outside}",
        f"d.hinge is sent to 2.01, {outside}",
    ]
    assert messages(FREE, TASK, Hold("d.hinge", 2.5)) == [f"d.hinge is sent to 2.5, {outside}"]


def with_limits(scene, lower, upper):
    (body,) = scene.objects
    joint = dataclasses.replace(body.joints[0], lower=lower, upper=upper)
    changed = dataclasses.replace(body, joints=(joint,), initial=(0.0,))
    return dataclasses.replace(scene, objects=(changed,))


def test_a_joint_without_room_may_only_be_held():
    stuck = with_limits(scene_with(FREE), 0.0, 0.0)
    assert messages(stuck, TASK, Hold("d.hinge", 0.0)) == []
    for told in (
        frames("d.hinge", 0.0),
        Trigger("d.hinge", 0.0, 0.0, 9.0, Servo()),
        Reaction("d.hinge", 0.0, 0.0, LegBegins(1), Jump()),
    ):
        no_room = "d.hinge is to move, but its limits leave no room"
        assert messages(stuck, TASK, told) == [no_room]
    little = with_limits(scene_with(FREE), 0.0, 1e-6)
    assert messages(little, TASK, frames("d.hinge", 0.0)) == []


@pytest.mark.parametrize("joint", ["x", "y", "yaw"])
def test_the_joints_of_a_mover_are_walked(joint):
    belongs = f"v.{joint} belongs to a mover (let v walk)"
    assert messages(PERSON, TASK, frames(f"v.{joint}", 0.0)) == [belongs]
    assert messages(PERSON, TASK, Hold(f"v.{joint}", 0.0)) == []


LINE = ((0.0, 0.0), (1.0, 0.0))
WALK = Walk("v", LINE, 1.0)
HELD = Hold("d.hinge", 0.0)


@pytest.mark.parametrize(
    ("objects", "behaviours", "expected"),
    [
        (FREE, [frames("d.hinge", 0.0), HELD], ["d.hinge has two behaviours (one must go)"]),
        (PERSON, [Hold("v.x", 0.0), WALK], ["v has two behaviours (one must go)"]),
        (PERSON, [WALK, WALK], ["v has two behaviours (one must go)"]),
        (
            FREE,
            [Hold("d.hing", 0.0)],
            ['there is no joint "d.hing" in the scene (did you mean "d.hinge"?)'],
        ),
        (FREE, [Walk("d", LINE, 1.0)], ["d cannot walk, it is an object, not a mover"]),
        (FREE, [WALK], ['there is no object "v" (known here: d)']),
    ],
)
def test_a_joint_or_mover_that_is_there_has_one_behaviour(objects, behaviours, expected):
    assert messages(objects, TASK, *behaviours)[: len(expected)] == expected


def test_only_a_door_in_a_doorway_measures_from_it():
    none = "d.hinge measures from its doorway, but d stands in none"
    for objects, of, expected in (
        (FREE, "doorway", [f"{none} (measure from its hinge or leaf)"]),
        (FREE, "hinge", []),
        (DOOR, "doorway", []),
    ):
        trigger = Trigger("d.hinge", 0.0, 1.0, 9.0, Servo(), of)
        assert messages(objects, TASK, trigger) == expected


def test_events_name_legs_and_joints_that_are_there_and_one_joint_that_acts_is_enough():
    def reacting(event, *others):
        return messages(DOOR + OTHER, TASK, Reaction("d.hinge", 1.5, 0.0, event, Jump()), *others)

    legs = "there is no leg 0, mission m has 2 (legs are counted from 1)"
    assert reacting(LegBegins(0)) == [legs]
    assert reacting(JointActs(("e.hinge", "e.hing"), "moves")) == [
        'there is no joint "e.hing" in the scene (did you mean "e.hinge"?)'
    ]
    fires = Trigger("e.hinge", -1.5, 0.0, 9.0, Servo())
    assert reacting(JointActs(("e.hinge", "d.hinge"), "fires"), fires) == []


def limit_messages(limit, **speeds):
    # 3 m and 4 m, of which half a metre less at the first waypoint and twice half a metre then.
    findings = check_limit(mission((3.0, 0.0), (3.0, 4.0)), speeds, limit=limit, where=PLACE)
    assert all(d.where == PLACE for d in findings)
    return shown(findings)


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_a_limit_is_too_short_for_straight_ways_at_top_speed(speed):
    assert limit_messages(5.5 / speed, pilot=speed) == []
    (message,) = limit_messages(5.4 / speed, pilot=speed)
    assert message.startswith(f"? {5.4 / speed:g} s are too short for mission m: it takes pilot")
    assert f"{5.5 / speed:.1f} s for 5.5 m at {speed:.2f} m/s" in message


def test_each_system_that_is_too_slow_is_named():
    (message,) = limit_messages(5.0, slow=0.5, quick=2.0, walking=1.0)
    assert "slow at least 11.0 s" in message
    assert "walking at least 5.5 s" in message
    assert "quick" not in message
    assert limit_messages(0.1, pilot=math.inf) == limit_messages(0.1) == []
    # Waypoints side by side take no time.
    near = mission((0.4, 0.0), (0.4, 0.9))
    assert check_limit(near, {"pilot": 0.1}, limit=0.0, where=PLACE) == ()


coordinates = st.floats(-9, 9)
positions = st.floats(-4, 4)
motions = st.sampled_from([Jump(), Spring()])
key_frames = st.lists(st.builds(KeyFrame, st.floats(0, 99), positions), min_size=1, max_size=4)
joints = st.sampled_from(["d.hinge", "e.rail", "f.left", "f.right", "g.h"])
origins = st.sampled_from(["hinge", "foot", "leaf", "doorway"])
scripts = st.one_of(
    st.builds(Hold, joints, positions),
    st.builds(KeyFrames, joints, key_frames.map(tuple), motions),
    st.builds(Trigger, joints, positions, positions, st.floats(0.1, 5), motions, origins),
)
CROWDED = f"{DOOR}e is a slider in way_out, sliding left\nf is a lift_door at hall, x 2 m, frozen"


@given(
    st.lists(st.tuples(coordinates, coordinates), max_size=4),
    st.builds(Pose2, coordinates, coordinates, coordinates),
    st.lists(scripts, max_size=4),
)
def test_any_mission_and_any_behaviours_are_checked(points, start, behaviours):
    task = mission(*points, start=start)
    findings = check_run(scene_with(CROWDED), ROBILE, task, behaviours, where=PLACE)
    assert all(d.message for d in findings)
    assert len(set(findings)) == len(findings)
