"""A scene as a horizontal plane cuts it, seen from above: what pictures, maps and screens draw.

Outlines only: how they are painted is up to each of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from grammars.model.geometry import Ring
from grammars.model.kinematics import link_poses
from grammars.model.scene import Link, Scene, SceneObject, Solid


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
