"""Files of robots and missions, read into SI units."""

import json
import math

import pytest

from grammars.model.geometry import Pose2
from grammars.model.mission_files import load_mission
from grammars.model.robot import Robot
from grammars.model.robot_files import load_robot
from grammars.text import codec
from tests.languages.plans import model_text

ROBOT = model_text("box.yaml")


TWO_LASERS = ROBOT.replace(
    "laser: {mount",
    """lasers:
  - {name: rear, mount: {x: -0.2 m, yaw: 180 deg}, z: 0.3 m, angle_min: -45 deg, angle_max: 45 deg,
     rays: 91, range_min: 5 cm, range_max: 6 m, rate: 15 Hz}
  - {name: front, mount""",
)


def write(folder, text):
    path = folder / "file.yaml"
    path.write_text(text)
    return path


def test_a_robot_file_is_read_into_si_units(tmp_path):
    robot = load_robot(write(tmp_path, ROBOT))
    assert robot.name == "box"
    assert robot.footprint[0] == pytest.approx((0.3, 0.2))
    assert robot.laser.angle_max == pytest.approx(math.pi / 2)
    assert robot.drive.timeout == 0.0


def test_a_round_robot_is_a_polygon_on_its_circle(tmp_path):
    text = ROBOT.replace("length: 0.6 m, width: 0.4 m", "radius: 0.3 m")
    ring = load_robot(write(tmp_path, text)).footprint
    assert ring[0] == (0.3, 0.0)
    assert all(math.isclose(math.hypot(x, y), 0.3) for x, y in ring)
    assert len(set(ring)) == 32


def test_footprint_corners_come_out_counter_clockwise(tmp_path):
    corners = "corners: [[0 m, 0 m], [0 m, 1 m], [1 m, 1 m], [1 m, 0 m]]"
    text = ROBOT.replace("length: 0.6 m, width: 0.4 m", corners)
    ring = load_robot(write(tmp_path, text)).footprint
    area = sum(ring[i - 1][0] * p[1] - p[0] * ring[i - 1][1] for i, p in enumerate(ring)) / 2
    assert area == pytest.approx(1.0)


def test_several_lasers_are_told_apart_by_their_names(tmp_path):
    robot = load_robot(write(tmp_path, TWO_LASERS))
    assert [laser.name for laser in robot.lasers] == ["rear", "front"]
    assert robot.laser is robot.lasers[0]
    rear, front = robot.lasers
    assert (rear.rays, front.rays, rear.rate) == (91, 181, 15.0)
    assert rear.mount.yaw == pytest.approx(math.pi)
    assert (front.topic, front.frame, front.label) == ("scan_front", "laser_front", "laser front")
    assert codec.from_json(Robot, codec.to_json(robot), exactly=True) == robot


def test_a_robot_with_one_laser_is_written_as_before_lasers_had_names(tmp_path):
    robot = load_robot(write(tmp_path, ROBOT))
    assert (robot.laser.topic, robot.laser.frame) == ("scan", "laser")
    plain = codec.to_plain(robot)
    assert "other_lasers" not in plain
    assert "name" not in plain["laser"]
    assert codec.from_json(Robot, json.dumps(plain)) == robot


@pytest.mark.parametrize("names", [("front", "front"), ("", "rear"), ("front", "")])
def test_a_robot_from_outside_has_lasers_with_names(tmp_path, names):
    plain = codec.to_plain(load_robot(write(tmp_path, TWO_LASERS)))
    for laser, name in zip((plain["laser"], *plain["other_lasers"]), names, strict=True):
        laser |= {"name": name} if name else {}
        if not name:
            del laser["name"]
    with pytest.raises(ValueError, match="each of several lasers needs a name of its own"):
        codec.from_json(Robot, json.dumps(plain))


@pytest.mark.parametrize("name", ["a b", "Front", "../x", "a" * 41, "front\n", "0"])
def test_a_name_that_no_topic_can_have_is_refused(tmp_path, name):
    plain = codec.to_plain(load_robot(write(tmp_path, TWO_LASERS)))
    plain["laser"]["name"] = name
    with pytest.raises(ValueError, match="name"):
        codec.from_json(Robot, json.dumps(plain))


def test_the_robot_the_paper_simulated_has_no_limits(campaigns):
    robot = load_robot(campaigns / "robots" / "robile-planar-move.yaml")
    drive, odometry = robot.drive, robot.odometry
    assert drive.law == "imposed"
    assert {drive.max_vx, drive.max_wz, drive.max_ax, drive.max_force} == {math.inf}
    assert (odometry.period, odometry.rate) == (0.051, pytest.approx(19.607843))
    assert codec.from_json(Robot, codec.to_json(robot)) == robot


def test_a_mission_reads_task_files_of_navigation_stacks(tmp_path):
    text = "waypoints:\n  - {id: a, x: 1, y: 2, yaw: 0.5, z: 0}\n  - {x: 3.5, y: -1}\n"
    mission, _ = load_mission(write(tmp_path, text))
    assert mission.start == Pose2()
    assert [(w.id, w.x, w.y, w.yaw) for w in mission.waypoints] == [
        ("a", 1.0, 2.0, 0.5),
        ("waypoint-2", 3.5, -1.0, None),
    ]


def test_a_mission_takes_units_too(tmp_path):
    text = "start: {x: 50 cm, y: 0, yaw: 90 deg}\nwaypoints: [{x: 1 m, y: 2 m}]\n"
    mission, _ = load_mission(write(tmp_path, text))
    assert mission.start.x == pytest.approx(0.5)
    assert mission.start.yaw == pytest.approx(math.pi / 2)
