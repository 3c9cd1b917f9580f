"""Maps of the campaigns' buildings with their doors, as a robot would use them."""

import numpy as np
import pytest

from grammars.floorplan import load_floorplan
from grammars.model.grid import FREE
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid
from tests.scene.templates.cells import cell, flooded


@pytest.fixture(scope="module")
def building(campaigns):
    folder = campaigns / "ortega2024"
    return compile_scene(
        load_floorplan(folder / "building_c.fpm"), [load_scenery(folder / "doors.scenery")]
    )


@pytest.fixture(scope="module")
def flat(campaigns):
    folder = campaigns / "demo"
    return compile_scene(
        load_floorplan(folder / "flat.fpm"), [load_scenery(folder / "doors.scenery")]
    )


def test_closed_corridor_doors_keep_the_robot_inside_building_c(building):
    ajar = {f"door_{n}.hinge": 1.4 for n in range(12, 18)}
    grid = occupancy_grid(building, laser_height=0.3, resolution=0.1, joints=ajar)
    reached = flooded(grid, (0.0, 0.0))
    # Between the floor and a wall beside it rounding leaves single cells that nobody painted.
    assert np.count_nonzero(grid.cells[reached] != FREE) < 20
    assert not reached[[0, -1]].any()
    assert not reached[:, [0, -1]].any()
    goals = [(-12.16, 11.97), (21.45, 59.97), (44.4, 43.85), (52.83, 32.56), (11.72, 53.5)]
    assert all(reached[cell(grid, goal)] for goal in goals)


def test_closed_classroom_doors_keep_the_robot_out(building):
    grid = occupancy_grid(building, laser_height=0.3, resolution=0.1, joints={})
    reached = flooded(grid, (0.0, 0.0))
    assert reached[cell(grid, (20.76, 60.46))]
    for room in [(44.4, 43.85), (52.83, 32.56), (11.72, 53.5)]:
        assert grid.cells[cell(grid, room)] == FREE
        assert not reached[cell(grid, room)]


def test_without_doors_every_doorway_of_building_c_is_open(building):
    grid = occupancy_grid(building, laser_height=0.3)
    middles = {d.name: np.mean(d.footprint, axis=0) for d in building.doorways}
    assert [n for n, (x, y) in middles.items() if grid.cells[cell(grid, (x, y))] != FREE] == []


def test_doors_of_the_flat_open_their_rooms(flat):
    shut = flooded(occupancy_grid(flat, laser_height=0.2, joints={}), (0.0, 0.0))
    opened = {
        f"{thing.name}.{joint.name}": max(joint.lower, joint.upper, key=abs)
        for thing in flat.objects
        for joint in thing.joints
    }
    grid = occupancy_grid(flat, laser_height=0.2, joints=opened)
    ajar = flooded(grid, (0.0, 0.0))
    rooms = {"living_room": (1.0, 3.0), "bedroom": (6.0, 3.0), "kitchen": (1.0, -2.0)}
    assert all(grid.cells[cell(grid, point)] == FREE for point in rooms.values())
    assert not any(shut[cell(grid, point)] for point in rooms.values())
    assert all(ajar[cell(grid, point)] for point in rooms.values())
