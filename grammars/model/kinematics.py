"""Forward kinematics of objects, and outlines of their links at a height."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from typing import Final, TypeAlias, TypeVar

import numpy as np

from grammars.model.geometry import Floats, Pose2, Ring
from grammars.model.scene import Joint, Link, SceneObject, Solid

T = TypeVar("T")

WORLD: Final = "world"
Trigonometry: TypeAlias = Callable[[Floats], tuple[Floats, Floats]]
"""Maps angles (n,) [rad] to their cosines and sines."""


def cos_sin(angles: Floats) -> tuple[Floats, Floats]:
    """Return cosine and sine of ``angles`` (n,) [rad], computed one by one by the C library.

    Results of numpy differ in the last bit between machines with different vector units, but
    recordings and verdicts must not. Infinite angles give NaN.
    """
    # daemon.judging.oracles._obstacles.cos_sin is the same in machine code and must give the same
    # bits.
    finite = [a if math.isfinite(a) else math.nan for a in angles.tolist()]
    return np.array([math.cos(a) for a in finite]), np.array([math.sin(a) for a in finite])


def joint_motion(joint: Joint, position: float) -> Pose2:
    """Return the motion of ``joint`` from zero to ``position`` [rad or m], in the object frame."""
    if joint.kind == "prismatic":
        return Pose2(joint.axis[0] * position, joint.axis[1] * position)
    x, y = joint.anchor
    c, s = math.cos(position), math.sin(position)
    return Pose2(x - c * x + s * y, y - s * x - c * y, position)


def link_poses(obj: SceneObject, positions: Sequence[float]) -> dict[str, Pose2]:
    """Return for every link the transform of its polygons to the world, in the order of links.

    ``positions`` [rad or m] are in the order of ``obj.joints``. Polygons are in the object frame
    with all joints at zero. So the transform of a link is the product of the joint motions between
    it and the world, from the root outwards (product of exponentials; Lynch and Park, Modern
    Robotics, section 4.1).

    Raises :class:`ValueError` for a wrong number of positions, and for joints that do not form a
    forest over the links: unknown links, a link with two joints, a loop.
    """
    if len(positions) != len(obj.joints):
        raise ValueError(
            f"{obj.name}: {len(obj.joints)} joints, but {len(positions)} joint positions"
        )

    def moved(parent: Pose2, index: int) -> Pose2:
        return parent @ joint_motion(obj.joints[index], positions[index])

    return _placed_links(obj, obj.pose, moved)


def link_tracks(
    obj: SceneObject, positions: Floats, trigonometry: Trigonometry = cos_sin
) -> dict[str, Floats]:
    """Return :func:`link_poses` over time: for every link an array (n, 3) of x, y [m], yaw [rad].

    ``positions`` has shape (n, joints). Yaws are sums, not wrapped to one turn. Raises
    :class:`ValueError` as :func:`link_poses` does.
    """
    if positions.shape[1] != len(obj.joints):
        raise ValueError(
            f"{obj.name}: {len(obj.joints)} joints, but {positions.shape[1]} joint positions"
        )

    def moved(parent: Floats, index: int) -> Floats:
        motion = _motion_track(obj.joints[index], positions[:, index], trigonometry)
        return _compose(parent, motion, trigonometry)

    root = np.tile((obj.pose.x, obj.pose.y, obj.pose.yaw), (len(positions), 1))
    return _placed_links(obj, root, moved)


def _placed_links(obj: SceneObject, root: T, moved: Callable[[T, int], T]) -> dict[str, T]:
    """Return the place of every link, from ``root`` outwards.

    ``moved`` returns the place of the child of a joint, by the place of its parent and its index.
    """
    above = _joints_by_child(obj)
    places: dict[str, T] = {}
    for link in obj.links:
        for name in reversed(_unplaced_chain(obj, above, link.name, places)):
            if name not in above:
                places[name] = root
                continue
            parent = obj.joints[above[name]].parent
            places[name] = moved(root if parent == WORLD else places[parent], above[name])
    return {link.name: places[link.name] for link in obj.links}


def _motion_track(joint: Joint, position: Floats, trigonometry: Trigonometry) -> Floats:
    if joint.kind == "prismatic":
        zeros = np.zeros(len(position))
        return np.column_stack((joint.axis[0] * position, joint.axis[1] * position, zeros))
    x, y = joint.anchor
    c, s = trigonometry(position.copy())
    return np.column_stack((x - c * x + s * y, y - s * x - c * y, position))


def _compose(parent: Floats, child: Floats, trigonometry: Trigonometry) -> Floats:
    c, s = trigonometry(parent[:, 2].copy())
    return np.column_stack(
        (
            parent[:, 0] + c * child[:, 0] - s * child[:, 1],
            parent[:, 1] + s * child[:, 0] + c * child[:, 1],
            parent[:, 2] + child[:, 2],
        )
    )


def _joints_by_child(obj: SceneObject) -> dict[str, int]:
    names = {link.name for link in obj.links}
    above: dict[str, int] = {}
    for index, joint in enumerate(obj.joints):
        for name in (joint.child, joint.parent):
            if name not in names and (name == joint.child or name != WORLD):
                raise ValueError(f'{obj.name}: joint {joint.name} names an unknown link "{name}"')
        if joint.child in above:
            raise ValueError(f"{obj.name}: link {joint.child} has more than one joint")
        above[joint.child] = index
    return above


def _unplaced_chain(
    obj: SceneObject, above: dict[str, int], link: str, poses: Container[str]
) -> list[str]:
    """Return ``link`` and its ancestors that have no pose yet, nearest first."""
    chain: list[str] = []
    while link not in poses:
        if link in chain:
            raise ValueError(f"{obj.name}: the joints of link {link} form a loop")
        chain.append(link)
        if link not in above or obj.joints[above[link]].parent == WORLD:
            break
        link = obj.joints[above[link]].parent
    return chain


def is_cut(part: Solid | Link, z: float) -> bool:
    """Return whether ``part`` crosses height ``z`` [m], which includes its bottom but not its top.

    So of two parts on top of each other, exactly one is cut.
    """
    return part.z_min <= z < part.z_max


def placed_links(
    thing: SceneObject, positions: Mapping[str, float] | None = None
) -> Iterator[tuple[Link, tuple[Ring, ...]]]:
    """Yield every link of an object with its outlines in the world.

    ``positions`` [rad or m] go by scene-wide joint name; other joints have their start position.
    """
    moved = positions or {}
    poses = link_poses(
        thing,
        [
            moved.get(f"{thing.name}.{joint.name}", initial)
            for joint, initial in zip(thing.joints, thing.initial, strict=True)
        ],
    )
    for link in thing.links:
        yield link, tuple(poses[link.name].apply_ring(ring) for ring in link.polygons)


def driven_joints(thing: SceneObject) -> tuple[Joint, ...]:
    """Return the joints that visibly move a part of an object against another or the world.

    This leaves out fixed joints and those of the carriers of movers, which have no shape.
    """
    shapes = {link.name for link in thing.links if link.polygons} | {WORLD}
    return tuple(
        joint
        for joint in thing.joints
        if {joint.parent, joint.child} <= shapes and not joint.lower == joint.upper == 0.0
    )
