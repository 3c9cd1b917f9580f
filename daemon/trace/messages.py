"""The ROS 2 messages in a trace: topics, types, schemas, how to build them, and the mission.

Progress of a mission is ``action_msgs/GoalStatusArray``, written and read back here.
"""

from __future__ import annotations

import functools
import math
import uuid
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from daemon.model.sut import Progress
from grammars.model.mission import Mission, Waypoint

CONTACTS: Final = "gazebo_msgs/msg/ContactsState"

LEVELS: Final = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}
"""Levels of ``rcl_interfaces/msg/Log``."""

_GAZEBO_DEFINITIONS: Final = {
    "gazebo_msgs/msg/ContactState": (
        "string info\nstring collision1_name\nstring collision2_name\n"
        "geometry_msgs/Wrench[] wrenches\ngeometry_msgs/Wrench total_wrench\n"
        "geometry_msgs/Vector3[] contact_positions\ngeometry_msgs/Vector3[] contact_normals\n"
        "float64[] depths\n"
    ),
    CONTACTS: "std_msgs/Header header\ngazebo_msgs/ContactState[] states\n",
}


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of a trace; ``latched`` ones are published once and kept (transient local)."""

    name: str
    kind: str
    latched: bool = False


TOPICS: Final = (
    Topic("/map", "nav_msgs/msg/OccupancyGrid", latched=True),
    Topic("/footprint", "geometry_msgs/msg/PolygonStamped", latched=True),
    Topic("/scene", "visualization_msgs/msg/MarkerArray", latched=True),
    Topic("/tf_static", "tf2_msgs/msg/TFMessage", latched=True),
    Topic("/clock", "rosgraph_msgs/msg/Clock"),
    Topic("/tf", "tf2_msgs/msg/TFMessage"),
    Topic("/scan", "sensor_msgs/msg/LaserScan"),
    Topic("/odom", "nav_msgs/msg/Odometry"),
    Topic("/ground_truth", "nav_msgs/msg/Odometry"),
    Topic("/joint_states", "sensor_msgs/msg/JointState"),
    Topic("/cmd_vel", "geometry_msgs/msg/TwistStamped"),
    Topic("/pose", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    Topic("/particle_cloud/summary", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    Topic("/particle_cloud/count", "std_msgs/msg/UInt32"),
    Topic("/plan", "nav_msgs/msg/Path"),
    Topic("/local_plan", "nav_msgs/msg/Path"),
    Topic("/contacts", CONTACTS),
    Topic("/mission/status", "action_msgs/msg/GoalStatusArray", latched=True),
    Topic("/mission/goal", "geometry_msgs/msg/PoseStamped", latched=True),
    Topic("/events", "rcl_interfaces/msg/Log"),
    Topic("/particlecloud", "geometry_msgs/msg/PoseArray"),
    Topic("/move_base/local_costmap/costmap", "nav_msgs/msg/OccupancyGrid"),
)
"""Every topic a trace can have; the position plus one is its channel id in the file."""

KINDS: Final = {topic.name: topic.kind for topic in TOPICS}


# Not at import: rosbags takes about 40 ms to load.
@functools.cache
def typestore() -> Any:
    """Return the type store: ROS 2 Humble's messages and Gazebo's contacts."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _GAZEBO_DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


def make(kind: str, **fields: Any) -> Any:
    """Build a message of type ``kind`` (``nav_msgs/msg/Odometry``)."""
    return typestore().types[kind](**fields)


def serialize(message: Any, kind: str) -> bytes:
    """Return the little-endian CDR of a message."""
    return bytes(typestore().serialize_cdr(message, kind))


def deserialize(data: bytes, kind: str) -> Any:
    """Read a message from CDR; damaged bytes raise whatever rosbags raises."""
    return typestore().deserialize_cdr(data, kind)


@functools.cache
def schema(kind: str) -> str:
    """Return the complete ``ros2msg`` definition of a type, with all types it is made of."""
    text: str = typestore().generate_msgdef(kind, ros_version=2)[0]
    return text


def warm_up() -> None:
    """Make the code and the definitions of every type once, so that forked children do not."""
    for kind in KINDS.values():
        # rosbags generates the serializer of a type in Python source and compiles it when it is
        # first needed; a forked child inherits it.
        typestore().get_msgdef(kind)
        schema(kind)


