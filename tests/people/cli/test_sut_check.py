"""``scenario sut check``: what it starts, what it prints, what it leaves with; and the relay."""

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
SUT = """sut: my-nav2
kind: ros2
launch: ros2 launch nav nav.launch.py map:={map}
ready: [amcl]
"""


def seen_by(*, active=True):
    """What is seen of a stack that hears everything, and whose timeouts are short."""
    heard = {
        "/clock": "rosgraph_msgs/msg/Clock",
        "/scan": "sensor_msgs/msg/LaserScan",
        "/odom": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    }
    ears = [
        GraphEndpoint(t, kind, "/amcl", "subscription", False, False) for t, kind in heard.items()
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

    def __init__(self, answer):
        self.answer = answer

    def __call__(self, settings, briefing, first, on_progress, on_end):
        self.settings, self.briefing, self.first = settings, briefing, first
        on_progress("0 of 1 nodes active")
        on_end({"stack.txt": b"all of it"})
        if isinstance(self.answer, SutFailure):
            raise self.answer
        return self.answer


@pytest.fixture
def start(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    found = PretendedStart(seen_by())
    monkeypatch.setattr(inspection, "inspect_stack", found)
    return found


@pytest.fixture
def sut(tmp_path):
    path = tmp_path / "my-nav2.yaml"
    path.write_text(SUT)
    return path


def test_a_line_says_for_each_thing_whether_it_is_there(scenario, start, sut):
    said = scenario("sut", "check", str(sut))
    assert said.code == 0
    assert said.err.splitlines()[-3:] == [
        "starting my-nav2, which may take 60 s",
        "my-nav2: nothing is missing, 1 warning",
        "all it printed: scenario-results/sut-check/my-nav2/stack.txt",
    ]
    lines = said.out.splitlines()
    assert lines[0].startswith("✓ start-up ")
    assert lines[0].endswith("ROS 2 Jazzy, rmw_fastrtps_cpp, ready after 12.3 s of wall clock")
    scan = next(line for line in lines if line.startswith("✓ /scan "))
    assert scan.endswith(
        "sensor_msgs/msg/LaserScan, best effort, 0 publishers, 1 listener: heard by /amcl"
    )
    warned = next(i for i, line in enumerate(lines) if line.startswith("! /bt_navigator default"))
    assert lines[warned + 1].strip() == "→ set it to 1000 or more"
    assert any("at most real time" in line for line in lines)


def test_what_is_missing_is_an_exit_code_and_the_last_lines_are_told(scenario, start, sut):
    start.answer = seen_by(active=False)
    said = scenario("sut", "check", str(sut))
    assert said.code == 1
    assert "my-nav2: 2 missing, 1 warning\n" in said.err
    assert any(line.startswith("✗ /amcl ") for line in said.out.splitlines())
    assert said.out.endswith("\n\nthe stack printed\n  its last line\n")


def test_a_stack_that_cannot_be_started_says_why(scenario, start, sut):
    start.answer = SutFailure(
        "the launch command ended with exit code 127", printed=["ros2: not found"]
    )
    said = scenario("sut", "check", str(sut))
    assert (said.code, said.out) == (3, "")
    assert "my-nav2 cannot be started: the launch command ended with exit code 127" in said.err
    assert "ros2: not found" in said.err
    said = scenario("sut", "check", str(sut), "--json", "--out", "kept")
    assert said.code == 3
    assert Path("kept/stack.txt").read_bytes() == b"all of it"
    body = declared(said.out)
    assert body["failure"] == "the launch command ended with exit code 127"
    assert body["printed"] == ["ros2: not found"]
    assert (body["lines"], body["outputs"]) == ([], ["kept/stack.txt"])


def test_scripts_get_every_line(scenario, start, sut):
    body = declared(scenario("sut", "check", str(sut), "--json").out)
    assert body["schema"] == "scenario/inspection/1"
    assert (body["sut"], body["distribution"], body["failure"]) == ("my-nav2", "jazzy", "")
    scan = next(line for line in body["lines"] if line["subject"] == "/scan")
    assert (scan["state"], scan["qos"], scan["listeners"]) == ("ok", "best effort", 1)


def test_without_a_campaign_the_robot_stands_in_an_empty_room(scenario, start, sut):
    assert scenario("sut", "check", str(sut)).code == 0
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


def test_robot_map_and_start_are_those_of_a_campaign(scenario, start, sut, campaigns):
    demo = campaigns / "demo" / "campaign.yaml"
    assert scenario("sut", "check", str(sut), "--campaign", str(demo)).code == 0
    assert start.briefing.robot.name == "courier"
    assert start.briefing.mission.waypoints[-1].id == "home"
    assert start.briefing.map.cells.shape != (100, 100)
    bad = sut.with_name("bad.yaml")
    bad.write_text("campaign: [\n")
    assert scenario("sut", "check", str(sut), "--campaign", str(bad)).code == 2


def test_a_system_is_named_as_in_campaigns(scenario, start, sut, monkeypatch):
    monkeypatch.chdir(sut.parent)
    assert scenario("sut", "check", "my-nav2").code == 0
    said = scenario("sut", "check", "my-nav")
    assert said.code == 2
    assert 'did you mean "my-nav2"?' in said.err


def test_only_what_lives_outside_is_started(scenario, start, campaigns, sut):
    said = scenario("sut", "check", str(campaigns / "suts" / "pilot.yaml"))
    assert said.code == 2
    assert "pilot is of kind pilot" in " ".join(said.err.split())
    sut.write_text("sut: my-nav2\nkind: ros2\nlaunch: run {mapp}\n")
    said = scenario("sut", "check", str(sut))
    assert said.code == 2
    assert f"{sut}:3:" in said.err
    assert not hasattr(start, "settings")


def test_the_relay_is_printed_as_it_is(scenario):
    said = scenario("sut", "relay")
    assert (said.code, said.err) == (0, "")
    assert said.out == RELAY.read_text("utf-8")
    compile(said.out, "relay.py", "exec")


def test_the_first_state_decides_nothing_that_is_only_good_to_know(scenario, start, sut):
    start.answer = replace(seen_by(), parameters={})
    said = scenario("sut", "check", str(sut))
    assert said.code == 0
    assert "my-nav2: nothing is missing\n" in said.err


def test_a_warning_of_the_campaign_as_well_is_printed_once(
    scenario, start, sut, campaigns, tmp_path
):
    demo = shutil.copytree(campaigns / "demo", tmp_path / "demo") / "campaign.yaml"
    sut.write_text(sut.read_text("utf-8").replace(" map:={map}", ""))
    demo.write_text(demo.read_text("utf-8").replace("sut: [pilot]", f"sut: {sut}"))
    said = scenario("sut", "check", str(sut), "--campaign", str(demo))
    assert said.code == 0, said.err
    assert said.err.count("the stack is not given the map") == 1
