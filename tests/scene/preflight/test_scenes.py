"""Scenes by themselves: doors against doorways, furniture in walls, leaves that meet."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Jump, KeyFrame, KeyFrames
from grammars.preflight import check_scene, places_of
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Where
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import DOOR, PERSON, messages, mission, scene_with

LEAF = """
object some
    link leaf  box {width} m x 4 cm at ({middle} m, 0 m) from 1 cm to 1.95 m, mass 15 kg
    joint hinge revolute from world to leaf at (0 m, 0 m), between 0 deg and 100 deg
    state closed: hinge 0 deg
l is a some in kitchen_doorway, hinge left, opening into kitchen
"""
BLOCK = "object block link body box 0.5 m x 0.5 m from 0 m to 1 m, mass 5 kg\n"
CRATE = (
    "object crate link top box 1 m x 1 m from {} to {}, mass 9 kg\nc is a crate at kitchen, {}\n"
)


def leaf(width):
    return LEAF.format(width=width, middle=width / 2)


def found(scene):
    if isinstance(scene, str):
        scene = scene_with(scene)
    return [d.message for d in check_scene(scene)]


def hatch(width, height, z):
    """Return the rooms with one more opening, in the west wall of the hall."""
    text = (
        f"Entryway hatch: shape: Rectangle width={width}, height={height} "
        f"location: in: hall.walls[3] translation: y: 0 m, x: -1.4 m, z: {z}\nEntryway way_out:"
    )
    return compile_scene(two_rooms(("Entryway way_out:", text)))


def test_an_entryway_is_not_closed_by_its_own_wall():
    # Sill and lintel of a hatch 0.4 m above the floor, and the jambs of a slit.
    assert found(hatch("0.6 m", "0.8 m", "0.8 m")) == []
    assert found(hatch("0.1 m", "0.8 m", "0.8 m")) == []


@pytest.mark.parametrize(
    ("width", "gap", "closed"),
    [("1 m", 0.02, True), ("1 m", 0.04, False), ("0.4 m", 0.02, False)],
)
def test_what_stands_within_six_centimetres_closes_an_entryway(width, gap, closed):
    # The doorway ends at y = 2.4; the column stands so far behind it, in the kitchen around 3.9.
    # 4 cm over the whole width are 7.5 % of the passage and its thresholds, 2 cm are 3.8 %.
    column = two_rooms(
        ("Rectangle width=0.3 m, length=0.3 m", f"Rectangle width={width}, length=0.2 m"),
        ("translation: x: 1 m, y: 0.5 m", f"translation: x: 0.5 m, y: {2.4 + gap + 0.1 - 3.9} m"),
    )
    closing = [text for text in found(compile_scene(column)) if "is closed by" in text]
    assert closing == ["kitchen_doorway is closed by pillar"] * closed


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("recess", ["0 cm", "10 cm"])
def test_a_door_set_in_its_doorway_touches_but_does_not_sweep_through_its_wall(side, recess):
    place = f"in kitchen_doorway, hinge {side}, opening inwards, recessed {recess}"
    assert found(f"d is a hinged_door {place}") == []


@given(st.floats(0.2, 0.99))
def test_a_gap_beside_a_leaf_is_reported_when_it_is_more_than_a_fifth(width):
    width = round(width, 3)
    gap = f"l closes {width:.2f} m of kitchen_doorway, which is 1.00 m wide"
    assert [text.partition(":")[0] for text in found(leaf(width))] == [gap] * (width < 0.8)


def test_a_double_door_is_two_leaves_that_count_together():
    other = "r is a some in kitchen_doorway, hinge right, opening into kitchen\n"
    assert found(leaf(0.48) + other) == []
    scene = scene_with(leaf(0.55) + other)
    (message,) = found(scene)
    assert message.endswith("one inside of the other")
    # What they are told to do does not report it again.
    moves = [
        KeyFrames(f"{body.name}.hinge", (KeyFrame(0, j.lower), KeyFrame(9, j.upper)), Jump())
        for body in scene.objects
        for j in body.joints
    ]
    assert messages(scene, mission((3, 0)), *moves) == []


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_blocks_stand_in_each_other_where_their_outlines_do(x, y):
    x, y = round(x, 2), round(y, 2)
    text = f"{BLOCK}a is a block in hall, x 0 m\nb is a block in hall, x {x} m, y {y} m"
    depth = min(0.5 - abs(x), 0.5 - abs(y))
    # A strip of 2 cm is taken for touching: no more than 1 cm of it lies within its outline.
    if abs(depth - 0.02) > 1e-6:
        inside = [text for text in found(text) if "run into" not in text]
        assert bool(inside) is (depth > 0.02)


def test_what_is_above_another_thing_does_not_stand_in_it():
    lamp = "object lamp link body box 0.5 m x 0.5 m from 1 m to 2 m, mass 5 kg\n"
    assert found(f"{BLOCK}{lamp}a is a block in hall, x 0 m\nb is a lamp in hall, x 0 m") == []


@pytest.mark.parametrize(("x", "inside"), [("-1.5 m", 0), ("-1.505 m", 0), ("-1.53 m", 1)])
def test_furniture_that_touches_a_wall_does_not_stand_in_it(x, inside):
    # The kitchen's west wall is at x = -2.
    expected = ["c stands in kitchen-wall-3"] * inside
    assert found(CRATE.format("0 m", "1 m", f"x {x}")) == expected


@pytest.mark.parametrize(
    ("low", "high", "meet"),
    [
        ("0 m", "1 m", True),
        ("1.9 m", "2.2 m", True),
        ("1.945 m", "2.2 m", False),
        ("0 m", "0.005 m", False),
        ("0 m", "0.01 m", True),
    ],
)
def test_a_leaf_meets_only_what_is_at_its_height(low, high, meet):
    # The leaf is between 0.005 m and 1.945 m.
    expected = ["d and c can run into each other somewhere in its range"] * meet
    assert found(DOOR + CRATE.format(low, high, "x 0.4 m, y -0.5 m")) == expected


def test_what_stands_and_what_is_frozen_is_met_and_who_walks_is_not():
    meets = ["d and v can run into each other somewhere in its range"]
    person = PERSON.replace("in hall, x -4 m", "in kitchen, x 0.4 m, y -0.9 m")
    assert found(DOOR + person) == []
    assert found(DOOR + person.rstrip() + ", frozen") == meets


def test_two_leaves_that_meet_each_other_are_reported_once_and_three_in_pairs():
    doors = DOOR + "e is a hinged_door at kitchen, x 0.2 m, y -0.9 m\n"
    lamp = "object lamp link top box 20 cm x 20 cm from 0 m to 1 m, mass 9 kg\n"
    assert found(doors + lamp + "c is a lamp at kitchen, x 0 m, y -0.5 m") == [
        f"{pair} can run into each other somewhere in its range"
        for pair in ("d and e", "d and c", "e and c")
    ]


def test_objects_have_names_of_their_own_and_joints_start_within_their_limits():
    scene = scene_with("d is a hinged_door at kitchen")
    (body,) = scene.objects
    twice = dataclasses.replace(scene, objects=(body, body))
    assert 'there are two objects called "d"' in found(twice)
    for initial, outside in ((0.0, 0), (2.0, 0), (-1e-6, 1), (2.000001, 1)):
        moved = dataclasses.replace(body, initial=(initial,))
        texts = found(dataclasses.replace(scene, objects=(moved,)))
        message = f"d.hinge starts at {initial:g}, outside of its limits"
        assert [text for text in texts if "limits" in text] == [message] * outside


def test_findings_are_where_their_object_was_written():
    doors = layer("d is a hinged_door at hall.walls[0], x -3 m, y 0.1 m, turned -90 deg")
    scene = compile_scene(two_rooms(), [doors])
    places = places_of([doors], two_rooms())
    assert {"d", "kitchen_doorway", "way_out"} <= set(places)
    assert [d.where for d in check_scene(scene, places=places)] == [places["d"]]
    assert [d.where for d in check_scene(scene)] == [Where(scene.name)]
    assert [d.where for d in check_scene(scene, places={"e": places["d"]})] == [Where(scene.name)]