def time(nanoseconds: int) -> Any:
    """Return a ``builtin_interfaces/Time``."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)


def header(stamp: Any, frame: str) -> Any:
    """Return a ``std_msgs/Header``."""
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def point(x: float, y: float, z: float = 0.0) -> Any:
    """Return a ``geometry_msgs/Point``."""
    return make("geometry_msgs/msg/Point", x=x, y=y, z=z)


def vector(x: float, y: float, z: float = 0.0) -> Any:
    """Return a ``geometry_msgs/Vector3``."""
    return make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def yaw_quaternion(yaw: float) -> tuple[float, float]:
    """Return z and w of the quaternion of a yaw, nan when it is not finite."""
    half = yaw * 0.5
    try:
        return math.sin(half), math.cos(half)
    except ValueError:
        return math.nan, math.nan


def quaternion(z: float = 0.0, w: float = 1.0) -> Any:
    """Return a ``geometry_msgs/Quaternion`` about the z axis."""
    return make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w)


def pose(x: float, y: float, qz: float, qw: float, z: float = 0.0) -> Any:
    """Return a ``geometry_msgs/Pose`` turned about the z axis."""
    return make("geometry_msgs/msg/Pose", position=point(x, y, z), orientation=quaternion(qz, qw))


def twist(vx: float, vy: float, wz: float) -> Any:
    """Return a planar ``geometry_msgs/Twist``."""
    return make("geometry_msgs/msg/Twist", linear=vector(vx, vy), angular=vector(0.0, 0.0, wz))


def transform(stamp: Any, parent: str, child: str, *, x: float, y: float, z: float = 0.0,
              qz: float = 0.0, qw: float = 1.0) -> Any:  # fmt: skip
    """Return a ``geometry_msgs/TransformStamped`` turned about the z axis."""
    return make(
        "geometry_msgs/msg/TransformStamped",
        header=header(stamp, parent),
        child_frame_id=child,
        transform=make(
            "geometry_msgs/msg/Transform",
            translation=vector(x, y, z),
            rotation=quaternion(qz, qw),
        ),
    )


def latched_qos() -> str:
    """Return the ``offered_qos_profiles`` of a latched topic, as rosbag2 keeps it (YAML).

    Keep last 1, reliable, transient local, by the numbers of ``rmw``.
    """
    forever = "{sec: 2147483647, nsec: 4294967295}"
    return (
        "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
        f"  deadline: {forever}\n  lifespan: {forever}\n"
        f"  liveliness: 1\n  liveliness_lease_duration: {forever}\n"
        "  avoid_ros_namespace_conventions: false\n"
    )


STATUS: Final = "action_msgs/msg/GoalStatusArray"
# action_msgs/GoalStatus: STATUS_ACCEPTED, STATUS_EXECUTING, STATUS_SUCCEEDED, STATUS_ABORTED.
_ACCEPTED, _EXECUTING, _SUCCEEDED, _ABORTED = 1, 2, 4, 6
_STATES: Final[dict[int, Literal["active", "succeeded", "aborted"]]] = {
    _EXECUTING: "active",
    _SUCCEEDED: "succeeded",
    _ABORTED: "aborted",
}
_CODES: Final = {state: code for code, state in _STATES.items()}


def goal_ids(run: str, mission: Mission) -> tuple[Any, ...]:
    """Return the UUID messages of all waypoints and of the mission, for the run's digest."""
    names = [*(f"{i}/{w.id}" for i, w in enumerate(mission.waypoints)), "mission"]
    found = (uuid.uuid5(uuid.NAMESPACE_URL, f"run:{run}/goal/{name}").bytes for name in names)
    kind = "unique_identifier_msgs/msg/UUID"
    return tuple(make(kind, uuid=np.frombuffer(raw, np.uint8)) for raw in found)


def status(goals: tuple[Any, ...], progress: Progress) -> Any:
    """Return the status of all goals."""
    if progress.state not in _CODES:
        raise ValueError(f"a mission is {', '.join(_CODES)}, not {progress.state!r}")
    count = len(goals) - 1
    reached = min(max(progress.reached, 0), count)
    codes = [_SUCCEEDED] * reached + [_ACCEPTED] * (count - reached)
    current = max(progress.current, reached)
    if current < count and progress.state != "succeeded":
        codes[current] = _CODES[progress.state]
    codes.append(_CODES[progress.state])
    return make(
        STATUS,
        status_list=[
            make(
                "action_msgs/msg/GoalStatus",
                goal_info=make("action_msgs/msg/GoalInfo", goal_id=goal, stamp=time(0)),
                status=code,
            )
            for goal, code in zip(goals, codes, strict=True)
        ],
    )


def progress(message: Any) -> Progress:
    """Return the progress a status message stands for; raises ``ValueError`` when none."""
    codes = [int(goal.status) for goal in message.status_list]
    if not codes or codes[-1] not in _STATES:
        raise ValueError("a mission status without the mission's own goal")
    waypoints = codes[:-1]
    reached = waypoints.count(_SUCCEEDED)
    here = [i for i, code in enumerate(waypoints) if code in (_EXECUTING, _ABORTED)]
    return Progress(here[0] if here else reached, reached, _STATES[codes[-1]])


def goal(waypoint: Waypoint, stamp: int) -> Any:
    """Return the current waypoint as a ``geometry_msgs/PoseStamped``."""
    return make(
        "geometry_msgs/msg/PoseStamped",
        header=header(time(stamp), "map"),
        pose=pose(waypoint.x, waypoint.y, *yaw_quaternion(waypoint.yaw or 0.0)),
    )
