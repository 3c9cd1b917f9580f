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
    ROBILE,
    messages,
    mission,
    scene_with,
    shown,
)

TASK = mission((3, 0), (4, 0))
FREE = "d is a hinged_door at kitchen\n"
PLACE = Where("campaign.yaml", 4, 1)


def frames(joint, *positions):
    return KeyFrames(joint, tuple(KeyFrame(float(i), q) for i, q in enumerate(positions)), Jump())


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
    assert message.startswith("waypoint w0 is inside ")
    narrow = ((0.3, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.3, -0.2))
    assert inscribed_radius(narrow) == pytest.approx(0.2)


def with_limits(scene, lower, upper):
    (body,) = scene.objects
    joint = dataclasses.replace(body.joints[0], lower=lower, upper=upper)
    changed = dataclasses.replace(body, joints=(joint,), initial=(0.0,))
    return dataclasses.replace(scene, objects=(changed,))


HELD, ASIDE = Hold("d.hinge", 0.0), Hold("d.hinge", 0.1)
STUCK = with_limits(scene_with(FREE), 0.0, 0.0)
FROZEN = FREE.replace("\n", ", frozen")
FROM_DOORWAY = Trigger("d.hinge", 0.0, 1.0, 9.0, Servo(), "doorway")
FIRES = Trigger("e.hinge", -1.5, 0.0, 9.0, Servo())


def reaction(event, to=1.5):
    return Reaction("d.hinge", to, 0.0, event, Jump())


BEHAVIOURS = {
    "a frozen joint is held where it is": (FROZEN, [HELD]),
    "a frozen joint is held elsewhere": (FROZEN, [ASIDE]),
    "a frozen joint moves": (FROZEN, [frames("d.hinge", 0.0)]),
    "a joint without room is held": (STUCK, [HELD]),
    "a joint without room moves": (STUCK, [frames("d.hinge", 0.0)]),
    "a joint without room is triggered": (STUCK, [Trigger("d.hinge", 0, 0, 9, Servo())]),
    "a joint without room reacts": (STUCK, [reaction(LegBegins(1), 0.0)]),
    "a joint with little room moves": (
        with_limits(scene_with(FREE), 0.0, 1e-6), [frames("d.hinge", 0.0)]),
    "a door in a doorway measures from it": (DOOR, [FROM_DOORWAY]),
    "a leg that is not there": (DOOR + OTHER, [reaction(LegBegins(0))]),
    "one of two joints acts": (
        DOOR + OTHER, [reaction(JointActs(("e.hinge", "d.hinge"), "fires")), FIRES]),
}  # fmt: skip


def test_behaviours_fit_the_joints_that_are_there(golden):
    lines = []
    for name, (objects, behaviours) in BEHAVIOURS.items():
        lines += [f"--- {name}", *(messages(objects, TASK, *behaviours) or ["nothing"])]
    golden("behaviours.txt", "\n".join(lines) + "\n")


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
    stay = mission((3.0, 0.0))
    stay = dataclasses.replace(stay, waypoints=(dataclasses.replace(stay.waypoints[0], wait=60.0),))
    (late,) = check_limit(stay, {"pilot": 1.0}, limit=62.0, where=PLACE)
    assert "pilot at least 62.5 s for 2.5 m at 1.00 m/s and 60 s of waiting" in late.message
    # Waypoints side by side take no time.
    near = mission((0.4, 0.0), (0.4, 0.9))
    assert check_limit(near, {"pilot": 0.1}, limit=0.0, where=PLACE) == ()


coordinates = st.floats(-9, 9)
positions = st.floats(-4, 4)
motions = st.sampled_from([Jump(), Spring()])
key_frames = st.lists(st.builds(KeyFrame, st.floats(0, 99), positions), min_size=1, max_size=4)
joints = st.sampled_from(["d.hinge", "e.rail", "f.left", "f.right"])
origins = st.sampled_from(["hinge", "foot", "leaf"])
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
