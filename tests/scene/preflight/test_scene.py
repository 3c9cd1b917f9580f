"""Scenes by themselves: entryways that are closed, furniture in walls, leaves that meet."""

import dataclasses

import pytest

from grammars.preflight import check_scene, places_of
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Where
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import DOOR, PERSON, scene_with


def found(scene):
    return [d.message for d in check_scene(scene)]


def entryway(width, height, z):
    """Return the rooms with one more opening, in the west wall of the hall."""
    text = (
        f"Entryway hatch: shape: Rectangle width={width}, height={height} "
        f"location: in: hall.walls[3] translation: y: 0 m, x: -1.4 m, z: {z}\nEntryway way_out:"
    )
    return compile_scene(two_rooms(("Entryway way_out:", text)))


def test_an_entryway_is_not_closed_by_its_own_wall():
    # Sill and lintel of a hatch 0.4 m above the floor, and the jambs of a slit.
    assert found(entryway("0.6 m", "0.8 m", "0.8 m")) == []
    assert found(entryway("0.1 m", "0.8 m", "0.8 m")) == []


@pytest.mark.parametrize(
    ("width", "gap", "closed"),
    [("1 m", 0.02, True), ("1 m", 0.04, False), ("0.4 m", 0.02, False)],
)
def test_what_stands_within_six_centimetres_closes_an_entryway(width, gap, closed):
    # The doorway ends at y = 2.4; the column stands so far behind it, in the kitchen around 3.9.
    # 4 cm over the whole width are 7.5 % of the passage and its thresholds, 2 cm are 3.8 %.
    column = two_rooms(
        (
            "shape: Rectangle width=0.3 m, length=0.3 m",
            f"shape: Rectangle width={width}, length=0.2 m",
        ),
        ("translation: x: 1 m, y: 0.5 m", f"translation: x: 0.5 m, y: {2.4 + gap + 0.1 - 3.9} m"),
    )
    closing = [text for text in found(compile_scene(column)) if "is closed by" in text]
    assert closing == ["kitchen_doorway is closed by pillar"] * closed


BOX = "object crate link top box 1 m x 1 m from {} to {}, mass 9 kg\nc is a crate at kitchen, {}\n"


def test_furniture_that_touches_a_wall_does_not_stand_in_it():
    # The kitchen's west wall is at x = -2.
    for x, inside in (("-1.5 m", False), ("-1.505 m", False), ("-1.53 m", True)):
        scene = scene_with(BOX.format("0 m", "1 m", f"x {x}"))
        assert found(scene) == ["c stands in kitchen-wall-3"] * inside


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
    scene = scene_with(DOOR + BOX.format(low, high, "x 0.4 m, y -0.5 m"))
    assert found(scene) == ["d and c can run into each other somewhere in its range"] * meet


def test_what_stands_and_what_is_frozen_is_met_and_who_walks_is_not():
    meets = ["d and v can run into each other somewhere in its range"]
    person = PERSON.replace("in hall, x -4 m", "in kitchen, x 0.4 m, y -0.9 m")
    assert found(scene_with(DOOR + person)) == []
    assert found(scene_with(DOOR + person.rstrip() + ", frozen")) == meets


def test_two_leaves_that_meet_each_other_are_reported_once_and_three_in_pairs():
    doors = DOOR + "e is a hinged_door at kitchen, x 0.2 m, y -0.9 m\n"
    lamp = "object lamp link top box 20 cm x 20 cm from 0 m to 1 m, mass 9 kg\n"
    scene = scene_with(doors + lamp + "c is a lamp at kitchen, x 0 m, y -0.5 m")
    assert found(scene) == [
        "d and e can run into each other somewhere in its range",
        "d and c can run into each other somewhere in its range",
        "e and c can run into each other somewhere in its range",
    ]


def test_a_joint_may_start_at_its_limits():
    scene = scene_with("d is a hinged_door at kitchen")
    body = scene.objects[0]
    for initial, outside in ((0.0, False), (2.0, False), (-1e-6, True), (2.000001, True)):
        moved = dataclasses.replace(body, initial=(initial,))
        texts = found(dataclasses.replace(scene, objects=(moved,)))
        assert any("outside of its limits" in text for text in texts) is outside


def test_findings_are_where_their_object_was_written():
    doors = layer("d is a hinged_door at hall.walls[0], x -3 m, y 0.1 m, turned -90 deg")
    scene = compile_scene(two_rooms(), [doors])
    places = places_of([doors], two_rooms())
    assert {"d", "kitchen_doorway", "way_out"} <= set(places)
    assert [d.where for d in check_scene(scene, places=places)] == [places["d"]]
    assert [d.where for d in check_scene(scene)] == [Where(scene.name)]
    assert [d.where for d in check_scene(scene, places={"e": places["d"]})] == [Where(scene.name)]
