"""The floor plans that come with the campaigns."""

import math

import pytest
import shapely

from grammars.floorplan import frames, load_floorplan
from grammars.model.geometry import Pose2

# Ortega et al. 2024: doors of the experiments as found in their worlds (x, y, yaw of the door in
# the world), in a wall frame of the floor plan (wall, x, y, quarter turns), and the doorway.
LEFT, END, RIGHT, EXTRA = (
    "left_long_corridor-wall-",
    "left_corridor_extra_end-wall-3",
    "right_long_corridor-wall-3",
    "right_corridor_extra_space-wall-1",
)
DOORS = [
    ((-6.473425, 18.693726, 2.530727), LEFT + "1", 20.53, 0.1, -1, "left_corridor_doorway_11"),
    ((-7.018322, 17.915532, -0.610865), LEFT + "1", 21.48, 0.1, 1, "left_corridor_doorway_11"),
    ((-3.031966, 23.608638, 2.530727), LEFT + "1", 14.53, 0.1, -1, "left_corridor_doorway_12"),
    ((2.732477, 31.841116, -0.610865), LEFT + "1", 4.48, 0.1, 1, "left_corridor_doorway_14"),
    ((17.186603, 52.483748, -0.610865), LEFT + "1", -20.72, 0.1, 1, "left_corridor_doorway_16"),
    ((21.172959, 58.176855, 2.530727), LEFT + "1", -27.67, 0.1, -1, "left_corridor_doorway_17"),
    ((6.747512, 37.575181, -0.610865), LEFT + "1", -2.52, 0.1, 1, "left_corridor_doorway_15"),
    ((1.304867, 34.073722, -0.610865), LEFT + "3", -3.47, 0.1, -1, "left_corridor_doorway_4"),
    ((-1.591694, 29.937004, 2.530727), LEFT + "3", -8.52, 0.1, 1, "left_corridor_doorway_3"),
    ((-5.033153, 25.022092, 2.530727), LEFT + "3", -14.52, 0.1, 1, "left_corridor_doorway_2"),
    ((-8.474612, 20.10718, 2.530727), LEFT + "3", -20.52, 0.1, 1, "left_corridor_doorway_1"),
    ((5.291223, 39.766829, 2.530727), LEFT + "3", 3.48, 0.1, 1, "left_corridor_doorway_5"),
    ((11.36165, 50.946861, -0.610865), END, -6.38, 0.07, -1, "classroom_c069_door_2"),
    ((17.510389, 59.728171, -0.610865), END, 4.34, 0.07, -1, "classroom_c069_door_1"),
    ((46.355758, 37.72368, -0.610865), RIGHT, 25.36, 0.28, -1, "classroom_c022_door_1"),
    ((47.12435, 38.821344, -0.610865), RIGHT, 26.7, 0.28, -1, "classroom_c022_door_2"),
    ((51.11623, 37.112689, 2.530727), EXTRA, -2.64, 0.22, -1, "classroom_c025_door_2"),
    ((50.347637, 36.015025, 2.530727), EXTRA, -1.3, 0.22, -1, "classroom_c025_door_1"),
]
CORRIDOR = [(-12.16, 11.97), (-12.86, 12.46), (20.76, 60.46), (21.45, 59.97)]
ROOMS = [
    (52.8256, 32.5629), (11.7211, 53.5011),
    (49.54, 33.41), (52.75, 38.00), (57.34, 34.78), (54.12, 30.20),
    (10.32, 51.16), (5.73, 54.38), (13.53, 65.52), (18.12, 62.31),
]  # fmt: skip


@pytest.fixture(scope="module")
def building(campaigns):
    return load_floorplan(campaigns / "ortega2024" / "building_c.fpm")


@pytest.fixture(scope="module")
def flat(campaigns):
    return load_floorplan(campaigns / "demo" / "flat.fpm")


def clear_floor(plan):
    """Where a robot can be: spaces and doorways less walls and features."""
    open_to = shapely.union_all(
        [shapely.Polygon(s.outline) for s in plan.spaces]
        + [shapely.Polygon(o.footprint).buffer(1e-6) for o in plan.openings if o.kind == "entryway"]
    )
    walls = {
        wall.id: shapely.Polygon(wall.footprint).difference(
            shapely.union_all(
                [
                    shapely.Polygon(o.footprint).buffer(1e-6)
                    for o in plan.openings
                    if o.kind == "entryway" and wall.id in o.walls
                ]
            )
        )
        for wall in plan.walls
    }
    solid = [*walls.values(), *(shapely.Polygon(f.footprint) for f in plan.features)]
    return open_to.difference(shapely.union_all(solid))


