"""Where the robot is sent: spots, ways between them, and the doors on the way."""

import dataclasses

import pytest

from grammars.model.behaviour import Hold
from grammars.model.geometry import Pose2
from grammars.scenery.composition import compile_scene
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import DOOR, messages, mission, scene_with

SECOND = (
    "Entryway way_out:",
    "Entryway other: shape: Rectangle width=1 m, height=2 m location: in: hall.walls[0] "
    "and kitchen.walls[2] translation: x: -1.2 m, z: 1 m\nEntryway way_out:",
)


def test_a_spot_may_be_half_a_width_from_a_wall(robile):
    scene = scene_with(DOOR)
    assert messages(robile, scene, mission((3, 1.767), (-3, -1.767))) == []
    assert messages(robile, scene, mission((3, 1.78))) == [
        "waypoint w0 is 0.22 m from hall-wall-0, robile needs 0.23 m "
        "(move it 0.01 m away from the wall)"
    ]


def test_a_spot_may_be_in_a_doorway_under_its_lintel(robile):
    assert messages(robile, scene_with(""), mission((0.5, 2.2))) == []
    (tall,) = messages(dataclasses.replace(robile, height=2.1), scene_with(""), mission((0.5, 2.2)))
    assert tall.startswith("waypoint w0 is inside of ")


def test_a_start_that_touches_a_wall_does_not_stand_in_it(robile):
    for x, hits in ((4.65, False), (4.6505, False), (4.66, True)):
        found = messages(robile, scene_with(DOOR), mission((3, 0), start=Pose2(x, 0.0, 0.0)))
        text = "at the start robile stands in hall-wall-1 (move or turn the start)"
        assert found == ([text] if hits else [])


def test_posts_make_a_doorway_narrower(robile):
    half = two_rooms(("width=1 m, height=2 m", "width=0.5 m, height=2 m"))
    assert messages(robile, compile_scene(half), mission((0, 4))) == []
    narrow = (
        "object narrow_door link post box 5 cm x 5 cm from 0 m to 1.9 m, mass 100 kg\n"
        "link leaf box 5 cm x 0.4 m at (0 m, 0.25 m) from 0 m to 1.9 m, mass 20 kg\n"
        "joint hinge revolute from post to leaf at (-0.025 m, 0.025 m), between 0 rad and 2 rad\n"
        "d is a narrow_door in kitchen_doorway, hinge left, opening into kitchen"
    )
    posted = compile_scene(half, [layer(narrow)])
    assert messages(robile, posted, mission((0, 4))) == [
        "the way to waypoint w0 leads through kitchen_doorway (0.45 m), robile is 0.47 m wide "
        "(widen the doorway or take a narrower robot)"
    ]
    # A post in another doorway takes nothing from this one.
    beside = compile_scene(
        half, [layer("d is a hinged_door in way_out, hinge left, opening inwards")]
    )
    assert messages(robile, beside, mission((0, 4))) == []


def test_each_door_that_would_let_the_robot_through_is_named(robile):
    two = two_rooms(SECOND)
    both = DOOR + DOOR.replace("d is", "e is").replace("kitchen_doorway", "other")
    scene = compile_scene(two, [layer(both)])
    shut = (Hold("d.hinge", 0.0), Hold("e.hinge", 0.0))
    stay = "(fine if that is what is tested)"
    assert messages(robile, scene, mission((0.5, 4)), *shut) == [
        f"? waypoint w0 cannot be reached while d or e stays as told {stay}"
    ]
    assert messages(robile, scene, mission((0.5, 4)), shut[0]) == []
    assert messages(robile, scene, mission((0.5, 4)), shut[0], Hold("e.hinge", 1.9)) == []
    behind = messages(robile, scene, mission((0.5, 4), (3, 0), (-0.5, 4)), *shut)
    assert [text.split(" cannot")[0] for text in behind] == ["? waypoint w0", "? waypoint w2"]


def test_only_what_stays_in_the_way_of_the_robot_blocks(robile):
    scene = scene_with("l is a lift_door in kitchen_doorway")
    both = (Hold("l.left", 0.0), Hold("l.right", 0.0))
    (found,) = messages(robile, scene, mission((0.5, 4)), *both)
    assert found.startswith("? waypoint w0 cannot be reached while l stays as told")
    assert messages(robile, scene, mission((0.5, 4)), both[0]) == []
    for low, blocked in (("0.28 m", True), ("0.289 m", False), ("0.3 m", False)):
        gate = (
            f"object gate link leaf box 1 m x 4 cm from {low} to 2 m, mass 9 kg\n"
            "joint rail prismatic from world to leaf along x, between 0 m and 1 m\n"
            "g is a gate in kitchen_doorway, frozen"
        )
        assert bool(messages(robile, scene_with(gate), mission((0.5, 4)))) is blocked


@pytest.mark.parametrize(("gap", "passes"), [(0.45, False), (0.48, True)])
def test_a_gap_lets_through_what_is_narrower(robile, gap, passes):
    # A column across the kitchen, 4 m wide, leaves the gap at its east end.
    pinched = two_rooms(
        (
            "shape: Rectangle width=0.3 m, length=0.3 m",
            f"shape: Rectangle width={4 - gap} m, length=0.1 m",
        ),
        ("translation: x: 1 m, y: 0.5 m", f"translation: x: {-gap / 2} m, y: 0.5 m"),
    )
    found = messages(robile, compile_scene(pinched), mission((0, 5)))
    too_narrow = (
        "the way to waypoint w0 is too narrow, robile is 0.47 m wide "
        "(look for columns or walls that stand close to each other)"
    )
    assert found == ([] if passes else [too_narrow])
