"""Tasks: ways around rooms at a distance from their walls, missions as task files."""

import math

import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2
from grammars.model.mission_files import load_mission
from grammars.model.scene import Region, Scene, Solid
from templates.tasks import contour_route, inset_contour, too_close, write_tasks
from tests.scene.templates.worlds import clockwise as box
from tests.scene.templates.worlds import job

L_SHAPE = ((0.0, 0.0), (0.0, 6.0), (2.0, 6.0), (2.0, 2.0), (6.0, 2.0), (6.0, 0.0))
SQUARE = box(0, 0, 4, 4)
BARBELL = (
    (0.0, 0.0), (0.0, 4.0), (4.0, 4.0), (4.0, 2.5), (6.0, 2.5), (6.0, 4.0),
    (10.0, 4.0), (10.0, 0.0), (6.0, 0.0), (6.0, 1.5), (4.0, 1.5), (4.0, 0.0),
)  # fmt: skip


@pytest.mark.parametrize("mirrored", [False, True])
def test_ways_around_rooms(golden, mirrored):
    """A corner between two others in line needs no waypoint; a narrow room has none at all."""
    rooms = {
        "an L": (((0.0, 0.0), (0.0, 3.0), *L_SHAPE[1:]), 0.3, {}),
        "a narrow closet": (box(0, 0, 1.3, 9), 0.7, {}),
        "a wing with a narrow middle": (BARBELL, 0.7, {}),
        "a room from its second corner on": (
            SQUARE,
            1.0,
            {"first": 1, "closed": True},
        ),
        "a room, the other way round": (SQUARE, 1.0, {"first": 6, "forward": False}),
        "a room, looking ahead": (SQUARE, 1.0, {"closed": True, "yaw": "path"}),
    }
    text = ""
    for name, (ring, distance, how) in rooms.items():
        outline = tuple((-x, y) for x, y in ring) if mirrored else ring
        contour = inset_contour(Region("room", outline), distance)
        text += f"=== {name}\n" + "".join(f"{one}\n" for one in contour.findings)
        for stop in contour_route(contour, **how):
            x, y, yaw = (round(value, 6) + 0.0 for value in (stop.x, stop.y, stop.yaw))
            text += f"part {stop.part} corner {stop.number}: {x:g}, {y:g} looking to {yaw:g}\n"
        text += "\n"
    golden("ways-mirrored.txt" if mirrored else "ways.txt", text.removesuffix("\n"))


@pytest.mark.parametrize("distance", [0.0, -1.0, math.inf, math.nan])
def test_a_contour_lies_inside(distance):
    with pytest.raises(ValueError, match="must be positive"):
        inset_contour(Region("room", box(0, 0, 4, 4)), distance)


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=3, max_size=9),
    st.floats(0.05, 0.8),
    st.floats(-math.pi, math.pi),
)
def test_every_waypoint_keeps_its_distance(corners, distance, yaw):
    hull = shapely.MultiPoint(corners).convex_hull
    assume(hull.geom_type == "Polygon" and hull.area > 0.5)
    outline = Pose2(20.0, -10.0, yaw).apply_ring(tuple(hull.exterior.coords[:-1]))
    floor = shapely.Polygon(outline)
    for part in inset_contour(Region("room", outline), distance).parts:
        for corner in part:
            assert floor.contains(shapely.Point(corner))
            away = floor.exterior.distance(shapely.Point(corner))
            assert away == pytest.approx(distance, abs=1e-6)


def test_a_column_on_the_way_is_found():
    pillar = Solid("pillar", "column", box(0.8, 0.8, 1.2, 1.2), 0.0, 2.0)
    lamp = Solid("lamp", "column", box(2.8, 2.8, 3.2, 3.2), 1.9, 2.0)
    scene = Scene("s", (Region("room", box(0, 0, 4, 4)),), (), (pillar, lamp))
    contour = inset_contour(scene.regions[0], 0.6)
    found = too_close(scene, contour, 0.6, height=1.0)
    assert [(owner, round(away, 3)) for _, owner, away in found] == [("pillar", 0.283)]


def test_a_mission_survives_as_a_task_file(tmp_path):
    write_tasks(job(tmp_path))
    mission, _ = load_mission(tmp_path / "tasks/era/mission/rounds_task.yaml")
    assert [(w.id, w.x, w.y) for w in mission.waypoints] == [
        ("a", 1.5, 1.5), ("b", 3.8, 1.7), ("a", 1.5, 1.5),
    ]  # fmt: skip
    assert mission.waypoints[0].yaw == pytest.approx(math.atan2(1.2, 1.1), abs=1e-4)
    assert mission.waypoints[1].yaw == 0.5
