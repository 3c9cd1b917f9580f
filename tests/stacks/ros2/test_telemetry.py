"""What a stack says becomes estimate, plan, particles and lines of the log."""

import math
import struct
from dataclasses import replace

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
    CostmapPicture,
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


def telemetry():
    return Telemetry(SETTINGS)


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


def test_messages_that_were_too_many_are_told_once_by_their_topic():
    reader = telemetry()
    (told,) = reader.read((), 1.0, ODOMETRY, {"/rosout": 300}).events
    assert (told.level, told.text) == (
        "warn", "/rosout had more messages in one cycle than are taken: old ones are lost"
    )  # fmt: skip
    (again,) = reader.read((), 2.0, ODOMETRY, {"/rosout": 1, "/tf": 2}).events
    assert again.text.startswith("/tf ")


def test_the_estimate_is_the_stacks_correction_with_the_newest_odometry():
    heard = telemetry().read((transform("map", "odom", 2.0, 3.0, math.pi / 2),), 1.0, ODOMETRY)
    pose = heard.estimate.pose
    assert (heard.estimate.time, pose.x, pose.y) == pytest.approx((1.0, 2.0, 4.0))


@pytest.mark.parametrize(
    "transforms",
    [
        # This side's own, those of another frame than the map, and those that go round in circles.
        (("odom", "base_link", 9.0, 9.0, 0.0),),
        (("world", "odom", 0, 0, 0),),
        (("b", "base_link", 0, 0, 0), ("base_link", "b", 0, 0, 0)),
    ],
)
def test_transforms_that_do_not_lead_to_the_map_are_no_estimate(transforms):
    reader = telemetry()
    heard = reader.read(tuple(transform(*each) for each in transforms), 1.0, ODOMETRY)
    assert (heard.estimate, reader.pose()) == (None, None)


def test_the_covariance_of_an_estimate_is_that_of_the_pose_topic():
    full = np.zeros((6, 6))
    full[0, 0], full[1, 1], full[5, 5], full[0, 5] = 1.0, 2.0, 3.0, 0.5
    pose = message(
        TOPICS.pose,
        POSE,
        header=ros.header(ros.time(0), "map"),
        pose=ros.make(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=ros.pose(1.0, 2.0, 0.0, 1.0),
            covariance=full.ravel(),
        ),
    )
    reader = telemetry()
    alone = reader.read((pose,), 4.0, ODOMETRY).estimate
    assert (alone.time, alone.pose.x) == (4.0, 1.0)
    both = reader.read((transform("map", "odom", 0, 0, 0), pose), 5.0, ODOMETRY).estimate
    assert both.covariance.tolist() == [[1.0, 0.0, 0.5], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]


def test_a_plan_in_another_frame_is_brought_into_the_map():
    reader = telemetry()
    moved = (transform("map", "odom", 10.0, 0.0, 0.0), path("odom"))
    plan = reader.read(moved, 1.0, ODOMETRY).plan
    assert plan.tolist() == [[10.0, 1.0], [11.0, 1.0]]


def test_a_plan_in_an_unknown_frame_is_told_once():
    reader = telemetry()
    first = reader.read((path("mars"),), 1.0, ODOMETRY)
    assert first.plan is None
    assert "'mars'" in first.events[0].text
    assert reader.read((path("mars"),), 2.0, ODOMETRY).events == []


def log(level, text):
    return message(
        ROSOUT, LOG, stamp=ros.time(0), level=level, name="amcl", msg=text, file="", function="",
        line=0,
    )  # fmt: skip


def test_the_log_has_its_level_and_its_node_and_debug_is_left_out():
    heard = telemetry().read((log(30, "no laser"), log(10, "tick")), 1.0, ODOMETRY)
    assert [(e.text, e.level, e.source) for e in heard.events] == [("no laser", "warn", "amcl")]
    assert heard.log == ["no laser", "tick"]


def test_a_stack_that_logs_without_end_is_cut_and_says_so():
    reader = telemetry()
    many = (log(20, "x"),) * 1000
    lines = [event for _ in range(7) for event in reader.read(many, 1.0, ODOMETRY).events]
    assert len(lines) == 5001
    assert "left out" in lines[-1].text


def particles(frame, count):
    name = frame.encode() + b"\0"
    body = struct.pack("<iII", 1, 2, len(name)) + name
    body += bytes(-len(body) % 4) + struct.pack("<I", count)
    body += bytes(-len(body) % 8)
    for index in range(count):
        body += struct.pack("<8d", index, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.1)
    return b"\0\1\0\0" + body


