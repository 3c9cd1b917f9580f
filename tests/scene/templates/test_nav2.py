"""Nav2's parameters for a robot: values of the robot file, in the types that ROS takes."""

import math
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from grammars.model.robot_files import load_robot, read_robot
from grammars.text.documents import leaves, parse_yaml
from templates.nav2 import NAV2_FILE, nav2_files

WHOLE = {"default_server_timeout", "wait_for_service_timeout", "max_beams", "width", "height"}
WHOLE |= {"min_particles", "max_particles", "vx_samples", "vy_samples", "vtheta_samples"}
"""Parameters that Nav2 declares as integers; all other numbers are doubles."""


@pytest.fixture
def robot(campaigns):
    return lambda name: load_robot(campaigns / "robots" / f"{name}.yaml")


def written(robot, file="suts/nav2.yaml"):
    return parse_yaml(nav2_files(robot)[file], file).data


def parameters(robot, *nodes):
    section = written(robot)
    for node in nodes:
        section = section[node]
    return section["ros__parameters"]


def both_costmaps(robot):
    return [parameters(robot, *2 * [f"{name}_costmap"]) for name in ("global", "local")]


def test_a_differential_robot_is_taken_as_its_file_has_it(robot):
    courier = robot("courier")
    drive = parameters(courier, "controller_server")["FollowPath"]
    assert (drive["max_vel_x"], drive["max_vel_theta"]) == (0.8, 1.5)
    assert (drive["acc_lim_x"], drive["decel_lim_x"], drive["acc_lim_theta"]) == (1.0, -1.0, 3.0)
    assert {drive[key] for key in ("min_vel_y", "max_vel_y", "acc_lim_y", "decel_lim_y")} == {0.0}
    assert parameters(courier, "behavior_server")["max_rotational_vel"] == 1.5
    amcl = parameters(courier, "amcl")
    assert amcl["robot_model_type"] == "nav2_amcl::DifferentialMotionModel"
    assert (amcl["scan_topic"], amcl["laser_min_range"], amcl["laser_max_range"]) == (
        "scan",
        0.05,
        10.0,
    )
    for costmap in both_costmaps(courier):
        corners = parse_yaml(costmap["footprint"], "footprint").data
        assert [tuple(corner) for corner in corners] == list(courier.footprint)
        layers = costmap["obstacle_layer"], costmap["inflation_layer"]
        assert layers[0]["scan"]["topic"] == "/scan"
        assert layers[0]["scan"]["obstacle_max_range"] < layers[0]["scan"]["raytrace_max_range"]
        assert layers[1]["inflation_radius"] > math.hypot(0.25, 0.2)


def test_an_omnidirectional_robot_drives_sideways(robot):
    robile = robot("robile")
    drive = parameters(robile, "controller_server")["FollowPath"]
    assert (drive["max_vel_y"], drive["min_vel_y"]) == (robile.drive.max_vy, -robile.drive.max_vy)
    assert drive["acc_lim_y"] == robile.drive.max_ay
    assert drive["vy_samples"] > 1
    assert parameters(robile, "amcl")["robot_model_type"] == "nav2_amcl::OmniMotionModel"


def test_a_robot_without_limits_gets_careful_ones(robot):
    drive = parameters(robot("robile-planar-move"), "controller_server")["FollowPath"]
    assert 0.0 < drive["max_vel_x"] < 1.0
    assert 0.0 < drive["acc_lim_theta"] < math.inf


def test_the_local_costmap_holds_all_that_a_fast_robot_may_reach(robot):
    courier = robot("courier")
    fast = replace(courier, drive=replace(courier.drive, max_vx=2.0))
    for one in (courier, fast):
        ahead = one.drive.max_vx * parameters(one, "controller_server")["FollowPath"]["sim_time"]
        assert both_costmaps(one)[1]["width"] / 2 > ahead + math.hypot(0.25, 0.2)


def test_a_round_robot_has_a_radius(campaigns):
    text = (campaigns / "robots" / "courier.yaml").read_text()
    text = text.replace("{length: 0.5 m, width: 0.4 m}", "{radius: 0.22 m}")
    for costmap in both_costmaps(read_robot(parse_yaml(text, "round.yaml"))):
        assert costmap["robot_radius"] == 0.22
        assert "footprint" not in costmap


def test_every_laser_marks_obstacles_and_the_first_localises(robot):
    shuttle = robot("shuttle")
    assert parameters(shuttle, "amcl")["scan_topic"] == "scan_front"
    for costmap in both_costmaps(shuttle):
        layer = costmap["obstacle_layer"]
        assert layer["observation_sources"] == "scan_front scan_rear"
        assert layer["scan_rear"]["topic"] == "/scan_rear"


@pytest.mark.parametrize(
    ("laser", "odometry", "frequency"), [(10.0, 20.0, 20.0), (25.0, 50.0, 25.0), (10.0, 30.0, 10.0)]
)
def test_the_controller_answers_every_cycle(robot, laser, odometry, frequency):
    courier = robot("courier")
    odometry = replace(courier.odometry, rate=odometry)
    rated = replace(courier, laser=replace(courier.laser, rate=laser), odometry=odometry)
    assert parameters(rated, "controller_server")["controller_frequency"] == frequency
    assert parameters(rated, "behavior_server")["cycle_frequency"] == frequency
    assert written(rated, NAV2_FILE)["period"] == f"{1.0 / frequency} s"


@pytest.mark.parametrize("name", ["courier", "robile", "robile-planar-move", "shuttle"])
def test_numbers_have_the_types_that_nodes_declare(robot, name):
    """A node that declares a double does not come up with an integer, and the reverse."""
    for path, value in leaves(written(robot(name))):
        if isinstance(value, float | int) and not isinstance(value, bool):
            assert isinstance(value, int) == (path[-1] in WHOLE), path


def test_time_outs_bear_a_busy_machine_and_one_base_frame_is_used(robot):
    courier = robot("courier")
    assert parameters(courier, "bt_navigator")["default_server_timeout"] >= 500
    nodes = written(courier)
    managers = [section for node, section in nodes.items() if node.startswith("lifecycle_manager")]
    assert [manager["ros__parameters"]["bond_timeout"] for manager in managers] == [0.0, 0.0]
    base = {
        value for path, value in leaves(nodes) if path[-1] in ("base_frame_id", "robot_base_frame")
    }
    assert base == {written(courier, NAV2_FILE)["frames"]["base"]}


def test_all_nodes_are_started_managed_and_waited_for(robot):
    files = nav2_files(robot("courier"))
    launch = ElementTree.fromstring(files["suts/nav2.launch.xml"])
    started = [node.get("name") or node.get("exec") for node in launch.iter("node")]
    nodes = written(robot("courier"))
    managers = [name for name in started if name.startswith("lifecycle_manager")]
    managed = [
        name for manager in managers for name in nodes[manager]["ros__parameters"]["node_names"]
    ]
    assert managed == written(robot("courier"), NAV2_FILE)["ready"]
    assert sorted(started) == sorted([*managed, *managers])
