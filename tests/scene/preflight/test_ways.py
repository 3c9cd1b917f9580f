"""Where the robot is sent: spots, ways between them, doors on the way, and the time it takes."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Spring, Trigger, Walk
from grammars.model.free_space import inscribed_radius
from grammars.model.geometry import Pose2
from grammars.preflight import check_limit, check_run
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Where
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import DOOR, PERSON, ROBILE, messages, mission, scene_with

KITCHEN = mission((0.5, 4))


def other_doorway(width, x):
    """Return the words that give the rooms a second doorway between them."""
    return (
        "Entryway way_out:",
        f"Entryway other: shape: Rectangle width={width}, height=2 m location: in: hall.walls[0] "
        f"and kitchen.walls[2] translation: x: {x}, z: 1 m\nEntryway way_out:",
    )


def doorway(width):
    return "width=1 m, height=2 m", f"width={width}, height=2 m"


def test_a_spot_may_be_half_a_width_from_a_wall():
    assert messages(DOOR, mission((3, 1.767), (-3, -1.767))) == []
    assert messages(DOOR, mission((3, 1.78))) == [
        "waypoint w0 is 0.22 m from hall-wall-0, robile needs 0.23 m "
        "(move it 0.01 m away from the wall)"
    ]
    narrow = ((0.3, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.3, -0.2))
    assert inscribed_radius(narrow) == pytest.approx(0.2)


def test_a_spot_may_be_in_a_doorway_under_its_lintel():
    under = mission((0.5, 2.2))
    assert messages("", under) == []
    (message,) = messages("", under, robot=dataclasses.replace(ROBILE, height=2.1))
    assert message.startswith("waypoint w0 is inside of ")


@pytest.mark.parametrize(
    ("x", "yaw", "hits"),
    [(4.65, 0.0, 0), (4.6505, 0.0, 0), (4.66, 0.0, 1), (4.7, 0.0, 1), (4.7, math.pi / 2, 0)],
)
def test_a_start_that_touches_a_wall_does_not_stand_in_it(x, yaw, hits):
    text = "at the start robile stands in hall-wall-1 (move or turn the start)"
    assert messages(DOOR, mission((3, 0), start=Pose2(x, 0.0, yaw))) == [text] * hits


def test_places_of_waypoints_are_used():
    where = Where("task.yaml", 7, 5)
    (found,) = check_run(scene_with(DOOR), ROBILE, mission((20, 0)), (), places={"w0": where})
    assert found.where == where


def test_posts_make_a_doorway_narrower():
    half = two_rooms(doorway("0.5 m"))
    assert messages(compile_scene(half), mission((0, 4))) == []
    narrow = (
        "object narrow_door link post box 5 cm x 5 cm from 0 m to 1.9 m, mass 100 kg\n"
        "link leaf box 5 cm x 0.4 m at (0 m, 0.25 m) from 0 m to 1.9 m, mass 20 kg\n"
        "joint hinge revolute from post to leaf at (-0.025 m, 0.025 m), between 0 rad and 2 rad\n"
        "d is a narrow_door in kitchen_doorway, hinge left, opening into kitchen"
    )
    assert messages(compile_scene(half, [layer(narrow)]), mission((0, 4))) == [
        "the way to waypoint w0 leads through kitchen_doorway (0.45 m), robile is 0.47 m wide "
        "(widen the doorway or take a narrower robot)"
    ]
    # A post in another doorway takes nothing from this one, and a way around is enough.
    beside = layer("d is a hinged_door in way_out, hinge left, opening inwards")
    assert messages(compile_scene(half, [beside]), mission((0, 4))) == []
    around = two_rooms(doorway("0.4 m"), other_doorway("0.9 m", "-1 m"))
    assert messages(compile_scene(around), mission((0, 4))) == []


STAY = "stays as told (fine if that is what is tested)"


def test_each_door_that_would_let_the_robot_through_is_named():
    two = two_rooms(other_doorway("1 m", "-1.2 m"))
    both = DOOR + DOOR.replace("d is", "e is").replace("kitchen_doorway", "other")
    scene = compile_scene(two, [layer(both)])
    shut = (Hold("d.hinge", 0.0), Hold("e.hinge", 0.0))
    cannot = f"? waypoint w0 cannot be reached while d or e {STAY}"
    assert messages(scene, KITCHEN, *shut) == [cannot]
    assert messages(scene, KITCHEN, shut[0]) == []
    assert messages(scene, KITCHEN, shut[0], Hold("e.hinge", 1.9)) == []
    behind = messages(scene, mission((0.5, 4), (3, 0), (-0.5, 4)), *shut)
    assert [text.split(" cannot")[0] for text in behind] == ["? waypoint w0", "? waypoint w2"]


@pytest.mark.parametrize(
    ("names", "words"), [("de", "d and e stay"), ("defgh", "d, e, f and 2 more stay")]
)
def test_doors_that_block_together_are_not_blamed_one_by_one(names, words):
    doors = "".join(DOOR.replace("d is", f"{n} is").strip() + ", frozen\n" for n in names)
    (message,) = messages(doors, KITCHEN)
    assert message.startswith(f"? waypoint w0 cannot be reached while {words} as told")


def test_only_what_stays_in_the_way_of_the_robot_blocks():
    lift = "l is a lift_door in kitchen_doorway"
    both = (Hold("l.left", 0.0), Hold("l.right", 0.0))
    cannot = f"? waypoint w0 cannot be reached while l {STAY}"
    assert messages(lift, KITCHEN, *both) == [cannot]
    assert messages(lift, KITCHEN, both[0]) == []
    # A door that can open is no obstacle.
    upper = scene_with(DOOR).objects[0].joints[0].lower
    moving = KeyFrames("d.hinge", (KeyFrame(0, 0.0), KeyFrame(5, upper)), Jump())
    assert messages(DOOR, KITCHEN) == []
    assert not any("cannot" in text for text in messages(DOOR, KITCHEN, moving))
    for low, blocked in (("0.28 m", True), ("0.289 m", False), ("0.3 m", False)):
        gate = (
            f"object gate link leaf box 1 m x 4 cm from {low} to 2 m, mass 9 kg\n"
            "joint rail prismatic from world to leaf along x, between 0 m and 1 m\n"
            "g is a gate in kitchen_doorway, frozen"
        )
        assert bool(messages(gate, KITCHEN)) is blocked


def test_a_mover_at_rest_may_be_in_the_way():
    person = PERSON.replace("in hall, x -4 m", "in kitchen, x 0.5 m, y -1.7 m")
    (message,) = messages(person, KITCHEN)
    assert message.startswith("? waypoint w0 cannot be reached while v stands in the way")
    assert messages(person, KITCHEN, Walk("v", ((0.5, 2.2), (0.5, 4.0)), 1.0)) == []


@pytest.mark.parametrize(("gap", "passes"), [(0.45, False), (0.48, True)])
def test_a_gap_lets_through_what_is_narrower(gap, passes):
    # A column across the kitchen, 4 m wide, leaves the gap at its east end.
    pinched = two_rooms(
        ("Rectangle width=0.3 m, length=0.3 m", f"Rectangle width={4 - gap} m, length=0.1 m"),
        ("translation: x: 1 m, y: 0.5 m", f"translation: x: {-gap / 2} m, y: 0.5 m"),
    )
    too_narrow = (
        "the way to waypoint w0 is too narrow, robile is 0.47 m wide "
        "(look for columns or walls that stand close to each other)"
    )
    found = messages(compile_scene(pinched), mission((0, 5)))
    assert found == ([] if passes else [too_narrow])


PLACE = Where("campaign.yaml", 4, 1)


def limit_messages(limit, **speeds):
    # 3 m and 4 m, of which half a metre less at the first waypoint and twice half a metre then.
    task = mission((3.0, 0.0), (3.0, 4.0))
    found = check_limit(task, speeds, limit=limit, where=PLACE)
    assert all((d.where, d.severity) == (PLACE, "warning") for d in found)
    return [d.message for d in found]


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_a_limit_is_too_short_for_straight_ways_at_top_speed(speed):
    assert limit_messages(5.5 / speed, pilot=speed) == []
    (message,) = limit_messages(5.4 / speed, pilot=speed)
    assert message.startswith(f"{5.4 / speed:g} s are too short for mission m: it takes pilot")
    assert message.endswith(f"{5.5 / speed:.1f} s for 5.5 m at {speed:.2f} m/s")


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
frames = st.lists(st.builds(KeyFrame, st.floats(0, 99), positions), min_size=1, max_size=4)
joints = st.sampled_from(["d.hinge", "e.rail", "f.left", "f.right", "g.h"])
origins = st.sampled_from(["hinge", "foot", "leaf", "doorway"])
behaviours = st.one_of(
    st.builds(Hold, joints, positions),
    st.builds(KeyFrames, joints, frames.map(tuple), motions),
    st.builds(Trigger, joints, positions, positions, st.floats(0.1, 5), motions, origins),
)
CROWDED = f"{DOOR}e is a slider in way_out, sliding left\nf is a lift_door at hall, x 2 m, frozen"


@given(
    st.lists(st.tuples(coordinates, coordinates), max_size=4),
    st.builds(Pose2, coordinates, coordinates, coordinates),
    st.lists(behaviours, max_size=4),
)
def test_any_mission_and_any_behaviours_are_checked(points, start, scripts):
    found = check_run(
        scene_with(CROWDED), ROBILE, mission(*points, start=start), scripts, where=PLACE
    )
    assert all(d.message for d in found)
    assert len(set(found)) == len(found)
