"""``scenario sut``: what a system is made of, whether a stack hears what it must, and the relay."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daemon.model.sut import SutFailure
from daemon.stacks import ros2
from daemon.stacks.ros2 import inspection
from daemon.stacks.ros2.inspection import Inspection
from daemon.stacks.ros2.link import Graph, GraphEndpoint, Readiness, StackIdentity
from grammars.model.geometry import Pose2
from tests.people.cli.outputs import declared

RELAY = Path(ros2.__file__).with_name("relay.py")
FILES = {
    "slow.yaml": "sut: slow\nkind: pilot\nparameters: {max_speed: 0.2}\n",
    "refused.yaml": "sut: slow\nkind: pilot\nparameters: {max_speed: fast, patience: 3.0}\n",
    "p.yaml": "a: 1\n",
    "nav2.yaml": "sut: nav2\nkind: ros2\nlaunch: touch started {map} {params}\n"
    "files: {params: p.yaml}\nstart-up: 2 min\ntopics: {scan: front}\n",
    "mine.yaml": "sut: mine\nlike: nav2\npatience: 2 s\nready: [amcl]\n",
    "amcl.yaml": "odom_alpha1: -1.0\nkld_err: small\n",
    "bad.yaml": "sut: bad\nkind: ros\nfiles: {amcl: amcl.yaml}\n",
    "my-nav2.yaml": "sut: my-nav2\nkind: ros2\nlaunch: ros2 launch nav nav.launch.py map:={map}\n"
    "ready: [amcl]\n",
    "typing.yaml": "sut: typing\nkind: ros2\nlaunch: run {mapp}\n",
}
HEARD = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped",
}


def seen_by(*, active=True):
    """What is seen of a stack that hears everything, and whose timeouts are short."""
    ears = [
        GraphEndpoint(t, kind, "/amcl", "subscription", False, False) for t, kind in HEARD.items()
    ]
    twist = "geometry_msgs/msg/TwistStamped"
    ears.append(GraphEndpoint("/cmd_vel", twist, "/controller_server", "publisher", True, False))
    return Inspection(
        StackIdentity("jazzy", "rmw_fastrtps_cpp"),
        Graph(tuple(ears), ("/amcl",), ("/amcl/get_state",)),
        Readiness({"/amcl": "active" if active else "inactive"}, True, {}),
        {"/bt_navigator": {"default_server_timeout": 20}},
        seconds=12.3,
        failure=None if active else SutFailure("not ready", printed=["its last \x1b[31mline"]),
    )


class PretendedStart:
    """Stands in for what starts a stack; remembers what for."""

    def __init__(self):
        self.answer = seen_by()

    def __call__(self, settings, briefing, first, on_progress, on_end):
        self.settings, self.briefing, self.first = settings, briefing, first
        on_progress("0 of 1 nodes active")
        on_end({"stack.txt": b"all of it"})
        if isinstance(self.answer, SutFailure):
            raise self.answer
        return self.answer


@pytest.fixture
def start(monkeypatch, place):
    for name, text in FILES.items():
        (place / name).write_text(text)
    pretended = PretendedStart()
    monkeypatch.setattr(inspection, "inspect_stack", pretended)
    return pretended


def test_parameters_are_shown_with_places_defaults_and_wiring(start, place, transcript):
    transcript("sut_show")
    assert not (place / "started").exists()


def test_a_file_in_place_of_a_command_is_shown(scenario, start, place):
    assert scenario("sut", "slow.yaml").out == scenario("sut", "show", "slow.yaml").out != ""


def test_scripts_get_the_merged_tree(scenario, campaigns):
    body = declared(scenario("sut", "show", "fro-omni", "--json").out)
    planner = body["reference"]["parameters"]["move_base"]["DWAPlannerROS"]
    assert planner["sim_time"] == 2.5
    assert "controller_frequency" not in planner
    assert body["defaults"]["move_base/DWAPlannerROS"]["controller_frequency"] == 20.0
    assert body["places"]["amcl/kld_z"].endswith("fro-diff/amcl.yaml:15:8")
    heard = {"amcl": True, "global_costmap": True, "local_costmap": True}
    assert body["ros"]["wiring"] == heard
    shuttle = str(campaigns / "suts" / "shuttle-nav.yaml")
    body = declared(scenario("sut", "show", shuttle, "--json").out)
    assert set(body["ros"]["topics"]["by_laser"]) == {"front", "rear"}
    assert body["ros"]["wiring"] == heard


CANNOT_START = SutFailure(
    "the launch command ended with exit code 127", printed=["ros2: not found"]
)


@pytest.mark.parametrize(
    ("name", "answer"),
    [
        ("fine", seen_by()),
        ("missing", seen_by(active=False)),
        ("started not", CANNOT_START),
        ("quiet", replace(seen_by(), parameters={})),
    ],
)
def test_a_line_says_for_each_thing_whether_it_is_there(name, answer, start, transcript):
    start.answer = answer
    transcript(f"sut_check_{name.replace(' ', '_')}")


def test_without_a_campaign_the_robot_stands_in_an_empty_room(scenario, start):
    assert scenario("sut", "check", "my-nav2").code == 0
    briefing, first = start.briefing, start.first
    assert briefing.start == Pose2()
    grid = briefing.map
    free = np.argwhere(grid.cells == 0) * grid.resolution
    assert np.ptp(free, axis=0) == pytest.approx([10.0, 10.0], abs=0.2)
    (scan,), (odometry,) = first.scans, first.odometry
    assert odometry.time == scan.time == first.time == 0.0
    laser = briefing.robot.laser
    angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    ahead = float(scan.ranges[np.argmin(np.abs(angles))])
    assert ahead == pytest.approx(5.0 - laser.mount.x, abs=0.2)


def test_robot_map_and_start_are_those_of_a_campaign(scenario, start):
    assert scenario("sut", "check", "my-nav2.yaml", "--campaign", "demo/campaign.yaml").code == 0
    assert start.briefing.robot.name == "courier"
    assert start.briefing.mission.waypoints[-1].id == "home"
    assert start.briefing.map.cells.shape != (100, 100)


def test_a_warning_of_the_campaign_as_well_is_printed_once(scenario, start, place):
    demo = shutil.copytree(place / "demo", place / "other") / "campaign.yaml"
    sut = place / "my-nav2.yaml"
    sut.write_text(sut.read_text("utf-8").replace(" map:={map}", ""))
    demo.write_text(demo.read_text("utf-8").replace("sut: [pilot]", f"sut: {sut}"))
    said = scenario("sut", "check", str(sut), "--campaign", str(demo))
    assert said.code == 0, said.err
    assert said.err.count("the stack does not receive the map") == 1


def test_the_relay_is_printed_as_it_is(scenario):
    said = scenario("sut", "relay")
    assert (said.code, said.err) == (0, "")
    assert said.out == RELAY.read_text("utf-8")
    compile(said.out, "relay.py", "exec")
