"""Nav2's parameters for a robot: values of the robot file, in the types that ROS takes."""

import difflib
import math
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from grammars.model.robot_files import load_robot, read_robot
from grammars.text.documents import leaves, parse_yaml
from templates.nav2 import NAV2_FILE, nav2_files
from tests.parts import ROOT

WHOLE = {"default_server_timeout", "wait_for_service_timeout", "max_beams", "width", "height"}
WHOLE |= {"min_particles", "max_particles", "vx_samples", "vy_samples", "vtheta_samples"}
"""Parameters that Nav2 declares as integers; all other numbers are doubles."""
ROBOTS = ROOT / "campaigns" / "robots"
COURIER = load_robot(ROBOTS / "courier.yaml")


def round_robot():
    text = (ROBOTS / "courier.yaml").read_text()
    text = text.replace("{length: 0.5 m, width: 0.4 m}", "{radius: 0.22 m}")
    return read_robot(parse_yaml(text, "round.yaml"))


def parsed(robot, file="suts/nav2.yaml"):
    return parse_yaml(nav2_files(robot)[file], file).data


def parameters(robot, node):
    return parsed(robot)[node]["ros__parameters"]


def test_files_of_a_differential_robot(golden):
    files = nav2_files(COURIER).items()
    golden("exports/nav2.txt", "\n".join(f"=== {name}\n{text}" for name, text in files))


def test_other_robots_differ_in_what_their_files_say(golden):
    """An omnidirectional one, one without limits, one with two lasers, a round one."""
    robots = [load_robot(ROBOTS / f"{n}.yaml") for n in ("robile", "robile-planar-move", "shuttle")]
    courier = nav2_files(COURIER)["suts/nav2.yaml"].splitlines()
    lines = []
    for robot in (*robots, replace(round_robot(), name="round")):
        others = nav2_files(robot)["suts/nav2.yaml"].splitlines()
        lines += difflib.unified_diff(courier, others, "courier", robot.name, n=0, lineterm="")
    golden("exports/nav2-differences.txt", "\n".join(lines) + "\n")


def test_the_local_costmap_holds_all_that_a_fast_robot_may_reach():
    fast = replace(COURIER, drive=replace(COURIER.drive, max_vx=2.0))
    for robot in (COURIER, fast):
        follow = parameters(robot, "controller_server")["FollowPath"]
        ahead = robot.drive.max_vx * follow["sim_time"]
        costmap = parsed(robot)["local_costmap"]["local_costmap"]["ros__parameters"]
        assert costmap["width"] / 2 > ahead + math.hypot(0.25, 0.2)


@pytest.mark.parametrize(
    ("laser", "odometry", "frequency"), [(10.0, 20.0, 20.0), (25.0, 50.0, 25.0), (10.0, 30.0, 10.0)]
)
def test_the_controller_answers_every_cycle(laser, odometry, frequency):
    odometry = replace(COURIER.odometry, rate=odometry)
    rated = replace(COURIER, laser=replace(COURIER.laser, rate=laser), odometry=odometry)
    assert parameters(rated, "controller_server")["controller_frequency"] == frequency
    assert parameters(rated, "behavior_server")["cycle_frequency"] == frequency
    assert parsed(rated, NAV2_FILE)["period"] == f"{1.0 / frequency} s"


@pytest.mark.parametrize("name", ["courier", "robile", "robile-planar-move", "shuttle"])
def test_numbers_have_the_types_that_nodes_declare(name):
    """A node that declares a double does not come up with an integer, and the reverse."""
    for path, value in leaves(parsed(load_robot(ROBOTS / f"{name}.yaml"))):
        if isinstance(value, float | int) and not isinstance(value, bool):
            assert isinstance(value, int) == (path[-1] in WHOLE), path


def test_all_nodes_are_started_managed_and_waited_for_and_share_a_base_frame():
    launch = ElementTree.fromstring(nav2_files(COURIER)["suts/nav2.launch.xml"])
    started = [node.get("name") or node.get("exec") for node in launch.iter("node")]
    nodes, sut = parsed(COURIER), parsed(COURIER, NAV2_FILE)
    managers = [name for name in started if name.startswith("lifecycle_manager")]
    managed = [n for manager in managers for n in nodes[manager]["ros__parameters"]["node_names"]]
    assert managed == sut["ready"]
    assert sorted(started) == sorted([*managed, *managers])
    frames = {v for path, v in leaves(nodes) if path[-1] in ("base_frame_id", "robot_base_frame")}
    assert frames == {sut["frames"]["base"]}
