"""Files of robots and missions, read into SI units."""

import json
import math

import pytest

from grammars.model.mission_files import load_mission
from grammars.model.robot import Robot
from grammars.model.robot_files import load_robot
from grammars.text import codec
from tests.languages.errors.goldens import renew
from tests.languages.plans import HERE, model_text

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


def described(path):
    """Return a robot or a mission in SI units, a line for each number."""
    if "mission" in path.name:
        mission, _ = load_mission(path)
        return "".join(f"{one}\n" for one in (mission.start, *mission.waypoints))
    robot = load_robot(path)
    corners = [" ".join(f"{round(x, 6) + 0.0:g}" for x in point) for point in robot.footprint]
    parts = (robot.name, ", ".join(corners), robot.height, robot.mass, robot.drive)
    return "".join(f"{one}\n" for one in (*parts, *robot.lasers, robot.odometry))


def test_files_are_read_into_si_units(golden, tmp_path):
    golden("robots.txt", renew(HERE / "robots.txt", tmp_path / "files", described))


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