@pytest.mark.parametrize("frame", ["map", "m", "robot/map"])
def test_particles_are_summed_up_and_thinned(frame):
    data = ReceivedMessage(TOPICS.particles, PARTICLES, particles(frame, 500))
    heard = telemetry().read((data,), 1.0, ODOMETRY)
    assert (heard.cloud.count, heard.cloud.mean.x, heard.cloud.mean.y) == (500, 249.5, 1.0)
    assert heard.particles.shape == (100, 3)


def test_damaged_messages_are_told_and_end_nothing():
    damaged = (
        ReceivedMessage(TOPICS.particles, PARTICLES, particles("map", 5)[:-8]),
        ReceivedMessage(TOPICS.tf, sensors.TRANSFORMS, b"\0\1\0\0\xff"),
        ReceivedMessage(TOPICS.plan, PATH, b""),
    )
    heard = telemetry().read(damaged, 1.0, ODOMETRY)
    assert len(heard.events) == 3
    assert all("cannot be read" in event.text for event in heard.events)


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
    with pytest.raises(ValueError, match="no velocity"):
        sensors.read_command(ros.serialize(ros.twist(math.nan, 0.0, 0.0), kind), kind)


LASER = Laser(Mount(0.0), 0.3, -1.0, 1.0, 3, 0.05, 5.0, 10.0, 0.01, 0.0)
REPORTING = read_settings(
    {
        "launch": "true",
        "namespace": "shop",
        "topics": {"speed-limit": "/limit"},
        "record": list(REPORT_TOPICS),
    }
)


def grid(frame, width=2):
    return ros.make(
        sensors.GRID,
        header=ros.header(ros.time(0), frame),
        info=ros.make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=ros.time(0), resolution=0.5, width=width, height=1,
            origin=ros.pose(-1.0, 2.0, 0.0, 1.0),
        ),
        data=np.array([100, -1], np.int8),
    )  # fmt: skip


def test_what_is_asked_for_is_subscribed_and_read():
    wanted = {topic.name: topic for topic in link_setup(REPORTING, (LASER,)).subscribe}
    assert wanted["/shop/behavior_tree_log"].keep == "all"
    assert wanted["/shop/local_costmap/costmap"].qos == "latched"
    log = BehaviorTreeLog(0.0, (TreeChange("Spin", 3, "IDLE", "RUNNING"),))
    stop = CollisionMonitorState(0.0, "stop", "PolygonStop")
    limit = SpeedLimit(0.0, 0.5, False)
    costmap = ros.serialize(grid("odom"), sensors.GRID)
    heard = Telemetry(REPORTING).read(
        (
            transform("map", "odom", 2.0, 3.0, math.pi / 2),
            ReceivedMessage("/shop/behavior_tree_log", "", encode_tree_log(0, log)),
            ReceivedMessage("/shop/collision_monitor_state", "", encode_collision(stop)),
            ReceivedMessage("/limit", "", encode_speed_limit(0, limit)),
            ReceivedMessage("/shop/local_costmap/costmap", "", costmap),
        ),
        4.0,
        ODOMETRY,
    )
    *others, picture = heard.reports
    assert others == [replace(report, time=4.0) for report in (log, stop, limit)]
    assert isinstance(picture, CostmapPicture)
    assert (picture.time, picture.scope, picture.frame) == (4.0, "local", "odom")
    assert (picture.x, picture.y, picture.cells.tolist()) == (-1.0, 2.0, [[254, 255]])
    assert picture.frame_pose == Pose2(2.0, 3.0, pytest.approx(math.pi / 2))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (ros.serialize(grid("world"), sensors.GRID), "it is in frame 'world', not in map or odom"),
        (ros.serialize(grid("map", width=3), sensors.GRID), "more or fewer than it says"),
        (b"\0\1\0\0\xff", "a damaged nav_msgs/msg/OccupancyGrid"),
    ],
)
def test_a_costmap_that_cannot_be_placed_is_told_once(data, words):
    message = ReceivedMessage("/shop/global_costmap/costmap", sensors.GRID, data)
    heard = Telemetry(REPORTING).read((message, message), 1.0, ODOMETRY)
    (told,) = heard.events
    assert told.text.startswith("/shop/global_costmap/costmap cannot be read: ")
    assert words in told.text
    assert heard.reports == []


def test_what_is_not_asked_for_is_not_subscribed():
    names = {topic.name for topic in link_setup(SETTINGS, (LASER,)).subscribe}
    assert not names & {"/behavior_tree_log", "/global_costmap/costmap", "/speed_limit"}
