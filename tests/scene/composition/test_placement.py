"""Objects stand where the layers say, and open to the side they say."""

import math

import pytest
from shapely.geometry import Point, Polygon

from grammars.floorplan import parse_floorplan
from grammars.model.kinematics import link_poses
from grammars.scenery.composition import compile_scene
from tests.languages.plans import PEOPLE, TWO_ROOMS, layer, resolved, scene_with, two_rooms


def outline(body, link, *positions):
    pose = link_poses(body, positions)[link]
    shape = next(part for part in body.links if part.name == link)
    return Polygon(pose.apply_ring(shape.polygons[0]))


def the_door(text):
    return scene_with(text).objects[0]


def room_of(scene, point):
    return next((r.name for r in scene.regions if Polygon(r.outline).covers(Point(point))), "")


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


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("towards", ["inwards", "outwards", "into hall", "into kitchen"])
def test_a_hinged_door_fits_its_doorway_and_opens_to_the_side_it_should(side, towards):
    scene = scene_with(f"d is a hinged_door in kitchen_doorway, hinge {side}, opening {towards}")
    door = scene.objects[0]
    joint = door.joints[0]
    wide_open = joint.upper if not door.mirrored else joint.lower
    closed = outline(door, "leaf", 0.0)
    passage = Polygon(scene.doorways[0].footprint)
    assert passage.buffer(1e-6).covers(closed)
    assert door.doorway == "kitchen_doorway"
    # seen from the hall, looking north, left is west: the doorway reaches from x 0 to x 1
    hinge = door.pose.apply(joint.anchor)
    assert hinge[0] < 0.1 if side == "left" else hinge[0] > 0.9
    tip = outline(door, "leaf", wide_open * 0.7).centroid
    expected = "hall" if towards in ("inwards", "into hall") else "kitchen"
    assert room_of(scene, (tip.x, tip.y)) == expected


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(("on", "y"), [("on the inside", 2.0), ("on the side of kitchen", 2.4)])
def test_a_slider_hangs_on_its_side_of_the_wall(side, on, y):
    door = the_door(f"d is a slider in kitchen_doorway, sliding {side}, {on}")
    panel, opened = outline(door, "panel", 0.0), outline(door, "panel", 1.0)
    assert panel.bounds[0] < 0.0 < 1.0 < panel.bounds[2]
    assert panel.distance(Point(0.5, y)) == pytest.approx(0.01, abs=1e-6)
    assert (opened.centroid.x < panel.centroid.x) == (side == "left")


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
    door = the_door(handled)
    poses = link_poses(door, door.initial)
    assert poses["handle"] == poses["leaf"] != poses["post"]
    assert abs(door.initial[1]) == pytest.approx(math.pi / 2)
