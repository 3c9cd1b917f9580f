"""The ROS 2 of the tests is genuine."""

import json
import subprocess

import pytest

SEND_GOAL = "RIHS01_a4fcb3bee1bf32e21a0e541a943b221aa0826996e2c98f079b47022b256f48b5"
"""Hash of NavigateToPose_SendGoal in Nav2 of Kilted."""


def hashes(ros2, action):
    file = ros2.prefix / "share" / "nav2_msgs" / "action" / f"{action}.json"
    entries = json.loads(file.read_text("utf-8"))["type_hashes"]
    return {entry["type_name"].split("/")[-1]: entry["hash_string"] for entry in entries}


@pytest.mark.one_distribution
def test_own_definitions_have_the_hash_of_nav2(ros2_environment):
    assert hashes(ros2_environment, "NavigateToPose")["NavigateToPose_SendGoal"] == SEND_GOAL


def test_interfaces_are_those_of_the_distribution(ros2_environment):
    code = (
        "import tf2_msgs.msg, nav2_msgs.msg as m, nav2_msgs.action as a;"
        "print(hasattr(m, 'WaypointStatus'),"
        " a.NavigateThroughPoses.Goal.get_fields_and_field_types()['poses'])"
    )
    answer = subprocess.run(
        [ros2_environment.python, "-c", code], capture_output=True, text=True, check=True
    )
    assert (
        answer.stdout.split()
        == {
            "jazzy": ["False", "sequence<geometry_msgs/PoseStamped>"],
            "kilted": ["True", "nav_msgs/Goals"],
        }[ros2_environment.distribution]
    )
