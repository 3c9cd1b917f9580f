"""The map of a scene."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from grammars.floorplan import load_floorplan
from grammars.model.geometry import Pose2
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject, Solid
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid, with_objects
from tests.scene.templates.worlds import HERE, two_rooms, wall
from tests.scene.templates.worlds import clockwise as box

COORDINATES = st.floats(-3.0, 3.0).map(lambda v: round(v, 3))


def drawn_map(scene, joints=None, **keys):
    """Return the map of a scene, with its objects if ``joints`` are given."""
    building = occupancy_grid(scene, **keys)
    if joints is None:
        return building
    same = {key: keys[key] for key in ("laser_height", "rule") if key in keys}
    return with_objects(building, scene, joints=joints, **same)


def door(thickness=0.05):
    leaf = Link("leaf", (box(0.0, -thickness / 2, 1.0, thickness / 2),), 20.0, 0.01, 1.99)
    hinge = Joint("hinge", "revolute", "world", "leaf", (0.0, 0.0), (1.0, 0.0), 0.0, 3.0)
    return SceneObject("door", "door", Pose2(2.1, 0.5, math.pi / 2), (leaf,), (hinge,), (0.0,))


def cell(grid, point):
    x, y = (
        (at - start) / grid.resolution for at, start in zip(point, (grid.x, grid.y), strict=True)
    )
    return math.floor(y), math.floor(x)


def at(grid, point):
    return int(grid.cells[cell(grid, point)])


def flooded(grid, start):
    """Return the cells connected to ``start`` (by their sides) that are not occupied."""
    pieces, _ = ndimage.label(grid.cells != OCCUPIED)
    return pieces == pieces[cell(grid, start)]


def with_column(pose):
    """Return the rooms with a column in the middle of their doorway."""
    scene = two_rooms(pose)
    column = Solid("column", "column", pose.apply_ring(box(2.0, 0.8, 2.2, 1.2)), 0.0, 2.5)
    return replace(scene, solids=(*scene.solids, column))


ODD = Pose2(0.123456, -0.654321)
MAPS = {
    "as they stand": (two_rooms(), {}),
    "what touches a cell takes it": (two_rooms(), {"rule": "touch"}),
    "what holds its centre takes it": (two_rooms(), {"rule": "centre"}),
    "off the grid": (two_rooms(ODD), {"resolution": 0.15}),
    "off the grid, what touches a cell takes it": (
        two_rooms(ODD), {"resolution": 0.15, "rule": "touch"}),
    "off the grid, what holds its centre takes it": (
        two_rooms(ODD), {"resolution": 0.15, "rule": "centre"}),
    "turned and far away": (two_rooms(Pose2(50.0, 40.0, 0.6)), {}),
    "turned and far away, what touches a cell takes it": (
        two_rooms(Pose2(-50.013, -40.021, 2.4)), {"rule": "touch"}),
    "seen through the window": (two_rooms(), {"laser_height": 1.2}),
    "above the doorway": (two_rooms(), {"laser_height": 2.2}),
    "above the doorway, what touches a cell takes it": (
        two_rooms(), {"laser_height": 2.2, "rule": "touch"}),
    "walls stand out further than the margin": (two_rooms(), {"margin": 0.05}),
    "objects are not asked for": (two_rooms(objects=(door(),)), {}),
    "objects as they stand": (two_rooms(objects=(door(),)), {"joints": {}}),
    "a door that is open": (
        two_rooms(objects=(door(),)), {"joints": {"door.hinge": math.pi / 2}}),
    "objects below the laser": (
        two_rooms(objects=(door(),)), {"joints": {}, "laser_height": 2.2}),
    "a column stays in its doorway": (with_column(HERE), {}),
    "a column stays in its doorway, turned": (with_column(Pose2(0.0, 0.0, 0.6)), {}),
}  # fmt: skip


def test_maps_of_two_rooms(golden):
    """A wall is #, floor a point and what is unknown a space; north is up."""
    text = ""
    for name, (scene, keys) in MAPS.items():
        grid = drawn_map(scene, **{"laser_height": 0.3, "resolution": 0.2, "margin": 0.6} | keys)
        assert grid.cells.dtype == np.int8
        signs = np.full(grid.cells.shape, "?")
        for value, sign in ((FREE, "."), (OCCUPIED, "#"), (UNKNOWN, " ")):
            signs[grid.cells == value] = sign
        rows = "\n".join("".join(row).rstrip() for row in signs[::-1])
        height, width = signs.shape
        text += f"=== {name}: {width} by {height} from {grid.x:.9g}, {grid.y:.9g}\n{rows}\n"
    golden("maps.txt", text)


