"""Objects stand where the layers say; sentences.txt has the most of it."""

import math

import pytest

from grammars.floorplan import parse_floorplan
from grammars.model.kinematics import link_poses
from grammars.scenery.composition import compile_scene
from tests.languages.plans import PEOPLE, TWO_ROOMS, layer, resolved, scene_with, two_rooms


def column(name):
    return (
        f"Column {name}:\n    shape: Rectangle width=0.3 m, length=0.3 m\n    height: 2 m\n"
        "    location: wrt: hall translation: x: 1 m, y: 1 m\n"
    )


PERSON = """
mover person
    link body circle radius 20 cm from 0 m to 1.7 m, mass 70 kg
p is a person at hall, x 3 m, y 1 m
"""


@pytest.mark.parametrize(
    ("added", "frame"),
    [
        (column("kitchen"), "kitchen"),
        (column("way_out"), "way_out"),
        (column("pillar"), "pillar"),
        (column("pillar"), "kitchen.pillar"),
    ],
    ids=["space and column", "opening and column", "column and feature", "full name"],
)
def test_a_name_means_one_frame_whoever_says_it(added, frame):
    plan = parse_floorplan(TWO_ROOMS + added, "two_rooms.fpm")
    objects = layer(PERSON + f"d is a hinged_door at {frame}\n")
    walk = layer(f"p walks along (0 m, 0 m), (1 m, 0 m) of {frame}", "walk", models=False)
    scene = compile_scene(plan, [objects, walk])
    stands = next(body.pose for body in scene.objects if body.name == "d")
    (walks,) = resolved(scene, [objects, walk]).behaviours
    assert (stands.x, stands.y) == walks.route[0]


def test_parts_that_are_fixed_go_with_their_link():
    (table,) = [o for o in scene_with(PEOPLE).objects if o.name == "table_1"]
    kitchen = two_rooms().spaces[1].frame
    assert (table.pose.x, table.pose.y) == pytest.approx((kitchen.x + 1.0, kitchen.y + 0.5))
    poses = link_poses(table, table.initial)
    assert poses["foot"] == poses["top"] == table.pose
    # A door with a handle still fits its doorway.
    handled = """
    object office_door
        link post   box 4 cm x 4 cm                   from 0 m to 1.9 m, mass 50 kg
        link leaf   box 4 cm x 88 cm at (0 m, 47 cm)  from 0 m to 1.9 m, mass 15 kg
        link handle box 12 cm x 10 cm at (0 m, 80 cm) from 1 m to 1.05 m, mass 500 g
        joint grip  fixed from leaf to handle
        joint hinge revolute from post to leaf at (-2 cm, 2.5 cm), between 0 deg and 110 deg
        state open: hinge 90 deg
    d is a office_door in kitchen_doorway, hinge left, opening into kitchen, starts open
    """
    (door,) = scene_with(handled).objects
    poses = link_poses(door, door.initial)
    assert poses["handle"] == poses["leaf"] != poses["post"]
    assert abs(door.initial[1]) == pytest.approx(math.pi / 2)
