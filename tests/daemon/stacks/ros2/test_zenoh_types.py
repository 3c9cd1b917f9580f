"""Types of ROS 2 interfaces: definitions, hashes and CDR without ROS."""

import json
from pathlib import Path

import numpy as np
import pytest

from daemon.model import ros_messages
from daemon.stacks.ros2.rmw_zenoh.interfaces import (
    NO_HASH,
    InterfaceError,
    Interfaces,
    distributions_with,
)

TO_POSE = "nav2_msgs/action/NavigateToPose"
THROUGH = "nav2_msgs/action/NavigateThroughPoses"
WAYPOINTS = "nav2_msgs/action/FollowWaypoints"
WHOLE = (
    TO_POSE,
    THROUGH,
    WAYPOINTS,
    "lifecycle_msgs/srv/GetState",
    "lifecycle_msgs/srv/ChangeState",
    "rcl_interfaces/srv/GetParameters",
    "action_msgs/srv/CancelGoal",
    "nav2_msgs/msg/ParticleCloud",
    "tf2_msgs/msg/TFMessage",
    "rosgraph_msgs/msg/Clock",
    "sensor_msgs/msg/LaserScan",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/OccupancyGrid",
    "geometry_msgs/msg/TwistStamped",
    "rcl_interfaces/msg/Log",
    "nav_msgs/msg/Path",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)

ROSIDL = json.loads((Path(__file__).parent / "rosidl_hashes.json").read_text("utf-8"))
"""What rosidl of the ROS 2 wheels on PyPI made of the same definitions, by distribution."""


@pytest.mark.parametrize("distribution", ["jazzy", "kilted"])
def test_hashes_are_those_of_rosidl(distribution):
    interfaces = Interfaces(distribution)
    for kind in WHOLE:
        interfaces.load(kind)
    ours = {kind: interfaces.hash(kind) for kind in ROSIDL[distribution]}
    assert ours == ROSIDL[distribution]
    pieces = ("SendGoal", "GetResult", "FeedbackMessage", "SendGoal_Request", "GetResult_Response")
    assert {f"{TO_POSE}_{piece}" for piece in pieces} <= set(ours)


def test_the_distributions_differ_where_nav2_does():
    jazzy, kilted = (ROSIDL[name] for name in ("jazzy", "kilted"))
    assert jazzy[f"{TO_POSE}_SendGoal"] == kilted[f"{TO_POSE}_SendGoal"]
    assert jazzy[f"{THROUGH}_SendGoal"] != kilted[f"{THROUGH}_SendGoal"]
    assert jazzy[f"{WAYPOINTS}_GetResult"] != kilted[f"{WAYPOINTS}_GetResult"]


def test_humble_has_no_hashes():
    interfaces = Interfaces("humble")
    for kind in WHOLE:
        interfaces.load(kind)
    assert interfaces.hash(f"{TO_POSE}_SendGoal") == NO_HASH


def test_a_hash_tells_of_which_distribution_it_is():
    wanted = ROSIDL["kilted"][f"{THROUGH}_SendGoal"]
    assert "jazzy" not in distributions_with(f"{THROUGH}_SendGoal", wanted)
    assert "kilted" in distributions_with(f"{THROUGH}_SendGoal", wanted)
    assert not list(distributions_with("sensor_msgs/msg/LaserScan", "RIHS01_" + "0" * 64))
    assert not list(distributions_with("my_msgs/msg/Own", wanted))


@pytest.mark.parametrize("distribution", ["humble", "jazzy", "kilted", "lyrical"])
def test_goals_and_results_travel(distribution):
    interfaces = Interfaces(distribution)
    for kind in WHOLE:
        interfaces.load(kind)
    identifier = interfaces.make(
        "unique_identifier_msgs/msg/UUID", uuid=np.arange(16, dtype=np.uint8)
    )
    goal = interfaces.make(f"{TO_POSE}_Goal", behavior_tree="tree.xml")
    data = interfaces.serialize(f"{TO_POSE}_SendGoal_Request", goal_id=identifier, goal=goal)
    # rmw_zenoh_cpp reads little-endian CDR with its encapsulation in front.
    assert data[:4] == b"\x00\x01\x00\x00"
    assert data[4:20] == bytes(range(16))
    back = interfaces.deserialize(data, f"{TO_POSE}_SendGoal_Request")
    assert back.goal.behavior_tree == "tree.xml"
    result = interfaces.serialize(f"{WAYPOINTS}_GetResult_Response", status=4)
    assert interfaces.deserialize(result, f"{WAYPOINTS}_GetResult_Response").status == 4


