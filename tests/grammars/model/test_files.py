import math
from pathlib import Path

import pytest

from grammars.model.files import load_mission, load_robot
from grammars.model.geometry import Pose2
from grammars.model.robot import Robot
from grammars.text import codec
from grammars.text.diagnostics import InputError

ROBOT = """\
robot: box
footprint: {length: 0.6 m, width: 0.4 m}
height: 0.3 m
mass: 40 kg
drive: {kind: differential, max_vx: 1 m/s, max_wz: 1 rad/s, max_ax: 1 m/s^2, max_az: 2 rad/s^2,
        max_force: 200 N, max_torque: 50 N m}
laser: {mount: {x: 0.2 m}, z: 0.2 m, angle_min: -90 deg, angle_max: 90 deg, rays: 181,
        range_min: 5 cm, range_max: 10 m, rate: 10 Hz}
odometry: {rate: 20 Hz}
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "file.yaml"
    path.write_text(text)
    return path


def test_a_robot_file_is_read_into_si_units(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, ROBOT))
    assert robot.name == "box"
    assert robot.footprint[0] == pytest.approx((0.3, 0.2))
    assert robot.laser.angle_max == pytest.approx(math.pi / 2)
    assert robot.drive.timeout == 0.0


def test_a_round_robot_is_a_polygon_on_its_circle(tmp_path: Path) -> None:
    text = ROBOT.replace("length: 0.6 m, width: 0.4 m", "radius: 0.3 m")
    ring = load_robot(write(tmp_path, text)).footprint
    assert ring[0] == (0.3, 0.0)
    assert all(math.isclose(math.hypot(x, y), 0.3) for x, y in ring)
    assert len(set(ring)) == 32


def test_footprint_corners_come_out_counter_clockwise(tmp_path: Path) -> None:
    corners = "corners: [[0 m, 0 m], [0 m, 1 m], [1 m, 1 m], [1 m, 0 m]]"
    text = ROBOT.replace("length: 0.6 m, width: 0.4 m", corners)
    ring = load_robot(write(tmp_path, text)).footprint
    area = sum(ring[i - 1][0] * p[1] - p[0] * ring[i - 1][1] for i, p in enumerate(ring)) / 2
    assert area == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rays: 181", "rays: 1", "rays: must be greater than or equal to 2"),
        ("kind: differential", "kind: tracked", "'omnidirectional' or 'differential'"),
        ("max_vx: 1 m/s", "max_vx: 1 m", "max_vx: .* expected a speed"),
        ("width: 0.4 m", "", "length.*width.*radius.*corners"),
        ("width: 0.4 m", "radius: 0.3 m", "length.*width.*radius.*corners"),
        ("angle_max: 90 deg", "angle_max: -91 deg", "angle_max must be above"),
        ("range_max: 10 m", "range_max: 1 cm", "range_max must be above"),
        ("robot: box", "robot: ../box", "robot: must be letters"),
        ("odometry:", "odometrie:", 'did you mean "odometry"'),
        ("max_force: 200 N, ", "", "a drive by motors needs max_force"),
        ("max_torque: 50 N m", "max_torque: 50 N m, friction_loss: 1 cm/s", "for .law: imposed"),
        ("kind: diff", "law: imposed, kind: diff", "no max_ax, max_az, max_force, max_torque"),
        ("rate: 20 Hz", "rate: 20 Hz, period: 51 ms", 'give "rate" or "period"'),
        ("{rate: 20 Hz}", "{}", 'give "rate" or "period"'),
        ("rate: 20 Hz", "period: 51", "period: 51 has no unit"),
    ],
)
def test_a_wrong_robot_value_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_robot(write(tmp_path, ROBOT.replace(old, new)))


def test_a_dented_footprint_is_refused(tmp_path: Path) -> None:
    corners = "corners: [[0 m, 0 m], [1 m, 0 m], [0.2 m, 0.2 m], [0 m, 1 m]]"
    with pytest.raises(InputError, match="not convex"):
        load_robot(write(tmp_path, ROBOT.replace("length: 0.6 m, width: 0.4 m", corners)))


def test_the_robot_the_paper_simulated_has_no_limits(campaigns: Path) -> None:
    robot = load_robot(campaigns / "robots" / "robile-planar-move.yaml")
    drive, odometry = robot.drive, robot.odometry
    assert drive.law == "imposed"
    assert {drive.max_vx, drive.max_wz, drive.max_ax, drive.max_force} == {math.inf}
    assert (odometry.period, odometry.rate) == (0.051, pytest.approx(19.607843))
    assert codec.from_json(Robot, codec.to_json(robot)) == robot


def test_the_robot_of_the_paper_has_its_published_size(campaigns: Path) -> None:
    robot = load_robot(campaigns / "robots" / "robile.yaml")
    xs, ys = zip(*robot.footprint, strict=True)
    assert max(xs) - min(xs) == pytest.approx(0.699)
    assert max(ys) - min(ys) == pytest.approx(0.466)


def test_a_mission_reads_task_files_of_navigation_stacks(tmp_path: Path) -> None:
    text = "waypoints:\n  - {id: a, x: 1, y: 2, yaw: 0.5, z: 0}\n  - {x: 3.5, y: -1}\n"
    mission, _ = load_mission(write(tmp_path, text))
    assert mission.start == Pose2()
    assert [(w.id, w.x, w.y, w.yaw) for w in mission.waypoints] == [
        ("a", 1.0, 2.0, 0.5),
        ("waypoint-2", 3.5, -1.0, None),
    ]


def test_a_mission_takes_units_too(tmp_path: Path) -> None:
    text = "start: {x: 50 cm, y: 0, yaw: 90 deg}\nwaypoints: [{x: 1 m, y: 2 m}]\n"
    mission, _ = load_mission(write(tmp_path, text))
    assert mission.start.x == pytest.approx(0.5)
    assert mission.start.yaw == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("value", [".nan", ".inf", "north", "3 s", "true"])
def test_a_coordinate_that_is_no_length_is_refused(tmp_path: Path, value: str) -> None:
    with pytest.raises(InputError, match=r"file\.yaml:1:\d+: x: "):
        load_mission(write(tmp_path, f"waypoints: [{{x: {value}, y: 0}}]"))


def test_the_published_missions_load(reference_data: Path) -> None:
    lengths = {
        path.name: len(load_mission(path)[0].waypoints)
        for path in sorted((reference_data / "missions").glob("*.yaml"))
    }
    assert lengths == {
        "left_long_corridor_task.yaml": 5,
        "task_1.yaml": 1,
        "task_2.yaml": 5,
        "task_3.yaml": 2,
        "task_4.yaml": 10,
    }