def component(floor, point, radius):
    """Return the floor a disc of ``radius`` can reach from ``point`` with its centre."""
    reachable = floor.buffer(-radius)
    (part,) = (p for p in shapely.get_parts(reachable) if p.contains(shapely.Point(point)))
    return part


@pytest.mark.parametrize(("world", "wall", "x", "y", "quarters", "doorway"), DOORS)
def test_doors_of_the_experiments_stand_where_they_stood(
    building, world, wall, x, y, quarters, doorway
):
    pose = frames(building)[f"{wall}-frame"] @ Pose2(x, y, quarters * math.pi / 2)
    assert (pose.x, pose.y, pose.yaw) == pytest.approx(world, abs=1e-6)
    leaf = shapely.Polygon(
        pose.apply_ring(((-0.025, 0.035), (-0.025, 0.965), (0.025, 0.965), (0.025, 0.035)))
    )
    holders = [o.name for o in building.openings if shapely.Polygon(o.footprint).contains(leaf)]
    assert holders == [doorway]


@pytest.mark.parametrize(("start", "goals"), [((0.0, 0.0), CORRIDOR), ((44.4, 43.85), ROOMS)])
def test_every_waypoint_can_be_reached_in_building_c(building, start, goals):
    reachable = component(clear_floor(building), start, 0.42)
    assert [p for p in goals if not reachable.contains(shapely.Point(p))] == []


def test_building_c_is_closed_but_for_the_corridor_doorways(building):
    """Doors 1-11 lead out of the plan; with those doorways shut, one closed floor remains."""
    shut = [o for o in building.openings if o.name.startswith("left_corridor_doorway_")]
    walls = [shapely.Polygon(w.footprint) for w in building.walls]
    spaces = [shapely.Polygon(s.outline) for s in building.spaces]
    # On a grid: walls share faces to within rounding, and a plain union drops one of them.
    hull = shapely.union_all([*walls, *spaces], grid_size=1e-6).buffer(1e-6)
    floor = clear_floor(building).difference(
        shapely.union_all([shapely.Polygon(o.footprint).buffer(1e-3) for o in shut])
    )
    inside = component(floor, (0.0, 0.0), 0.2)
    # Not 0.2: beside the wings of the diagonal the published openings leave slits in the corners.
    assert inside.distance(hull.boundary) > 0.15


def test_building_c_warns_of_openings_cut_into_the_corners_of_walls(building):
    """Some published openings go beyond the corners of their walls, those of the paper's worlds.

    The three others of the diagonal take a whole wall away and stay within its outer face.
    """
    messages = [
        w.message.removeprefix('entryway "').replace('" reaches', "") for w in building.warnings
    ]
    assert messages == [
        "diagonal_corridor_wing_right_opening 0.736 m beyond the end of "
        "diagonal_corridor_right-wall-0",
        "right_corridor_extra_space_wall_removal_1 0.25 m beyond the end of "
        "right_corridor_extra_space-wall-3",
        "right_corridor_extra_space_wall_removal_2 0.31 m beyond the end of "
        "right_corridor_extra_space-wall-2",
    ]


def test_the_flat_is_flawless(flat):
    assert flat.warnings == ()
    assert [s.name for s in flat.spaces] == ["hall", "living_room", "bedroom", "kitchen"]
    widths = {o.name: o.width for o in flat.openings if o.kind == "entryway"}
    assert widths == pytest.approx(
        {"living_room_doorway": 1.2, "bedroom_doorway": 0.95, "kitchen_doorway": 0.95}
    )
    bounds = shapely.union_all([shapely.Polygon(s.outline) for s in flat.spaces]).bounds
    assert (bounds[2] - bounds[0], bounds[3] - bounds[1]) == pytest.approx((9.0, 7.0))


def test_a_robot_can_visit_every_room_of_the_flat(flat):
    reachable = component(clear_floor(flat), (0.0, 0.0), 0.42)
    for space in flat.spaces:
        assert reachable.intersection(shapely.Polygon(space.outline)).area > 1.0
