"""What a stack says becomes estimate, plan, particles and lines of the log."""

import math
import re
import struct

import numpy as np
import pytest

from daemon.model import ros_messages as ros
from daemon.model.stack_reports import (
    REPORT_TOPICS,
    encode_collision,
    encode_speed_limit,
    encode_tree_log,
)
from daemon.model.sut import (
    BehaviorTreeLog,
    CollisionMonitorState,
    Odometry,
    SpeedLimit,
    TreeChange,
)
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.endpoints import link_setup
from daemon.stacks.ros2.link import ReceivedMessage
from daemon.stacks.ros2.settings import read_settings
from daemon.stacks.ros2.telemetry import LOG, PARTICLES, PATH, POSE, ROSOUT, Telemetry
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import Laser, Mount

SETTINGS = read_settings({"launch": "true"})
TOPICS = SETTINGS.topics
ODOMETRY = Odometry(1.0, Pose2(1.0, 0.0, 0.0), Twist2())


def transform(parent, child, x, y, yaw):
    qz, qw = ros.yaw_quaternion(yaw)
    message = ros.make(
        sensors.TRANSFORMS,
        transforms=[ros.transform(ros.time(0), parent, child, x=x, y=y, qz=qz, qw=qw)],
    )
    data = ros.serialize(message, sensors.TRANSFORMS)
    return ReceivedMessage(TOPICS.tf, sensors.TRANSFORMS, data)


def message(topic, kind, **fields):
    return ReceivedMessage(topic, kind, ros.serialize(ros.make(kind, **fields), kind))


def path(frame):
    header = ros.header(ros.time(0), frame)
    poses = [
        ros.make("geometry_msgs/msg/PoseStamped", header=header, pose=ros.pose(x, 1.0, 0.0, 1.0))
        for x in (0.0, 1.0)
    ]
    return message(TOPICS.plan, PATH, header=header, poses=poses)


def pose(frame):
    full = np.zeros((6, 6))
    full[0, 0], full[1, 1], full[5, 5], full[0, 5] = 1.0, 2.0, 3.0, 0.5
    stated = ros.make(
        "geometry_msgs/msg/PoseWithCovariance",
        pose=ros.pose(1.0, 2.0, 0.0, 1.0),
        covariance=full.ravel(),
    )
    return message(TOPICS.pose, POSE, header=ros.header(ros.time(0), frame), pose=stated)


def log(level, text):
    return message(
        ROSOUT, LOG, stamp=ros.time(0), level=level, name="amcl", msg=text, file="", function="",
        line=0,
    )  # fmt: skip


def particles(frame, count, less=0):
    name = frame.encode() + b"\0"
    body = struct.pack("<iII", 1, 2, len(name)) + name
    body += bytes(-len(body) % 4) + struct.pack("<I", count)
    body += bytes(-len(body) % 8)
    for index in range(count):
        body += struct.pack("<8d", index, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.1)
    data = b"\0\1\0\0" + body[: len(body) - less]
    return ReceivedMessage(TOPICS.particles, PARTICLES, data)


def grid(frame, scope="global", width=2):
    message = ros.make(
        sensors.GRID,
        header=ros.header(ros.time(0), frame),
        info=ros.make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=ros.time(0), resolution=0.5, width=width, height=1,
            origin=ros.pose(-1.0, 2.0, 0.0, 1.0),
        ),
        data=np.array([100, -1], np.int8),
    )  # fmt: skip
    return reported(f"{scope}_costmap/costmap", ros.serialize(message, sensors.GRID))


def reported(topic, data):
    return ReceivedMessage(topic if topic[0] == "/" else f"/shop/{topic}", sensors.GRID, data)


LASER = Laser(Mount(0.0), 0.3, -1.0, 1.0, 3, 0.05, 5.0, 10.0, 0.01, 0.0)
REPORTING = read_settings(
    {
        "launch": "true",
        "namespace": "shop",
        "topics": {"speed-limit": "/limit"},
        "record": list(REPORT_TOPICS),
    }
)
TREE = BehaviorTreeLog(0.0, (TreeChange("Spin", 3, "IDLE", "RUNNING"),))
LOCATED = transform("map", "odom", 2.0, 3.0, math.pi / 2)
DAMAGED = reported("global_costmap/costmap", b"\0\1\0\0\xff")
CYCLES = {
    "its correction with the newest odometry": [[LOCATED]],
    "a transform of this side": [[transform("odom", "base_link", 9.0, 9.0, 0.0)]],
    "a transform to another frame than the map": [[transform("world", "odom", 0, 0, 0)]],
    "transforms that go round in circles": [
        [transform("b", "base_link", 0, 0, 0), transform("base_link", "b", 0, 0, 0)]],
    "a pose alone, then the correction beside it": [
        [pose("map")], [transform("map", "odom", 0, 0, 0), pose("map")]],
    "a plan in another frame": [[transform("map", "odom", 10.0, 0.0, 0.0), path("odom")]],
    "a plan in an unknown frame is told once": [[path("mars")], [path("mars")]],
    "the log with its level and node, debug left out": [[log(30, "no laser"), log(10, "tick")]],
    **{f"particles in {frame!r} are summed up and thinned": [[particles(frame, 500)]]
       for frame in ("map", "m", "robot/map")},
    "damaged messages": [[
        particles("map", 5, less=8),
        ReceivedMessage(TOPICS.tf, sensors.TRANSFORMS, b"\0\1\0\0\xff"),
        ReceivedMessage(TOPICS.plan, PATH, b""),
    ]],
    "what is asked for": [[
        LOCATED,
        reported("behavior_tree_log", encode_tree_log(0, TREE)),
        reported("collision_monitor_state",
                 encode_collision(CollisionMonitorState(0.0, "stop", "PolygonStop"))),
        reported("/limit", encode_speed_limit(0, SpeedLimit(0.0, 0.5, False))),
        grid("odom", "local"),
    ]],
    "a costmap in an unknown frame is told once": 2 * [[grid("world")]],
    "a costmap of a wrong size": [[grid("map", width=3)]],
    "a damaged costmap": [[DAMAGED, DAMAGED]],
}  # fmt: skip


