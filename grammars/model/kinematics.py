"""Where the links of objects are for given joint positions, and what they cover at a height."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from typing import Final, TypeAlias

import numpy as np

from grammars.model.geometry import Floats, Pose2, Ring
from grammars.model.scene import Joint, Link, Scene, SceneObject, Solid

WORLD: Final = "world"
Trigonometry: TypeAlias = Callable[[Floats], tuple[Floats, Floats]]
"""Angles (n,) [rad] to their cosines and sines."""


def cos_sin(angles: Floats) -> tuple[Floats, Floats]:
    """Return cosine and sine of ``angles`` (n,) [rad], one by one from the C library.

    numpy's own differ in the last bit between machines with different vector units, and what is
    recorded or judged must not. Angles that are not finite give nan.
    """
    # Judging has the same in machine code, daemon.judging.oracles._obstacles.cos_sin: both must
    # give the same bits.
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
    """Return for every link the transform to apply to its polygons to get them in the world.

    ``positions`` are those of ``obj.joints``, in that order [rad or m]. Polygons are given in the
    object frame with all joints at zero, so a link's transform is the product of the motions of
    the joints between it and the world, from the root outwards (product of exponentials; Lynch
    and Park, Modern Robotics, section 4.1). Links come in the order of ``obj.links``.

    Raises :class:`ValueError` for a wrong number of positions, and for joints that do not form a
    forest over the links: unknown links, a link with two joints, a loop.
    """
    if len(positions) != len(obj.joints):
        raise ValueError(
            f"{obj.name}: {len(obj.joints)} joints, but {len(positions)} joint positions"
        )
    above = _joints_by_child(obj)
    poses: dict[str, Pose2] = {}
    for link in obj.links:
        for name in reversed(_unplaced_chain(obj, above, link.name, poses)):
            if name not in above:
                poses[name] = obj.pose
                continue
            index = above[name]
            joint = obj.joints[index]
            parent = obj.pose if joint.parent == WORLD else poses[joint.parent]
            poses[name] = parent @ joint_motion(joint, positions[index])
    return {link.name: poses[link.name] for link in obj.links}


def link_tracks(
    obj: SceneObject, positions: Floats, trigonometry: Trigonometry = cos_sin
) -> dict[str, Floats]:
    """Return :func:`link_poses` over time: for every link (n, 3) of x, y [m] and yaw [rad].

    ``positions`` has shape (n, joints). Yaws are sums, not wrapped to one turn. Raises
    :class:`ValueError` as :func:`link_poses` does.
    """
    if positions.shape[1] != len(obj.joints):
        raise ValueError(
            f"{obj.name}: {len(obj.joints)} joints, but {positions.shape[1]} joint positions"
        )
    above = _joints_by_child(obj)
    root = np.tile((obj.pose.x, obj.pose.y, obj.pose.yaw), (len(positions), 1))
    tracks: dict[str, Floats] = {}
    for link in obj.links:
        for name in reversed(_unplaced_chain(obj, above, link.name, tracks)):
            if name not in above:
                tracks[name] = root
                continue
            index = above[name]
            joint = obj.joints[index]
            parent = root if joint.parent == WORLD else tracks[joint.parent]
            motion = _motion_track(joint, positions[:, index], trigonometry)
            tracks[name] = _compose(parent, motion, trigonometry)
    return {link.name: tracks[link.name] for link in obj.links}


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
    """Return whether ``part`` crosses height ``z`` [m].

    What ends there is not cut and what begins there is, so of two things that stand on each other
    exactly one is.
    """
    return part.z_min <= z < part.z_max


def solid_rings(scene: Scene, z: float) -> list[Ring]:
    """Return the outlines of the walls, columns and dividers that cross height ``z`` [m]."""
    return [solid.polygon for solid in scene.solids if is_cut(solid, z)]


def placed_links(
    thing: SceneObject, positions: Mapping[str, float] | None = None
) -> Iterator[tuple[Link, tuple[Ring, ...]]]:
    """Return every link of an object with its outlines in the world.

    ``positions`` [rad or m] go by scene-wide joint name; joints it does not name, and all of them
    without it, are where they start.
    """
    given = positions or {}
    poses = link_poses(
        thing,
        [
            given.get(f"{thing.name}.{joint.name}", initial)
            for joint, initial in zip(thing.joints, thing.initial, strict=True)
        ],
    )
    for link in thing.links:
        yield link, tuple(poses[link.name].apply_ring(ring) for ring in link.polygons)


def object_rings(
    scene: Scene, z: float, positions: Mapping[str, float] | None = None
) -> list[Ring]:
    """Return the outlines of all links that cross height ``z`` [m]; see :func:`placed_links`."""
    return [
        ring
        for thing in scene.objects
        for link, rings in placed_links(thing, positions)
        if is_cut(link, z)
        for ring in rings
    ]


def driven_joints(thing: SceneObject) -> tuple[Joint, ...]:
    """Return the joints that move one part of an object against another or against the world.

    Others only carry: fixed ones, and those of chains of links without a shape, on which people
    and other movers walk.
    """
    # A carrier of a mover has no shape: nothing one could see moves against it.
    shapes = {link.name for link in thing.links if link.polygons} | {WORLD}
    return tuple(
        joint
        for joint in thing.joints
        if {joint.parent, joint.child} <= shapes and not joint.lower == joint.upper == 0.0
    )
