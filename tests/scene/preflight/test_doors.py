"""Doors against their doorways, and objects against each other: what a person sees at once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Jump, KeyFrame, KeyFrames
from grammars.preflight import check_scene, places_of
from grammars.scenery.composition import compile_scene
from tests.languages.plans import layer, two_rooms
from tests.scene.preflight.samples import DOOR, messages, mission

LEAF = """
object {name}
    link leaf  box {width} m x 4 cm at ({middle} m, 0 m) from 1 cm to {top} m, mass 15 kg
    joint hinge revolute from world to leaf at (0 m, 0 m), between 0 deg and 100 deg
    state closed: hinge 0 deg
"""
BLOCK = "object block link body box 0.5 m x 0.5 m from 0 m to 1 m, mass 5 kg\n"


def leaf(name, width, top=1.95):
    return LEAF.format(name=name, width=width, middle=width / 2, top=top)


def found(text):
    """Return what is said of objects in the two rooms: severity, line, message."""
    plan, objects = two_rooms(), layer(text, models="hinged_door" in text)
    diagnostics = check_scene(compile_scene(plan, [objects]), places=places_of([objects], plan))
    return [f"{d.severity} {d.message}" for d in diagnostics if "run into" not in d.message]


def test_a_door_that_fits_is_nothing_to_speak_of():
    assert found(DOOR) == []


def test_a_double_door_is_two_leaves_that_count_together():
    half = leaf("half", 0.48)
    both = [f"{n} is a half in kitchen_doorway, hinge {side}, opening into kitchen\n"
            for n, side in (("l", "left"), ("r", "right"))]  # fmt: skip
    assert found(half + "".join(both)) == []
    (said,) = found(half + both[0])
    assert said == (
        "warning l closes 0.48 m of kitchen_doorway, which is 1.00 m wide: 0.52 m stay open"
    )


@pytest.mark.parametrize(
    ("width", "side", "remedy"),
    [
        (0.55, "right", "together 1.10 m wide, the doorway is 1.00 m: make the leaves narrower"),
        (0.48, "left", "both hang on the same side: hang one of them left, the other one right"),
        (0.95, "right", "give one of them another doorway"),
    ],
)
def test_leaves_of_a_double_door_in_each_other_are_told_why_and_nothing_else(
    robile, width, side, remedy
):
    text = leaf("half", width)
    text += "l is a half in kitchen_doorway, hinge left, opening into kitchen\n"
    text += f"r is a half in kitchen_doorway, hinge {side}, opening into kitchen"
    plan = two_rooms()
    scene = compile_scene(plan, [layer(text, models=False)])
    (error,) = check_scene(scene)
    assert error.message.endswith("one inside of the other")
    assert error.hint.endswith(f"; {remedy}")
    # Nor is it said again of what they are told to do.
    moves = [
        KeyFrames(f"{body.name}.hinge", (KeyFrame(0, j.lower), KeyFrame(9, j.upper)), Jump())
        for body in scene.objects
        for j in body.joints
    ]
    assert messages(robile, scene, mission((3, 0)), *moves) == []


@given(st.floats(0.2, 0.99))
def test_a_gap_is_told_when_it_is_more_than_a_fifth(width):
    text = leaf("some", round(width, 3))
    said = found(text + "d is a some in kitchen_doorway, hinge left, opening into kitchen")
    assert bool(said) is (round(width, 3) < 0.8)


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_blocks_stand_in_each_other_where_their_outlines_do(x, y):
    x, y = round(x, 2), round(y, 2)
    text = f"{BLOCK}a is a block in hall, x 0 m\nb is a block in hall, x {x} m, y {y} m"
    depth = min(0.5 - abs(x), 0.5 - abs(y))
    # A strip of 2 cm is taken for touching: no more than 1 cm of it lies within its outline.
    if abs(depth - 0.02) > 1e-6:
        assert bool(found(text)) is (depth > 0.02)


def test_what_is_above_another_thing_does_not_stand_in_it():
    lamp = "object lamp link body box 0.5 m x 0.5 m from 1 m to 2 m, mass 5 kg\n"
    assert found(f"{BLOCK}{lamp}a is a block in hall, x 0 m\nb is a lamp in hall, x 0 m") == []


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("world, x 30 m", ["warning a stands outside of the building, 24.75 m from hall"]),
        ("hall, x 0 m", []),
        ("kitchen, x -1 m", []),
        ("hall, x 5.1 m", ["warning a stands in hall-wall-1"]),
    ],
)
def test_what_touches_no_part_of_the_building_is_told(place, said):
    frame = "at" if place.startswith("world") else "in"
    assert found(f"{BLOCK}a is a block {frame} {place}") == said
