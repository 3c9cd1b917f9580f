"""Poses in the plane as (x, y, yaw), and their forms in ROS messages."""

import math

Pose = tuple[float, float, float]


def compose(a, b):
    """Return the pose `b` of frame `a` in the parent frame of `a`."""
    cos, sin = math.cos(a[2]), math.sin(a[2])
    return (a[0] + cos * b[0] - sin * b[1], a[1] + sin * b[0] + cos * b[1], wrap(a[2] + b[2]))


def inverse(a):
    """Return the inverse of a transform."""
    cos, sin = math.cos(a[2]), math.sin(a[2])
    return (-cos * a[0] - sin * a[1], sin * a[0] - cos * a[1], wrap(-a[2]))


def wrap(angle):
    """Return the same angle between -pi and pi."""
    return math.remainder(angle, math.tau)


def yaw_of(quaternion):
    """Return the yaw of a geometry_msgs/Quaternion."""
    return 2.0 * math.atan2(quaternion.z, quaternion.w)


def from_pose(message):
    """Read a geometry_msgs/Pose."""
    return (message.position.x, message.position.y, wrap(yaw_of(message.orientation)))


def from_transform(message):
    """Read a geometry_msgs/Transform."""
    return (message.translation.x, message.translation.y, wrap(yaw_of(message.rotation)))


def fill_pose(message, pose):
    """Write into a geometry_msgs/Pose."""
    message.position.x, message.position.y = float(pose[0]), float(pose[1])
    message.orientation.z, message.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)


def fill_transform(message, pose):
    """Write into a geometry_msgs/Transform."""
    message.translation.x, message.translation.y = float(pose[0]), float(pose[1])
    message.rotation.z, message.rotation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)


def nanoseconds(stamp):
    """Read a builtin_interfaces/Time."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def fill_stamp(stamp, time):
    """Write nanoseconds into a builtin_interfaces/Time."""
    stamp.sec, stamp.nanosec = divmod(int(time), 1_000_000_000)
