"""ROS 2 messages: types, definitions, CDR, and constructors of the common ones.

Used by traces and by systems under test that talk to a ROS 2 stack.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Laser

CONTACTS: Final = "gazebo_msgs/msg/ContactsState"

TREE_LOG_WITHOUT_UIDS: Final = "nav2_msgs/msg/OldBehaviorTreeLog"
"""Type of the log of a behaviour tree before Jazzy; the name exists only here."""

_DEFINITIONS: Final = {
    "gazebo_msgs/msg/ContactState": (
        "string info\nstring collision1_name\nstring collision2_name\n"
        "geometry_msgs/Wrench[] wrenches\ngeometry_msgs/Wrench total_wrench\n"
        "geometry_msgs/Vector3[] contact_positions\ngeometry_msgs/Vector3[] contact_normals\n"
        "float64[] depths\n"
    ),
    CONTACTS: "std_msgs/Header header\ngazebo_msgs/ContactState[] states\n",
    "nav2_msgs/msg/BehaviorTreeStatusChange": (
        "builtin_interfaces/Time timestamp\nstring node_name\nuint16 uid\n"
        "string previous_status\nstring current_status\n"
    ),
    "nav2_msgs/msg/BehaviorTreeLog": (
        "builtin_interfaces/Time timestamp\nnav2_msgs/BehaviorTreeStatusChange[] event_log\n"
    ),
    "nav2_msgs/msg/OldBehaviorTreeStatusChange": (
        "builtin_interfaces/Time timestamp\nstring node_name\n"
        "string previous_status\nstring current_status\n"
    ),
    TREE_LOG_WITHOUT_UIDS: (
        "builtin_interfaces/Time timestamp\nnav2_msgs/OldBehaviorTreeStatusChange[] event_log\n"
    ),
    "nav2_msgs/msg/CollisionMonitorState": (
        "uint8 DO_NOTHING=0\nuint8 STOP=1\nuint8 SLOWDOWN=2\nuint8 APPROACH=3\nuint8 LIMIT=4\n"
        "uint8 action_type\nstring polygon_name\n"
    ),
    "nav2_msgs/msg/SpeedLimit": ("std_msgs/Header header\nbool percentage\nfloat64 speed_limit\n"),
}
"""Messages of Gazebo and Nav2 (Jazzy and Kilted), which rosbags lacks."""


# Not at import: rosbags takes about 40 ms to load.
@functools.cache
def typestore() -> Any:
    """Return the type store: messages of ROS 2 Humble, Gazebo's contacts and some of Nav2."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


def make(kind: str, **fields: Any) -> Any:
    """Build a message of type ``kind`` (``nav_msgs/msg/Odometry``)."""
    return typestore().types[kind](**fields)


def serialize(message: Any, kind: str) -> bytes:
    """Return the little-endian CDR of a message."""
    return bytes(typestore().serialize_cdr(message, kind))


def deserialize(data: bytes, kind: str) -> Any:
    """Read a message from CDR; damaged bytes raise the exceptions of rosbags."""
    return typestore().deserialize_cdr(data, kind)


@functools.cache
def schema(kind: str) -> str:
    """Return the complete ``ros2msg`` definition of a type, including its nested types."""
    text: str = typestore().generate_msgdef(kind, ros_version=2)[0]
    return text


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


def odometry(stamp: Any, frame: str, child: str, pose: Any, twist: Any) -> Any:
    """Return a ``nav_msgs/Odometry``; covariances are 0, "unknown"."""
    unknown = np.zeros(36)
    return make(
        "nav_msgs/msg/Odometry",
        header=header(stamp, frame),
        child_frame_id=child,
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
    )


def scan(stamp: Any, frame: str, laser: Laser, ranges: npt.NDArray[np.float32]) -> Any:
    """Return a ``sensor_msgs/LaserScan``, taken at one instant."""
    return make(
        "sensor_msgs/msg/LaserScan",
        header=header(stamp, frame),
        angle_min=laser.angle_min,
        angle_max=laser.angle_max,
        angle_increment=laser.angle_increment,
        time_increment=0.0,
        scan_time=1.0 / laser.rate,
        range_min=laser.range_min,
        range_max=laser.range_max,
        ranges=ranges,
        intensities=np.zeros(0, np.float32),
    )


def uncertain_pose(stamp: Any, frame: str, pose: Any, covariance: Mapping[int, float]) -> Any:
    """Return a ``geometry_msgs/PoseWithCovarianceStamped``.

    ``covariance`` has the non-zero values of the row-major (6, 6) matrix by index.
    """
    matrix = np.zeros(36)
    matrix[list(covariance)] = list(covariance.values())
    return make(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        header=header(stamp, frame),
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=matrix),
    )


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


def occupancy_grid(grid: OccupancyGrid, now: int = 0, frame: str = "map") -> Any:
    """Return a ``nav_msgs/OccupancyGrid`` at ``now`` [ns]: rows from the lowest y, as the grid."""
    rows, columns = grid.cells.shape
    return make(
        "nav_msgs/msg/OccupancyGrid",
        header=header(time(now), frame),
        info=make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=time(now),
            resolution=grid.resolution,
            width=columns,
            height=rows,
            origin=pose(grid.x, grid.y, 0.0, 1.0),
        ),
        data=np.ascontiguousarray(grid.cells, np.int8).ravel(),
    )
