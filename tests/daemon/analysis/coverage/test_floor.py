"""Floor seen and driven on: kernels against plain versions, areas against geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.analysis.coverage import (
    contains_point,
    covered_cells,
    floor_area,
    floor_grid,
    paint_footprints,
    paint_rays,
    room_cells,
)
from daemon.trace import TraceWriter, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Mount
from grammars.model.scene import Region, Scene, Solid
from tests.daemon.trace.recordings import RAYS, ROBOT, specification

RING = np.array([(0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.35, -0.2)])
POSE = st.tuples(st.floats(-1.0, 4.0), st.floats(-1.0, 4.0), st.floats(-math.pi, math.pi))


def plain_rays(shape, poses, ranges, angle_min, step, range_max, resolution=0.1):
    """Every half a cell along every ray, by the words of the kernel's docstring."""
    cells = np.zeros(shape, np.bool_)
    for (x, y, yaw), scan in zip(poses, ranges, strict=True):
        for k, reading in enumerate(scan):
            reach = min(float(reading), range_max)
            if math.isnan(reach) or reach <= 0.0:
                continue
            for j in range(int(reach / (resolution / 2)) + 1):
                along, angle = resolution / 2 * j, yaw + angle_min + k * step
                row = math.floor((y + along * math.sin(angle)) / resolution)
                column = math.floor((x + along * math.cos(angle)) / resolution)
                if 0 <= row < shape[0] and 0 <= column < shape[1]:
                    cells[row, column] = True
    return cells


def plain_footprints(shape, poses, ring, resolution=0.1):
    """Every cell whose centre, seen from the base, is to the left of every edge."""
    cells = np.zeros(shape, np.bool_)
    edges = list(zip(ring, np.roll(ring, -1, axis=0), strict=True))
    for pose in poses:
        base = Pose2(*pose).inverse()
        for row, column in np.ndindex(shape):
            x, y = base.apply(((column + 0.5) * resolution, (row + 0.5) * resolution))
            if all((b - a)[0] * (y - a[1]) - (b - a)[1] * (x - a[0]) >= 0.0 for a, b in edges):
                cells[row, column] = True
    return cells


@given(
    st.lists(POSE, min_size=1, max_size=3),
    st.lists(
        st.one_of(st.floats(0.0, 5.0, width=32), st.sampled_from([math.inf, -math.inf, math.nan])),
        min_size=4,
        max_size=4,
    ),
)
def test_rays_are_painted_as_the_plain_version_does(poses, readings):
    ranges = np.array([readings] * len(poses), np.float32)
    cells = np.zeros((30, 28), np.bool_)
    paint_rays(cells, 0.0, 0.0, 0.1, np.array(poses), ranges, -1.0, 0.7, 3.0)
    assert np.array_equal(cells, plain_rays(cells.shape, poses, ranges, -1.0, 0.7, 3.0))


@given(st.lists(POSE, min_size=1, max_size=2))
def test_footprints_are_painted_as_the_plain_version_does(poses):
    cells = np.zeros((30, 28), np.bool_)
    paint_footprints(cells, 0.0, 0.0, 0.1, np.array(poses), RING, 0.45)
    plain = plain_footprints(cells.shape, poses, RING)
    # A centre on the very outline may fall on either side by rounding.
    assert (cells != plain).sum() <= 1


@given(st.lists(st.tuples(st.floats(-1, 3), st.floats(-1, 3)), min_size=3, max_size=7))
def test_cells_of_a_room_are_those_with_their_centre_inside(ring):
    grid = OccupancyGrid(0.5, -1.0, -1.0, np.zeros((7, 8), np.int8))
    cells = room_cells(grid, Region("room", tuple(ring)))
    for row, column in np.ndindex(cells.shape):
        centre = (-1.0 + (column + 0.5) * 0.5, -1.0 + (row + 0.5) * 0.5)
        assert cells[row, column] == contains_point(tuple(ring), centre)


def hall():
    """Two rooms of 4 m by 4 m side by side, a wall without a door between them."""
    rooms = (
        Region("west", ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))),
        Region("east", ((4.2, 0.0), (8.2, 0.0), (8.2, 4.0), (4.2, 4.0))),
    )
    wall = ((4.0, 0.0), (4.2, 0.0), (4.2, 4.0), (4.0, 4.0))
    return Scene("hall", rooms, (), (Solid("wall", "wall", wall, 0.0, 2.5),))


@pytest.fixture
def driven(tmp_path):
    """A run straight on for 2 m through the western room that sees 1 m far all the time."""
    world = hall()
    with TraceWriter(tmp_path / "run.mcap", specification(world), world) as trace:
        trace.static(OccupancyGrid(0.5, 0.0, 0.0, np.zeros((4, 20), np.int8)))
        for step in range(41):
            now = step * 0.1
            trace.ground_truth(now, Pose2(1.0 + 0.5 * now, 2.0), Twist2(0.5))
            trace.scan(now, np.full(RAYS, 1.0, np.float32))
        trace.close("finished", "")
    return tmp_path / "run.mcap"


def test_areas_are_what_geometry_says(driven):
    trace = read_trace(driven, scans=True)
    grid = floor_grid(trace.scene, 0.25)
    area = floor_area(trace.scene, grid, [covered_cells(grid, trace)])
    west, east = area.rooms
    assert (west.free, east.free, area.free) == (16.0, 16.0, 32.0)
    # 2 m of way with a footprint of 0.6 m by 0.4 m.
    assert west.driven == pytest.approx(2.6 * 0.4, rel=0.1)
    assert (east.seen, east.driven) == (0.0, 0.0)
    # Half a disc of 1 m and what it sweeps in 2 m, less what the laser cannot see beside it.
    assert math.pi / 2 < west.seen < math.pi / 2 + 2.0 * 2.0
    assert west.seen == area.seen


def test_a_trace_without_scans_has_seen_nothing(driven):
    trace = read_trace(driven)
    grid = floor_grid(trace.scene, 0.25)
    cover = covered_cells(grid, trace)
    area = floor_area(trace.scene, grid, [cover, cover])
    assert area.seen == 0.0
    assert area.driven > 0.0
    assert area.runs == 2


def test_what_any_laser_saw_was_seen(tmp_path):
    laser = replace(ROBOT.laser, mount=Mount(0.0), angle_min=0.0, angle_max=1.5)
    rear = replace(laser, name="rear", mount=Mount(0.0, 0.0, math.pi))
    both = replace(ROBOT, laser=replace(laser, name="front"), other_lasers=(rear,))
    areas = []
    for robot in (replace(ROBOT, laser=laser), both):
        world = hall()
        path = tmp_path / "run.mcap"
        with TraceWriter(path, specification(world, robot=robot), world) as trace:
            trace.static(OccupancyGrid(0.5, 0.0, 0.0, np.zeros((4, 20), np.int8)))
            trace.ground_truth(0.0, Pose2(2.0, 2.0), Twist2())
            for one in robot.lasers:
                trace.scan(0.0, np.full(RAYS, 1.5, np.float32), one.name)
            trace.close("finished", "")
        read = read_trace(path, scans=True)
        grid = floor_grid(read.scene, laser.z)
        areas.append(floor_area(read.scene, grid, [covered_cells(grid, read)]).seen)
    assert areas[1] == pytest.approx(2.0 * areas[0], rel=0.1)
