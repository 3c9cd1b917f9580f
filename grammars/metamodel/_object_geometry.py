"""Frames of links and joints of an object, and which links are boxes."""

from __future__ import annotations

import math
from typing import Final

from grammars.scene import Joint, Link
from grammars.values import Point2, Pose2

_DIGITS: Final = 12
_SQUARE: Final = 1e-9


def tidy(value: float) -> float:
    """Return ``value`` without the dust of adding and subtracting decimals."""
    return round(value, _DIGITS) + 0.0


def joint_axis(joint: Joint) -> tuple[Pose2, str]:
    """Return the joint frame in the object frame, and which of its axes the joint moves along."""
    x, y = joint.anchor
    if joint.kind == "revolute":
        return Pose2(x, y, 0.0), "z"
    if joint.axis == (0.0, 1.0):
        return Pose2(x, y, 0.0), "y"
    return Pose2(x, y, math.atan2(joint.axis[1], joint.axis[0])), "x"


def relative(parent: Pose2, child: Pose2) -> Pose2:
    """Return the transform child frame -> parent frame of two frames of one object."""
    pose = parent.inverse() @ child
    return Pose2(tidy(pose.x), tidy(pose.y), pose.yaw)


def link_frame(link: Link) -> tuple[Pose2, float]:
    """Return the frame of a link in the object frame, and its height: centred for boxes."""
    box = box_of(link)
    if box is None:
        return Pose2(), 0.0
    return box[0], tidy((link.z_min + link.z_max) / 2)


def box_of(link: Link) -> tuple[Pose2, float, float] | None:
    """Return centre and edge lengths of a link that is one rectangle, else nothing."""
    if len(link.polygons) != 1 or len(link.polygons[0]) != 4:
        return None
    a, b, c, d = link.polygons[0]
    along, across = _minus(b, a), _minus(d, a)
    skew = abs(along[0] * across[0] + along[1] * across[1])
    if skew > _SQUARE or math.dist(_plus(b, across), c) > _SQUARE:
        return None
    centre = ((a[0] + c[0]) / 2, (a[1] + c[1]) / 2)
    yaw = math.atan2(along[1], along[0])
    pose = Pose2(tidy(centre[0]), tidy(centre[1]), tidy(yaw) if abs(yaw) < _SQUARE else yaw)
    return pose, tidy(math.hypot(*along)), tidy(math.hypot(*across))


def _minus(a: Point2, b: Point2) -> Point2:
    return (a[0] - b[0], a[1] - b[1])


def _plus(a: Point2, b: Point2) -> Point2:
    return (a[0] + b[0], a[1] + b[1])


def moments(mass: float, x: float, y: float, z: float) -> dict[str, float]:
    """Return the principal moments of inertia of a box [kg m²]."""
    return {
        "xx": mass * (y * y + z * z) / 12,
        "yy": mass * (x * x + z * z) / 12,
        "zz": mass * (x * x + y * y) / 12,
    }
