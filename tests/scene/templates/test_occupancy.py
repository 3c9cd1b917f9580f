"""The map of a scene."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import load_floorplan
from grammars.model.geometry import Pose2
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject, Solid
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid
from tests.scene.templates.worlds import cell, flooded, two_rooms, wall
from tests.scene.templates.worlds import clockwise as box

COORDINATES = st.floats(-3.0, 3.0).map(lambda v: round(v, 3))


def door(thickness=0.05):
    leaf = Link("leaf", (box(0.0, -thickness / 2, 1.0, thickness / 2),), 20.0, 0.01, 1.99)
    hinge = Joint("hinge", "revolute", "world", "leaf", (0.0, 0.0), (1.0, 0.0), 0.0, 3.0)
    return SceneObject("door", "door", Pose2(2.1, 0.5, math.pi / 2), (leaf,), (hinge,), (0.0,))


def at(grid, point):
    return int(grid.cells[cell(grid, point)])


@pytest.mark.parametrize("yaw", [0.0, 0.6, 2.4, -2.0])
@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (50.0, 40.0), (-50.0, 40.0), (-50.013, -40.021)])
def test_a_map_is_right_wherever_the_building_stands(x, y, yaw):
    pose = Pose2(x, y, yaw)
    grid = occupancy_grid(two_rooms(pose), laser_height=0.3)
    expected = {
        (1.0, 1.0): FREE,
        (3.0, 1.0): FREE,
        (2.1, 1.0): FREE,
        (2.1, 0.25): OCCUPIED,
        (-0.1, 1.0): OCCUPIED,
        (4.3, 1.0): OCCUPIED,
        (5.0, 1.0): UNKNOWN,
        (1.0, -0.8): UNKNOWN,
    }
    assert {p: at(grid, pose.apply(p)) for p in expected} == expected


@pytest.mark.parametrize("rule", ["touch", "centre"])
def test_walls_on_the_grid_take_exactly_their_cells(rule):
    grid = occupancy_grid(two_rooms(), laser_height=0.3, resolution=0.1, margin=0.5, rule=rule)
    assert (grid.x, grid.y) == pytest.approx((-0.5, -0.5))
    assert grid.cells.shape == (30, 52)
    assert np.count_nonzero(grid.cells == OCCUPIED) == (46 * 4 + 20 * 2 * 2 + 5 * 2 * 2)
    assert np.count_nonzero(grid.cells == FREE) == 2 * 400 + 20
    assert grid.cells.dtype == np.int8


@pytest.mark.parametrize(
    ("height", "window", "doorway"),
    [(0.3, OCCUPIED, FREE), (1.2, UNKNOWN, FREE), (2.2, OCCUPIED, OCCUPIED)],
)
def test_the_map_shows_what_the_laser_height_meets(height, window, doorway):
    grid = occupancy_grid(two_rooms(), laser_height=height)
    assert at(grid, (-0.1, 1.0)) == window
    assert at(grid, (2.1, 1.0)) == doorway


def test_objects_are_drawn_only_when_asked_for_and_where_their_joints_are():
    scene = two_rooms(objects=(door(),))
    assert at(occupancy_grid(scene, laser_height=0.3), (2.1, 1.0)) == FREE
    assert at(occupancy_grid(scene, laser_height=0.3, joints={}), (2.1, 1.0)) == OCCUPIED
    assert at(occupancy_grid(scene, laser_height=2.2, joints={}), (1.0, 1.0)) == FREE
    grid = occupancy_grid(scene, laser_height=0.3, joints={"door.hinge": math.pi / 2})
    assert at(grid, (2.15, 1.0)) == FREE
    assert at(grid, (1.6, 0.5)) == OCCUPIED


@given(st.floats(0.0, 3.0), st.floats(0.001, 0.05))
def test_a_thin_leaf_is_an_unbroken_line(angle, thickness):
    scene = two_rooms(objects=(door(thickness),))
    grid = occupancy_grid(scene, laser_height=0.3, joints={"door.hinge": angle})
    direction = math.pi / 2 + angle
    for step in np.linspace(0.01, 0.99, 200):
        point = (2.1 + step * math.cos(direction), 0.5 + step * math.sin(direction))
        assert at(grid, point) == OCCUPIED


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
    drawn = occupancy_grid(scene, rule=rule, joints={}, **keywords)
    assert at(drawn, here) == at(drawn, there) == FREE
    assert not flooded(drawn, here)[cell(drawn, there)]


@pytest.mark.parametrize("yaw", [0.0, math.radians(35), -1.0, 2.5])
def test_a_wall_is_drawn_as_if_it_had_no_doorways(yaw):
    def drawn(*pieces, doorways):
        scene = Scene(
            "wall",
            (Region("hall", box(-3.0, -3.0, 3.0, 3.0)),),
            (Doorway("d", pose, pose.apply_ring(opening), 1.0, 0.0, 2.0),)[:doorways],
            tuple(wall(pose.apply_ring(r), low, high) for r, low, high in pieces),
        )
        return occupancy_grid(scene, laser_height=0.3).cells == OCCUPIED

    pose = Pose2(0.317, -0.123, yaw)
    opening = box(-0.5, -0.1, 0.5, 0.1)
    sides = [(box(-2.0, -0.1, -0.5, 0.1), 0.0, 2.5), (box(0.5, -0.1, 2.0, 0.1), 0.0, 2.5)]
    whole = drawn((box(-2.0, -0.1, 2.0, 0.1), 0.0, 2.5), doorways=0)
    cut = drawn(*sides, (opening, 2.0, 2.5), doorways=1)
    # Nothing that the whole wall does not have, and of that nothing but the doorway is missing.
    assert not (cut & ~whole).any()
    beside = box(-0.65, -0.3, 0.65, 0.3)
    missing = whole & ~cut
    rows, columns = np.nonzero(missing)
    centres = shapely.points(-4.25 + (columns + 0.5) * 0.05, -4.25 + (rows + 0.5) * 0.05)
    assert missing.any()
    assert shapely.contains(shapely.Polygon(pose.apply_ring(beside)), centres).all()
    # A window is nothing that is freed: the wall beside it is drawn as it stands.
    window = drawn(*sides, (opening, 1.0, 2.5), doorways=0)
    assert not window[at_cell(pose.apply((0.0, 0.0)))]
    assert window[at_cell(pose.apply((1.0, 0.0)))]


def at_cell(point):
    return math.floor((point[1] + 4.25) / 0.05), math.floor((point[0] + 4.25) / 0.05)


def test_a_column_stays_in_its_doorway():
    scene = two_rooms(Pose2(0.0, 0.0, 0.6))
    pose = scene.doorways[0].frame
    column = Solid("column", "column", pose.apply_ring(box(2.05, 0.9, 2.15, 1.1)), 0.0, 2.5)
    grid = occupancy_grid(replace(scene, solids=(*scene.solids, column)), laser_height=0.3)
    assert at(grid, pose.apply((2.1, 1.0))) == OCCUPIED
    assert at(grid, pose.apply((2.1, 0.7))) == at(grid, pose.apply((2.1, 1.3))) == FREE


@pytest.mark.parametrize("rule", ["outline", "touch", "centre"])
def test_the_origin_is_the_lowest_corner_of_the_spaces_less_the_margin(rule):
    scene = two_rooms(Pose2(0.123456, -0.654321, 0.0))
    grid = occupancy_grid(scene, laser_height=0.3, rule=rule)
    assert (grid.x, grid.y) == pytest.approx((0.123456 - 1.25, -0.654321 - 1.25), abs=1e-12)
    assert grid.cells.shape == (int(2.0 / 0.05) + 50, int(4.2 / 0.05) + 50)


def test_a_map_is_larger_where_walls_stand_out_further_than_the_margin():
    grid = occupancy_grid(two_rooms(), laser_height=0.3, margin=0.05)
    # 0.2 m of wall on each side, 0.05 m of which is margin: three cells more below; above, the
    # corner on the border takes a cell of its own.
    assert (grid.x, grid.y) == pytest.approx((-0.2, -0.2))
    assert grid.cells.shape == (40 + 2 + 3 + 4, 84 + 2 + 3 + 4)


@given(
    st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=8, unique=True),
    st.floats(0.08, 0.5),
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
        ({"joints": {"door.hing": 1.0}}, 'did you mean "door.hinge"'),
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


def test_doors_decide_where_a_robot_gets_in_building_c(building_c):
    ajar = {f"door_{n}.hinge": 1.4 for n in range(12, 18)}
    for joints, inside, outside in ((ajar, CORRIDOR + CLASSROOMS, []), ({}, CORRIDOR, CLASSROOMS)):
        grid = occupancy_grid(building_c, laser_height=0.3, resolution=0.1, joints=joints)
        reached = flooded(grid, (0.0, 0.0))
        # Between the floor and a wall beside it rounding leaves single cells that nobody painted.
        assert np.count_nonzero(grid.cells[reached] != FREE) < 20
        assert not reached[[0, -1]].any()
        assert not reached[:, [0, -1]].any()
        assert all(reached[cell(grid, goal)] for goal in inside)
        assert not any(reached[cell(grid, goal)] for goal in outside)
        assert {at(grid, goal) for goal in CORRIDOR + CLASSROOMS} == {FREE}


def test_without_doors_every_doorway_of_building_c_is_open(building_c):
    grid = occupancy_grid(building_c, laser_height=0.3)
    middles = {d.name: np.mean(d.footprint, axis=0) for d in building_c.doorways}
    assert [name for name, middle in middles.items() if at(grid, middle) != FREE] == []
