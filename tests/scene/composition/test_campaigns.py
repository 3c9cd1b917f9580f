"""The worlds that ship with the project: doors in their places, opening to the right side."""

import math

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from grammars.floorplan import load_floorplan
from grammars.model.behaviour import Hold, Jump, KeyFrames, Spring, Trigger
from grammars.model.kinematics import link_poses
from grammars.preflight import check_scene
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import Severity

# x, y, yaw of the doors in the published world of Scenarios 2 and 3 (frontiers2024 package)
PUBLISHED = {
    1: (-7.018322, 17.915532, -0.610865),
    2: (-3.576864, 22.830444, -0.610865),
    3: (2.732477, 31.841116, -0.610865),
    4: (17.186603, 52.483748, -0.610865),
    5: (20.628062, 57.398660, -0.610865),
    6: (6.747512, 37.575181, -0.610865),
    7: (1.849764, 34.851917, 2.530727),
    8: (-1.591694, 29.937004, 2.530727),
    9: (-5.033153, 25.022092, 2.530727),
    10: (-8.474612, 20.107180, 2.530727),
    11: (5.291223, 39.766829, 2.530727),
    12: (11.361650, 50.946861, -0.610865),
    13: (17.510389, 59.728171, -0.610865),
    14: (46.355758, 37.723680, -0.610865),
    15: (47.124350, 38.821344, -0.610865),
    16: (51.116230, 37.112689, 2.530727),
    17: (50.347637, 36.015025, 2.530727),
}

# the same in the published world of Scenario 1
PUBLISHED_S1 = {
    1: (-6.473425, 18.693726, 2.530727),
    2: (-3.031966, 23.608638, 2.530727),
    3: (3.277375, 32.619311, 2.530727),
    4: (17.731501, 53.261942, 2.530727),
    5: (21.172959, 58.176855, 2.530727),
    6: (7.292410, 38.353375, 2.530727),
    7: (1.304867, 34.073722, -0.610865),
    8: (-2.136592, 29.158810, -0.610865),
    9: (-5.578051, 24.243898, -0.610865),
    10: (-9.019509, 19.328985, -0.610865),
    11: (5.291223, 39.766829, 2.530727),
}


@pytest.fixture(scope="module")
def layers(campaigns):
    folder = campaigns / "ortega2024"
    return {file.stem: load_scenery(file) for file in sorted(folder.glob("*.scenery"))}


@pytest.fixture(scope="module")
def building(campaigns, layers):
    plan = load_floorplan(campaigns / "ortega2024" / "building_c.fpm")
    return compile_scene(plan, [layers["doors"]])


def leaf(door, angle):
    shape = next(link for link in door.links if link.name == "leaf")
    return Polygon(link_poses(door, [angle])["leaf"].apply_ring(shape.polygons[0]))


def test_the_doors_of_scenario_1_stand_where_its_world_has_them(campaigns, layers, building):
    plan = load_floorplan(campaigns / "ortega2024" / "building_c.fpm")
    scene = compile_scene(plan, [layers["doors_s1"]])
    for door, other, (number, pose) in zip(
        scene.objects, building.objects, PUBLISHED_S1.items(), strict=False
    ):
        assert door.name == f"door_{number}"
        assert (door.pose.x, door.pose.y) == pytest.approx(pose[:2], abs=1e-6)
        assert math.remainder(door.pose.yaw - pose[2], math.tau) == pytest.approx(0, abs=1e-6)
        assert door.frozen == (number != 11)
        shut = leaf(door, 0.0).symmetric_difference(leaf(other, 0.0)).area
        assert shut < 0.01  # shut, both stand in the same place but for the width of the post


@pytest.mark.parametrize("number", PUBLISHED)
def test_doors_stand_where_the_published_world_has_them(building, number):
    door = building.objects[number - 1]
    assert door.name == f"door_{number}"
    assert (door.pose.x, door.pose.y, door.pose.yaw) == pytest.approx(PUBLISHED[number], abs=1e-6)
    assert door.doorway != ""


@pytest.mark.parametrize("number", range(1, 12))
def test_office_doors_open_into_the_corridor(building, number):
    corridor = next(r for r in building.regions if r.name == "left_long_corridor")
    tip = leaf(building.objects[number - 1], 1.4).centroid
    assert Polygon(corridor.outline).covers(tip)


@pytest.mark.parametrize(
    ("numbers", "room"),
    [((12, 13), "classroom_c069"), ((14, 15), "classroom_c022"), ((16, 17), "classroom_c025")],
)
def test_classroom_doors_open_into_their_rooms(building, numbers, room):
    region = next(r for r in building.regions if r.name == room)
    for number in numbers:
        tip = leaf(building.objects[number - 1], 1.4).centroid
        assert Polygon(region.outline).covers(Point(tip))