@given(
    st.sampled_from(["outline", "touch"]),
    st.floats(-math.pi, math.pi) | st.sampled_from([0.0, math.radians(35), -math.pi / 2]),
    st.tuples(COORDINATES, COORDINATES),
    st.floats(0.05, 0.4),
    st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
    st.floats(0.001, 0.05),
    st.sampled_from([0.03, 0.05, 0.1]),
)
def test_a_shut_door_closes_its_doorway_without_a_gap(
    rule, yaw, corner, wall_thickness, place, thickness, resolution
):
    pose = Pose2(*corner, yaw)
    far = 2.0 + wall_thickness
    low = 0.2 + 0.6 * place[0]
    solids = [
        box(2.0, 0.0, far, low),
        box(2.0, low + 1.0, far, 2.0),
        box(-0.2, -0.2, far + 2.2, 0.0),
        box(-0.2, 2.0, far + 2.2, 2.2),
        box(far + 2.0, 0.0, far + 2.2, 2.0),
        box(-0.2, 0.0, 0.0, 2.0),
    ]
    rooms = {"left": box(0.0, 0.0, 2.0, 2.0), "right": box(far, 0.0, far + 2.0, 2.0)}
    opening = box(2.0, low, far, low + 1.0)
    leaf = Link("leaf", (box(0.0, 0.0, 1.0, thickness),), 20.0, 0.01, 1.99)
    hinge = Joint("hinge", "revolute", "world", "leaf", (0.0, 0.0), (1.0, 0.0), 0.0, 3.0)
    x, y = pose.apply((far - place[1] * (wall_thickness - thickness), low))
    shut = SceneObject("door", "door", Pose2(x, y, yaw + math.pi / 2), (leaf,), (hinge,), (0.0,))
    scene = Scene(
        "rooms",
        tuple(Region(name, pose.apply_ring(ring)) for name, ring in rooms.items()),
        (Doorway("doorway", pose, pose.apply_ring(opening), 1.0, 0.0, 2.0),),
        tuple(wall(pose.apply_ring(ring)) for ring in solids),
        (shut,),
    )
    here, there = pose.apply((1.0, 1.0)), pose.apply((far + 1.0, 1.0))
    keywords = {"laser_height": 0.3, "resolution": resolution}
    bare = occupancy_grid(scene, rule=rule, **keywords)
    assert flooded(bare, here)[cell(bare, there)]
    drawn = drawn_map(scene, {}, rule=rule, **keywords)
    assert at(drawn, here) == at(drawn, there) == FREE
    assert not flooded(drawn, here)[cell(drawn, there)]


@given(
    st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=8, unique=True),
    st.floats(0.15, 0.5),
)
def test_cells_agree_with_polygon_clipping(points, resolution):
    hull = shapely.convex_hull(shapely.MultiPoint(points))
    if hull.geom_type != "Polygon" or hull.area < 0.01:
        return
    ring = tuple(hull.exterior.coords[:-1])
    scene = Scene("s", (Region("floor", box(-4.0, -4.0, 4.0, 4.0)),), (), (wall(ring),))
    grid = occupancy_grid(scene, laser_height=0.3, resolution=resolution, margin=0.0, rule="touch")
    rows, columns = np.indices(grid.cells.shape)
    x, y = grid.x + columns * resolution, grid.y + rows * resolution
    share = shapely.area(
        shapely.intersection(shapely.box(x, y, x + resolution, y + resolution), hull)
    )
    occupied = grid.cells == OCCUPIED
    assert occupied[share > 1e-5 * resolution].all()
    assert not occupied[
        shapely.distance(shapely.box(x, y, x + resolution, y + resolution), hull) > 1e-5
    ].any()


@given(st.integers(3, 9), st.floats(0.0, 6.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_star_shaped_room_is_free_where_cell_centres_lie_in_it(tips, turn, x, y):
    radius = (1.0, 0.35)
    outline = tuple(
        (
            x + radius[k % 2] * math.sin(turn + math.pi * k / tips),
            y + radius[k % 2] * math.cos(turn + math.pi * k / tips),
        )
        for k in range(2 * tips)
    )
    scene = Scene("s", (Region("star", outline),), (), ())
    grid = occupancy_grid(scene, laser_height=0.3, rule="touch")
    rows, columns = np.indices(grid.cells.shape)
    centres = shapely.points(grid.x + (columns + 0.5) * 0.05, grid.y + (rows + 0.5) * 0.05)
    star = shapely.Polygon(outline)
    certain = shapely.distance(centres, star.exterior) > 1e-5
    inside = shapely.contains(star, centres)
    assert ((grid.cells == FREE) == inside)[certain].all()


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"resolution": 0.0}, "must be positive"),
        ({"resolution": math.nan}, "must be positive"),
        ({"margin": -1.0}, "not negative"),
    ],
)
def test_nonsense_is_refused(keywords, message):
    with pytest.raises(ValueError, match=message):
        occupancy_grid(two_rooms(objects=(door(),)), laser_height=0.3, **keywords)
    with pytest.raises(ValueError, match="neither regions nor solids"):
        occupancy_grid(Scene("void", (), (), ()), laser_height=0.3)


# Maps of buildings that exist.


@pytest.fixture(scope="module")
def building_c(campaigns):
    folder = campaigns / "ortega2024"
    plan = load_floorplan(folder / "building_c.fpm")
    return compile_scene(plan, [load_scenery(folder / "doors.scenery")])


CORRIDOR = [(-12.16, 11.97), (21.45, 59.97)]
CLASSROOMS = [(44.4, 43.85), (52.83, 32.56), (11.72, 53.5)]
AJAR = {f"door_{n}.hinge": 1.4 for n in range(12, 18)}


@pytest.mark.parametrize(("joints", "open"), [(AJAR, True), ({}, False)], ids=["ajar", "shut"])
def test_doors_decide_where_a_robot_gets_in_building_c(building_c, joints, open):
    grid = drawn_map(building_c, joints, laser_height=0.3, resolution=0.1)
    reached = flooded(grid, (0.0, 0.0))
    # Between the floor and a wall beside it rounding leaves single cells that nobody painted.
    assert np.count_nonzero(grid.cells[reached] != FREE) < 20
    assert not reached[[0, -1]].any()
    assert not reached[:, [0, -1]].any()
    assert all(reached[cell(grid, goal)] for goal in CORRIDOR)
    assert [bool(reached[cell(grid, goal)]) for goal in CLASSROOMS] == [open] * 3
    assert {at(grid, goal) for goal in CORRIDOR + CLASSROOMS} == {FREE}


def test_without_doors_every_doorway_of_building_c_is_open(building_c):
    grid = occupancy_grid(building_c, laser_height=0.3, resolution=0.1)
    assert {at(grid, np.mean(d.footprint, axis=0)) for d in building_c.doorways} == {FREE}
