"""Floor seen and driven on: areas against geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.coverage import run_coverage, sum_coverage, trace_coverage
from daemon.trace import TraceWriter, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Mount
from grammars.model.scene import Region, Scene, Solid
from tests.engine.judging.traces import box
from tests.engine.trace.recordings import RAYS, ROBOT, specification

WALL = Solid("wall", "wall", box(4.0, 0.0, 4.2, 4.0), 0.0, 2.5)
ROOMS = (Region("west", box(0.0, 0.0, 4.0, 4.0)), Region("east", box(4.2, 0.0, 8.2, 4.0)))
HALL = Scene("hall", ROOMS, (), (WALL,))
"""Two rooms of 4 m by 4 m side by side, a wall without a door between them."""
REACH = ROBOT.laser.range_max


def record(path, poses, reading, robot=ROBOT):
    """Record poses a tenth of a second apart at which each ray of each laser reads the same."""
    with TraceWriter(path, specification(HALL, robot=robot), HALL) as trace:
        trace.static(OccupancyGrid(0.5, 0.0, 0.0, np.zeros((4, 20), np.int8)))
        for step, pose in enumerate(poses):
            trace.ground_truth(0.1 * step, pose, Twist2(0.5))
            for laser in robot.lasers:
                name = laser.name if robot.other_lasers else ""
                trace.scan(0.1 * step, np.full(RAYS, reading, np.float32), *filter(None, [name]))
        trace.close("finished", "")
    return path


def floor(path, *, scans=True):
    trace = read_trace(path, scans=scans)
    (area,) = sum_coverage([run_coverage(trace)] * 2).floor
    return area


def test_areas_are_what_geometry_says(tmp_path):
    """The robot goes on for 2 m through the western room and sees 1 m far all the time."""
    poses = [Pose2(1.0 + 0.05 * step, 2.0) for step in range(41)]
    area = floor(record(tmp_path / "run.mcap", poses, 1.0))
    west, east = area.rooms
    assert (west.free, east.free, area.free, area.runs) == (16.0, 16.0, 32.0, 2)
    # 2 m of way with a footprint of 0.6 m by 0.4 m.
    assert west.driven == pytest.approx(2.6 * 0.4, rel=0.1)
    assert (east.seen, east.driven) == (0.0, 0.0)
    # Half a disc of 1 m and what it sweeps in 2 m, less what the laser cannot see beside it.
    assert math.pi / 2 < west.seen < math.pi / 2 + 2.0 * 2.0
    assert west.seen == area.seen


def test_a_footprint_covers_the_cells_whose_centre_it_covers_whichever_way_it_turns(tmp_path):
    for corners in (ROBOT.footprint, ROBOT.footprint[::-1]):
        robot = replace(ROBOT, footprint=corners)
        path = record(tmp_path / "run.mcap", [Pose2(2.0, 2.0, math.pi / 2)], 1.0, robot)
        assert floor(path).driven == pytest.approx(0.6 * 0.4)


@pytest.mark.parametrize(
    ("reading", "seen"), [(math.nan, 0.0), (-math.inf, 0.0), (math.inf, REACH), (99.0, REACH)]
)
def test_rays_that_met_nothing_look_as_far_as_the_laser_and_lost_ones_nowhere(
    tmp_path, reading, seen
):
    areas = [
        floor(record(tmp_path / f"{name}.mcap", [Pose2(2.0, 2.0)], value)).seen
        for name, value in (("run", reading), ("clear", seen or math.nan))
    ]
    assert areas[0] == areas[1]
    assert (areas[0] > 0.0) == (seen > 0.0)


def test_a_trace_without_scans_has_seen_nothing(tmp_path):
    area = floor(record(tmp_path / "run.mcap", [Pose2(2.0, 2.0)], 1.0), scans=False)
    assert area.seen == 0.0
    assert area.driven > 0.0


def test_a_robot_that_leaves_the_building_covers_what_is_in_it(tmp_path):
    area = floor(record(tmp_path / "run.mcap", [Pose2(-0.1, 0.1)], 1.0))
    assert 0.0 < area.driven < 0.6 * 0.4
    assert 0.0 < area.seen < math.pi / 2


def test_what_any_laser_saw_was_seen(tmp_path):
    laser = replace(ROBOT.laser, mount=Mount(0.0), angle_min=0.0, angle_max=1.5)
    rear = replace(laser, name="rear", mount=Mount(0.0, 0.0, math.pi))
    both = replace(ROBOT, laser=replace(laser, name="front"), other_lasers=(rear,))
    one, two = (
        floor(record(tmp_path / "run.mcap", [Pose2(2.0, 2.0)], 1.5, robot)).seen
        for robot in (replace(ROBOT, laser=laser), both)
    )
    assert two == pytest.approx(2.0 * one, rel=0.1)


def test_a_trace_that_cannot_be_trusted_is_told_and_counts_for_nothing(tmp_path):
    path = record(tmp_path / "run.mcap", [Pose2(2.0, 2.0), Pose2(math.nan, 2.0)], 1.0)
    found = trace_coverage([path])
    assert (found.runs, found.floor) == (0, ())
    (one,) = found.unreadable
    assert "not a number" in one.problem