def told(heard):
    """Return the lines about what was heard in a cycle, without what was not."""
    if (estimate := heard.estimate) is not None:
        x, y, yaw = (round(v, 6) for v in (estimate.pose.x, estimate.pose.y, estimate.pose.yaw))
        spread = estimate.covariance
        rows = "" if spread is None else f", {spread.tolist()}"
        yield f"estimate at {estimate.time} s: {x}, {y}, {yaw}{rows}"
    if heard.plan is not None:
        yield f"plan {heard.plan.tolist()}"
    if heard.cloud is not None:
        mean = (heard.cloud.mean.x, heard.cloud.mean.y)
        yield f"{heard.cloud.count} particles around {mean}, {len(heard.particles)} of them kept"
    yield from (f"{event.level} of {event.source or 'us'}: {event.text}" for event in heard.events)
    yield from (f"logged {line}" for line in heard.log)
    yield from (f"reported {report}" for report in heard.reports)


def test_what_is_heard_in_a_cycle(golden):
    lines = []
    for name, cycles in CYCLES.items():
        reader = Telemetry(REPORTING if "costmap" in name or "asked" in name else SETTINGS)
        for number, messages in enumerate(cycles, 1):
            lines += [f"--- {name}", *told(reader.read(messages, float(number), ODOMETRY))]
    # Not the words of a library, nor the last digits of an angle.
    text = re.sub("(a damaged [^ ]+): .*", r"\1", "\n".join(lines) + "\n")
    golden("telemetry.txt", re.sub(r"(\d\.\d{9})\d+", r"\1", text))


def test_messages_that_were_too_many_are_told_once_by_their_topic():
    reader = Telemetry(SETTINGS)
    (told,) = reader.read((), 1.0, ODOMETRY, {"/rosout": 300}).events
    assert (told.level, told.text) == (
        "warn", "/rosout had more messages in one cycle than are taken: old ones are lost"
    )  # fmt: skip
    (again,) = reader.read((), 2.0, ODOMETRY, {"/rosout": 1, "/tf": 2}).events
    assert again.text.startswith("/tf ")


def test_a_stack_that_logs_without_end_is_cut_and_says_so():
    reader = Telemetry(SETTINGS)
    many = (log(20, "x"),) * 1000
    lines = [event for _ in range(7) for event in reader.read(many, 1.0, ODOMETRY).events]
    assert len(lines) == 5001
    assert "left out" in lines[-1].text


def test_commands_are_read_with_their_stamp_if_they_have_one():
    twist = ros.twist(0.5, 0.0, -0.2)
    stamped = ros.make(
        "geometry_msgs/msg/TwistStamped", header=ros.header(ros.time(7), "base_link"), twist=twist
    )
    kind = "geometry_msgs/msg/TwistStamped"
    assert sensors.read_command(ros.serialize(stamped, kind), kind) == (Twist2(0.5, 0, -0.2), 7)
    kind = "geometry_msgs/msg/Twist"
    assert sensors.read_command(ros.serialize(twist, kind), kind) == (Twist2(0.5, 0, -0.2), None)


def test_a_command_that_is_no_velocity_is_refused():
    kind = "geometry_msgs/msg/Twist"
    with pytest.raises(ValueError, match="not a velocity"):
        sensors.read_command(ros.serialize(ros.twist(math.nan, 0.0, 0.0), kind), kind)


def test_what_is_asked_for_is_subscribed():
    wanted = {topic.name: topic for topic in link_setup(REPORTING, (LASER,)).subscribe}
    assert wanted["/shop/behavior_tree_log"].keep == "all"
    assert wanted["/shop/local_costmap/costmap"].qos == "latched"
    names = {topic.name for topic in link_setup(SETTINGS, (LASER,)).subscribe}
    assert not names & {"/behavior_tree_log", "/global_costmap/costmap", "/speed_limit"}