def test_messages_of_traces_are_read_with_the_types_of_a_distribution():
    interfaces = Interfaces("kilted")
    interfaces.load("geometry_msgs/msg/Twist")
    data = ros_messages.serialize(ros_messages.twist(0.5, 0.0, 0.25), "geometry_msgs/msg/Twist")
    assert interfaces.deserialize(data, "geometry_msgs/msg/Twist").angular.z == 0.25


@pytest.mark.parametrize("data", [b"", b"\x00\x01\x00\x00", b"\x00\x03\x00\x00" + bytes(60)])
def test_what_is_no_message_is_said(data):
    interfaces = Interfaces("jazzy")
    interfaces.load("geometry_msgs/msg/Twist")
    with pytest.raises(ValueError, match="geometry_msgs/msg/Twist"):
        interfaces.deserialize(data, "geometry_msgs/msg/Twist")


def write(folder, name, text):
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, "utf-8")


OWN = """# a goal of our own
uint8 FAST = 1  # a constant is no part of a type
string NAME = "a # in a name"
PoseIdea[<=3] ideas
float32[2] weights
string<=20 note "without"
uint32 retries 3
---
char[16] token
---
"""


@pytest.mark.parametrize("place", ["", "share", "my_workspace", "installed/share"])
def test_definitions_of_the_user_come_first(tmp_path, place):
    home = tmp_path / place / "nav2_msgs"
    write(home, "action/NavigateToPose.action", OWN)
    write(home, "msg/PoseIdea.msg", "geometry_msgs/PoseStamped pose\nHeader header\nbyte level\n")
    interfaces = Interfaces("jazzy", [tmp_path])
    interfaces.load(TO_POSE)
    goal = interfaces.make(f"{TO_POSE}_Goal")
    assert (goal.note, goal.retries, list(goal.weights), list(goal.ideas)) == ("", 0, [0, 0], [])
    assert interfaces.hash(f"{TO_POSE}_SendGoal") != ROSIDL["jazzy"][f"{TO_POSE}_SendGoal"]
    idea = interfaces.make("nav2_msgs/msg/PoseIdea")
    data = interfaces.serialize(f"{TO_POSE}_Goal", ideas=[idea])
    assert len(interfaces.deserialize(data, f"{TO_POSE}_Goal").ideas) == 1
    # What is not there is still what is shipped.
    interfaces.load(WAYPOINTS)
    assert interfaces.hash(f"{WAYPOINTS}_SendGoal") == ROSIDL["jazzy"][f"{WAYPOINTS}_SendGoal"]


def test_the_folder_of_the_package_itself_will_do(tmp_path):
    write(tmp_path / "my_msgs", "msg/Own.msg", "bool yes\n")
    interfaces = Interfaces("kilted", [tmp_path / "my_msgs"])
    interfaces.load("my_msgs/msg/Own")
    assert interfaces.make("my_msgs/msg/Own").yes is False


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("geometry_msgs/PoseStamped\n---\n---\n", "is no field"),
        ("int32 __import__('os')\n---\n---\n", "is no field"),
        ("wstring name\n---\n---\n", "wstring"),
        ("int32 a\n---\n", "3 sections"),
        ("other_msgs/Thing thing\n---\n---\n", "other_msgs/msg/Thing"),
    ],
)
def test_what_is_no_definition_is_said(tmp_path, text, said):
    write(tmp_path, "nav2_msgs/action/NavigateToPose.action", text)
    with pytest.raises(InterfaceError, match=said):
        Interfaces("jazzy", [tmp_path]).load(TO_POSE)


def test_a_definition_nobody_has_is_said(tmp_path):
    with pytest.raises(InterfaceError, match="definitions: FOLDER"):
        Interfaces("jazzy").load("my_msgs/msg/Own")
    with pytest.raises(InterfaceError, match=str(tmp_path)):
        Interfaces("jazzy", [tmp_path]).load("my_msgs/msg/Own")
    with pytest.raises(InterfaceError, match="no name of a type"):
        Interfaces("jazzy").load("../../etc/passwd")
    with pytest.raises(InterfaceError, match="no folder"):
        Interfaces("jazzy", [tmp_path / "nothing"])
    with pytest.raises(InterfaceError, match="humble, jazzy, kilted, lyrical"):
        Interfaces("foxy")