def test_a_closed_door_fills_its_doorway(building):
    for door in building.objects:
        doorway = next(d for d in building.doorways if d.name == door.doorway)
        covered = Polygon(doorway.footprint).intersection(leaf(door, 0.0))
        assert covered.area == pytest.approx(0.93 * 0.05, rel=1e-6)


def resolve(scene, *layers):
    result = resolve_behaviours(scene, layers, seed=np.random.SeedSequence(1), limit=1200.0)
    return {b.joint.removesuffix(".hinge"): b for b in result.behaviours}


def test_scenario_1_holds_every_door_shut(building, layers):
    told = resolve(building, layers["doors"], layers["doors_closed"])
    assert told == {f"door_{n}": Hold(f"door_{n}.hinge", 0.0) for n in PUBLISHED}


def test_scenario_2_moves_eleven_doors_at_random_times(building, layers):
    told = resolve(building, layers["doors"], layers["doors_random"])
    moving = [b for b in told.values() if isinstance(b, KeyFrames)]
    assert [b.joint for b in moving] == [f"door_{n}.hinge" for n in range(1, 12)]
    assert len({b.frames for b in moving}) == 11
    for behaviour in moving:
        assert {f.position for f in behaviour.frames} == {0.0, 1.7}
        assert all(90.0 <= f.time <= 729.0 for f in behaviour.frames[1:])
    assert sum(isinstance(b, Hold) for b in told.values()) == 6


def test_scenario_3_shuts_two_doors_in_the_face_of_the_robot(building, layers):
    told = resolve(building, *(layers[n] for n in ("doors", "doors_open", "close_on_approach")))
    for number in (12, 17):
        joint = f"door_{number}.hinge"
        expected = Trigger(joint, 1.4, 0.0, 1.3, Spring(0.5, 0.0), "hinge", "base", None)
        assert told[f"door_{number}"] == expected
    for number in (13, 14, 16):
        assert told[f"door_{number}"] == Hold(f"door_{number}.hinge", 1.4)
    assert told["door_15"] == Hold("door_15.hinge", 0.0)
    assert told["door_1"] == Hold("door_1.hinge", 0.0)


def test_scenario_2_as_published_has_the_doors_of_the_corridor_alone(campaigns, layers, building):
    plan = load_floorplan(campaigns / "ortega2024" / "building_c.fpm")
    scene = compile_scene(plan, [layers["doors_s2"]])
    assert scene.objects == building.objects[:11]


def test_scenario_2_as_published_moves_ten_doors_and_keeps_the_eleventh_shut(building, layers):
    told = resolve(building, layers["doors"], layers["doors_timed_era"])
    assert list(told) == [f"door_{n}" for n in range(1, 12)]
    for name, behaviour in told.items():
        assert isinstance(behaviour, KeyFrames)
        assert behaviour.in_order == (name != "door_2")
        assert behaviour.motion == (Spring(0.5) if name == "door_11" else Jump())


@pytest.mark.parametrize(
    ("layer", "begin"), [("close_on_approach_era", None), ("close_on_approach_swinging", 0.0)]
)
def test_the_published_triggers_count_from_the_foot(building, layers, layer, begin):
    told = resolve(building, *(layers[n] for n in ("doors", "doors_open", layer)))
    for number in (12, 17):
        joint = f"door_{number}.hinge"
        expected = Trigger(joint, 1.4, 0.0, 1.3, Spring(0.5), "foot", "base", None, begin)
        assert told[f"door_{number}"] == expected


@pytest.mark.parametrize("behaviour", ["doors_open", "doors_moving", "doors_in_your_face"])
def test_the_demo_flat_is_sound(campaigns, behaviour):
    folder = campaigns / "demo"
    loaded = [load_scenery(folder / f"{name}.scenery") for name in ("doors", behaviour)]
    scene = compile_scene(load_floorplan(folder / "flat.fpm"), loaded)
    assert [o.doorway for o in scene.objects] == [
        "bedroom_doorway",
        "kitchen_doorway",
        "living_room_doorway",
    ]
    assert check_scene(scene) == ()
    result = resolve_behaviours(scene, loaded, seed=np.random.SeedSequence(1), limit=60.0)
    assert len(result.behaviours) == 3
    assert result.overridden == ()


def test_building_c_has_no_errors(building):
    assert [d for d in check_scene(building) if d.severity is Severity.ERROR] == []
