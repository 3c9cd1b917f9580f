"""What campaigns exercise: features, doors, and areas of floor against geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.coverage import (
    Coverage,
    planned_coverage,
    run_coverage,
    sum_coverage,
    trace_coverage,
)
from daemon.campaign import expand, load_campaign
from daemon.run import execute
from daemon.trace import TraceWriter, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Mount
from grammars.model.scene import Region, Scene, Solid
from grammars.text import codec
from tests.engine.judging.traces import CORRIDOR, along, box, make_trace, mission
from tests.engine.trace.recordings import RAYS, ROBOT, specification


def test_the_papers_campaign_has_the_objectives_and_dynamics_of_section_4(campaigns, golden):
    """Of its 40 runs S3.1 to S3.4 have doors that a robot triggers, S2 has doors on a clock."""
    submission = expand(load_campaign(campaigns / "ortega2024" / "paper.yaml"))
    paper = planned_coverage(submission.specs, submission.scenes)
    assert paper.runs == 40
    golden("paper.txt", "".join(f"{one.feature} {one.planned}\n" for one in paper.features))


@pytest.mark.parametrize("rate", [1.0, 20.0, 100.0])
def test_rooms_are_crossed_at_any_rate_of_poses(rate):
    west, east = box(-1.0, -1.0, 5.0, 1.0), box(5.0, -1.0, 11.0, 1.0)
    scene = replace(CORRIDOR, regions=(Region("west", west), Region("east", east)))
    motion = along(np.arange(12.0 * rate) / rate, speed=0.75)
    trace = make_trace(motion, scene=scene, goal=mission((8.0, 0.0)))
    features = {f.feature: f for f in sum_coverage([run_coverage(trace)]).features}
    reach = features["mission/reach/across-rooms"]
    assert (reach.planned, reach.done) == (1, 1)


def test_a_recorded_run_tells_what_happened_not_what_was_planned(campaigns, tmp_path, golden):
    """In this run of the demonstration doors shut in the robot's face."""
    submission = expand(load_campaign(campaigns / "demo" / "campaign.yaml"))
    spec = next(run for run in submission.specs if run.scenario == "rude-house")
    path, junk = tmp_path / "rude.mcap", tmp_path / "junk.mcap"
    execute(spec, submission.scenes[0], trace_path=path)
    junk.write_bytes(b"nothing of the kind")
    found = trace_coverage([junk, path], near=1.2)
    assert (found.runs, found.recorded) == (1, 1)
    # Traces count, not plans.
    lines = [
        f"{one.feature} {one.planned} {one.done} {found.exercised(one)}" for one in found.features
    ]
    for door in found.doors:
        place = "near" if door.nearest < 1.2 else "far"
        lines.append(f"{door.door} {door.planned} {door.triggered} {door.moved} {place}")
    golden("rude.txt", "\n".join([*lines, ""]))
    (floor,) = found.floor
    assert 0.0 < floor.driven < floor.seen <= floor.free
    assert codec.from_json(Coverage, codec.to_json(found)) == found
    (unreadable,) = found.unreadable
    assert unreadable.trace == str(junk)
    assert unreadable.problem


WALL = Solid("wall", "wall", box(4.0, 0.0, 4.2, 4.0), 0.0, 2.5)
ROOMS = (Region("west", box(0.0, 0.0, 4.0, 4.0)), Region("east", box(4.2, 0.0, 8.2, 4.0)))
HALL = Scene("hall", ROOMS, (), (WALL,))
"""Two rooms of 4 m by 4 m side by side, a wall without a door between them."""
MIDDLE = Pose2(2.0, 2.0)
REACH = ROBOT.laser.range_max


@pytest.fixture
def floor(tmp_path):
    """The floor of two runs with these poses, a tenth of a second apart.

    Each ray of each laser reads the same at each of them.
    """

    def cover(reading, *poses, robot=ROBOT, scans=True):
        path = record(tmp_path / "run.mcap", poses, reading, robot)
        (area,) = sum_coverage([run_coverage(read_trace(path, scans=scans))] * 2).floor
        return area

    return cover


