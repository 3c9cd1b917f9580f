"""Types of the rmw_zenoh link against those of a genuine ROS 2: its rosidl, its rclpy."""

import json
import os
import subprocess

import numpy as np
import pytest

from daemon.stacks.ros2.rmw_zenoh.interfaces import InterfaceError, Interfaces
from tests.daemon.stacks.ros2.test_zenoh_types import THROUGH, TO_POSE, WAYPOINTS

environment = pytest.importorskip("tests.ros2.environment")

_BOOTSTRAP = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"

READ_BACK = """
import json, sys
from nav2_msgs.action import FollowWaypoints, NavigateThroughPoses, NavigateToPose
from rclpy.serialization import deserialize_message, serialize_message

actions = {"p": NavigateToPose, "t": NavigateThroughPoses, "w": FollowWaypoints}
found = {}
for name, data in json.load(sys.stdin).items():
    send = actions[name].Impl.SendGoalService
    request = deserialize_message(bytes.fromhex(data), send.Request)
    goal = request.goal
    poses = [goal.pose] if name == "p" else getattr(goal.poses, "goals", goal.poses)
    result = actions[name].Impl.GetResultService.Response(status=6)
    result.result.error_code = 42
    result.result.error_msg = "stuck"
    found[name] = {
        "goal": bytes(request.goal_id.uuid).hex(),
        "poses": [[p.header.frame_id, p.pose.position.x, p.pose.orientation.z] for p in poses],
        "size": len(serialize_message(request)),
        "result": serialize_message(result).hex(),
    }
print(json.dumps(found))
"""


@pytest.fixture(params=["jazzy", "kilted"])
def ros2(request):
    """A distribution and the folder of its environment."""
    python = environment.environment_python(request.param)
    if python is None:
        pytest.skip(f"no ROS 2: python -m tests.ros2.environment {request.param}")
    return request.param, python.parents[1]


def test_every_hash_is_that_of_rosidl(ros2):
    distribution, home = ros2
    # As a user would give them: the share folder of what is installed.
    interfaces = Interfaces(distribution, [home])
    theirs = {}
    for file in home.glob("share/*/*/*.json"):
        room, kind = file.parent.name, f"{file.parents[1].name}/{file.parent.name}/{file.stem}"
        if room not in ("msg", "srv", "action"):
            continue
        try:
            interfaces.load(kind)
        except InterfaceError as error:
            # The one kind of field that is not understood.
            assert "wstring" in str(error), kind
            continue
        hashes = json.loads(file.read_text("utf-8"))["type_hashes"]
        theirs |= {one["type_name"]: one["hash_string"] for one in hashes}
    # The action as a whole is no type that travels.
    theirs = {
        kind: text for kind, text in theirs.items() if kind not in (TO_POSE, THROUGH, WAYPOINTS)
    }
    assert len(theirs) > 200
    assert {kind: interfaces.hash(kind) for kind in theirs} == theirs


def test_rclpy_reads_what_is_sent_and_is_read(ros2):
    distribution, home = ros2
    interfaces = Interfaces(distribution)
    make = interfaces.make
    kinds = {"p": TO_POSE, "t": THROUGH, "w": WAYPOINTS}
    for kind in kinds.values():
        interfaces.load(kind)
    header = make("std_msgs/msg/Header", frame_id="map")
    pose = make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", x=2.5),
        orientation=make("geometry_msgs/msg/Quaternion", z=0.6, w=0.8),
    )
    stamped = make("geometry_msgs/msg/PoseStamped", header=header, pose=pose)
    identifier = make("unique_identifier_msgs/msg/UUID", uuid=np.arange(16, dtype=np.uint8))
    sent = {}
    for name, kind in kinds.items():
        many = [stamped, stamped]
        nested = interfaces.field_types(f"{kind}_Goal").get("poses", "")
        poses = make(nested, goals=many) if nested.endswith("/Goals") else many
        goal = make(f"{kind}_Goal", pose=stamped, poses=poses, behavior_tree="a tree")
        request = interfaces.serialize(f"{kind}_SendGoal_Request", goal_id=identifier, goal=goal)
        sent[name] = request.hex()
    clean = {name: value for name, value in os.environ.items() if name != _BOOTSTRAP}
    done = subprocess.run(
        [home / "bin" / "python", "-c", READ_BACK],
        input=json.dumps(sent),
        capture_output=True,
        text=True,
        env=clean,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for name, found in json.loads(done.stdout).items():
        assert found["goal"] == bytes(range(16)).hex()
        assert found["poses"] == [["map", 2.5, 0.6]] * (1 if name == "p" else 2)
        # Not the same bytes: Fast CDR leaves what was in memory between fields.
        assert found["size"] == len(sent[name]) // 2
        answer = interfaces.deserialize(
            bytes.fromhex(found["result"]), f"{kinds[name]}_GetResult_Response"
        )
        assert (answer.status, answer.result.error_code, answer.result.error_msg) == (
            6,
            42,
            "stuck",
        )
