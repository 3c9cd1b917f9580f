"""Messages that a robot publishes to a ROS 2 stack, as CDR: odometry, scans, transforms, map.

Times are ROS time [ns]. Sources: REP 103, 105 and 117; the message definitions of
``common_interfaces`` and ``geometry2``.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from daemon.model import ros_messages as ros
from daemon.model.sut import LaserScan, Odometry
from daemon.stacks.ros2.keys import Ros2Frames
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Laser

ODOMETRY: Final = "nav_msgs/msg/Odometry"
SCAN: Final = "sensor_msgs/msg/LaserScan"
TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"
GRID: Final = "nav_msgs/msg/OccupancyGrid"
INITIAL_POSE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"

# Variances of RViz' "2D Pose Estimate": 0.5 m, 0.5 m and 15 degrees. AMCL spreads its particles by
# them, so a stack gets no better start than from a person.
_START_VARIANCE: Final = {0: 0.25, 7: 0.25, 35: 0.06853891945200942}


def odometry(sample: Odometry, time: int, frames: Ros2Frames) -> bytes:
    """Return a ``nav_msgs/Odometry`` of ``time`` [ns]; covariances are 0, "unknown"."""
    twist = ros.twist(sample.twist.vx, sample.twist.vy, sample.twist.wz)
    message = ros.odometry(ros.time(time), frames.odom, frames.base, _pose(sample.pose), twist)
    return ros.serialize(message, ODOMETRY)


def odometry_transform(sample: Odometry, time: int, frames: Ros2Frames) -> bytes:
    """Return the transform odom -> base of ``time`` [ns]."""
    return _transforms(_transform(sample.pose, time, frames.odom, frames.base))


def laser_transforms(lasers: Iterable[Laser], time: int, frames: Ros2Frames) -> bytes:
    """Return the fixed transforms base -> laser."""
    return _transforms(
        *(
            _transform(laser.mount, time, frames.base, frames.of_laser(laser), z=laser.z)
            for laser in lasers
        )
    )


def scan(sweep: LaserScan, laser: Laser, time: int, frames: Ros2Frames) -> bytes:
    """Return a ``sensor_msgs/LaserScan`` of ``time`` [ns], taken at one instant."""
    message = ros.scan(ros.time(time), frames.of_laser(laser), laser, sweep.ranges)
    return ros.serialize(message, SCAN)


def occupancy_grid(grid: OccupancyGrid, time: int, frames: Ros2Frames) -> bytes:
    """Return the map as a ``nav_msgs/OccupancyGrid`` of ``time`` [ns]."""
    return ros.serialize(ros.occupancy_grid(grid, time, frames.map), GRID)


def initial_pose(pose: Pose2, time: int, frames: Ros2Frames) -> bytes:
    """Return the pose of the robot at ``time`` [ns], with the uncertainty of RViz."""
    message = ros.uncertain_pose(ros.time(time), frames.map, _pose(pose), _START_VARIANCE)
    return ros.serialize(message, INITIAL_POSE)


def read_command(data: bytes, kind: str) -> tuple[Twist2, int | None]:
    """Read a velocity command and its stamp [ns], ``None`` for the kind without one.

    Raises ``ValueError`` for damaged bytes and numbers that are not finite.
    """
    message = read_message(data, kind)
    stamped = hasattr(message, "header")
    twist = message.twist if stamped else message
    command = Twist2(float(twist.linear.x), float(twist.linear.y), float(twist.angular.z))
    if not np.isfinite((command.vx, command.vy, command.wz)).all():
        raise ValueError(f"the stack commanded {command}, which is not a velocity")
    return command, stamp(message) if stamped else None


def read_message(data: bytes, kind: str) -> Any:
    """Read a message of the stack; raises ``ValueError`` for damaged bytes."""
    try:
        return ros.deserialize(data, kind)
    except Exception as error:
        # rosbags uses struct, numpy and generated code, which may raise anything.
        raise ValueError(f"a damaged {kind}: {error}") from error


def stamp(message: Any) -> int:
    """Return the stamp in a header [ns]."""
    time = message.header.stamp
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def plane_pose(position: Any, orientation: Any) -> Pose2:
    """Return a pose or transform in the plane, without roll and pitch."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    yaw = float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return Pose2(float(position.x), float(position.y), yaw)


def _pose(pose: Pose2) -> Any:
    return ros.pose(pose.x, pose.y, *ros.yaw_quaternion(pose.yaw))


def _transform(pose: Pose2, time: int, parent: str, child: str, z: float = 0.0) -> Any:
    qz, qw = ros.yaw_quaternion(pose.yaw)
    return ros.transform(
        ros.time(time), parent, child, x=pose.x, y=pose.y, z=z, qz=qz, qw=qw
    )  # fmt: skip


def _transforms(*transforms: Any) -> bytes:
    return ros.serialize(ros.make(TRANSFORMS, transforms=list(transforms)), TRANSFORMS)
