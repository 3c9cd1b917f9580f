"""Movers: objects that walk, as links on a virtual planar chain.

A mover's body hangs on three joints of its object: ``x`` and ``y`` (prismatic, along the axes of
the object frame) and ``yaw`` (revolute, about the body's origin), with two carrier links that have
neither shape nor mass in between (a planar joint in URDF). So joint states, forward kinematics,
traces and pictures treat a walking person like any other object.
"""

from __future__ import annotations

from typing import Final

from grammars.kinematics import WORLD
from grammars.scene import Joint, Link, SceneObject
from grammars.values import Point2, Pose2

JOINTS: Final = ("x", "y", "yaw")
_CARRIERS: Final = ("x_carrier", "y_carrier")
FARTHEST: Final = 1e4
"""Limit of all three joints [m, rad]: more than any building and any number of turns."""


def carried(
    links: tuple[Link, ...], joints: tuple[Joint, ...], body: str
) -> tuple[tuple[Link, ...], tuple[Joint, ...]]:
    """Return links and joints of an object with the link ``body`` on the planar chain."""
    carriers = tuple(Link(name, (), 0.0, 0.0, 0.0) for name in _CARRIERS)
    first, second = _CARRIERS
    chain = (
        _slide("x", WORLD, first, (1.0, 0.0)),
        _slide("y", first, second, (0.0, 1.0)),
        Joint("yaw", "revolute", second, body, (0.0, 0.0), (0.0, 0.0), -FARTHEST, FARTHEST),
    )
    return (*carriers, *links), (*chain, *joints)


def _slide(name: str, parent: str, child: str, axis: Point2) -> Joint:
    return Joint(name, "prismatic", parent, child, (0.0, 0.0), axis, -FARTHEST, FARTHEST)


def is_mover(joints: tuple[Joint, ...]) -> bool:
    """Return whether an object with these joints hangs on the planar chain."""
    if tuple(joint.name for joint in joints[:3]) != JOINTS:
        return False
    _, (x, y, yaw) = carried((), (), joints[2].child)
    return joints[:3] == (x, y, yaw)


def own_joints(joints: tuple[Joint, ...]) -> tuple[Joint, ...]:
    """Return the joints that behaviours may move: neither fixed ones nor the planar chain."""
    rest = joints[3:] if is_mover(joints) else joints
    return tuple(joint for joint in rest if not is_fixed(joint))


def is_fixed(joint: Joint) -> bool:
    """Return whether the joint has no room to move at all."""
    return joint.lower == joint.upper == 0.0


def chain_positions(mover: SceneObject, pose: Pose2, turn: float) -> tuple[float, float, float]:
    """Return the joint positions that put the body's frame at ``pose`` in the world.

    ``turn`` [rad] is the heading in the world, not wrapped; ``pose.yaw`` is not used.
    """
    x, y = mover.pose.inverse().apply((pose.x, pose.y))
    return (x, y, turn - mover.pose.yaw)


def body_link(mover: SceneObject) -> str:
    """Return the name of the link that walks."""
    return mover.joints[2].child