def record(path, poses, reading, robot=ROBOT):
    with TraceWriter(path, specification(HALL, robot=robot), HALL) as trace:
        trace.static(OccupancyGrid(0.5, 0.0, 0.0, np.zeros((4, 20), np.int8)))
        for step, pose in enumerate(poses):
            trace.ground_truth(0.1 * step, pose, Twist2(0.5))
            for laser in robot.lasers:
                names = [laser.name] if robot.other_lasers else []
                trace.scan(0.1 * step, np.full(RAYS, reading, np.float32), *names)
        trace.close("finished", "")
    return path


def test_areas_are_what_geometry_says(floor):
    """The robot goes on for 2 m through the western room and sees 1 m far all the time."""
    area = floor(1.0, *(Pose2(1.0 + 0.05 * step, 2.0) for step in range(41)))
    west, east = area.rooms
    assert (west.free, east.free, area.free, area.runs) == (16.0, 16.0, 32.0, 2)
    # 2 m of way with a footprint of 0.6 m by 0.4 m.
    assert west.driven == pytest.approx(2.6 * 0.4, rel=0.1)
    assert (east.seen, east.driven) == (0.0, 0.0)
    # Half a disc of 1 m and what it sweeps in 2 m, less what the laser cannot see beside it.
    assert math.pi / 2 < west.seen < math.pi / 2 + 2.0 * 2.0
    assert west.seen == area.seen


@pytest.mark.parametrize("corners", [ROBOT.footprint, ROBOT.footprint[::-1]])
def test_a_footprint_covers_the_cells_whose_centre_it_covers(floor, corners):
    robot = replace(ROBOT, footprint=corners)
    turned = Pose2(2.0, 2.0, math.pi / 2)
    assert floor(1.0, turned, robot=robot).driven == pytest.approx(0.6 * 0.4)


@pytest.mark.parametrize(
    ("reading", "seen"), [(math.nan, 0.0), (-math.inf, 0.0), (math.inf, REACH), (99.0, REACH)]
)
def test_rays_that_met_nothing_look_as_far_as_the_laser_and_lost_ones_nowhere(floor, reading, seen):
    area = floor(reading, MIDDLE).seen
    assert area == floor(seen or math.nan, MIDDLE).seen
    assert (area > 0.0) == (seen > 0.0)


def test_a_trace_without_scans_has_seen_nothing(floor):
    area = floor(1.0, MIDDLE, scans=False)
    assert area.seen == 0.0
    assert area.driven > 0.0


def test_a_robot_that_leaves_the_building_covers_the_part_in_it(floor):
    area = floor(1.0, Pose2(-0.1, 0.1))
    assert 0.0 < area.driven < 0.6 * 0.4
    assert 0.0 < area.seen < math.pi / 2


def test_a_laser_sees_where_it_looks(floor):
    """Beside the southern wall there is floor to the left, and none to the right."""
    left, right = (
        replace(ROBOT.laser, angle_min=start, angle_max=start + 1.5) for start in (0.0, -1.5)
    )
    areas = [
        floor(1.0, Pose2(2.0, 0.05), robot=replace(ROBOT, laser=laser)).seen
        for laser in (left, right)
    ]
    assert areas[1] < 0.2 * areas[0]


def test_each_laser_sees(floor):
    laser = replace(ROBOT.laser, mount=Mount(0.0), angle_min=0.0, angle_max=1.5)
    rear = replace(laser, name="rear", mount=Mount(0.0, 0.0, math.pi))
    one = replace(ROBOT, laser=laser)
    both = replace(ROBOT, laser=replace(laser, name="front"), other_lasers=(rear,))
    twice = 2.0 * floor(1.5, MIDDLE, robot=one).seen
    assert floor(1.5, MIDDLE, robot=both).seen == pytest.approx(twice, rel=0.1)


def test_a_trace_that_cannot_be_trusted_is_told_and_counts_for_nothing(tmp_path):
    path = record(tmp_path / "run.mcap", [MIDDLE, Pose2(math.nan, 2.0)], 1.0)
    found = trace_coverage([path])
    assert (found.runs, found.floor) == (0, ())
    assert "not a number" in found.unreadable[0].problem
