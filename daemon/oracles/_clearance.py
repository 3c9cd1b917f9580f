"""Clearance: how far the nearest obstacle is outside a box around the robot, signed.

``clearance(hx, hy)`` is the minimum over all obstacle points (x, y) in the body frame of
``max(|x| - hx, |y| - hy)``: positive outside the box, negative inside. One function is both the
collision box and the safety buffer of the paper (sections 4.2.3 and 4.4.1).

Obstacles are filled convex polygons: everything that overlaps the robot in height.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from daemon.oracles._kernel import box_clearance
from daemon.oracles._links import joint_positions, link_tracks
from daemon.oracles._series import Series
from grammars.kinematics import link_poses
from grammars.scene import Link, Scene, SceneObject
from grammars.values import Floats, Point2, Ring

if TYPE_CHECKING:
    from daemon.trace import Trace

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Obstacles:
    """Convex polygons as flat arrays.

    ``corners`` (v, 2) [m]; polygon ``p`` has corners ``offsets[p]:offsets[p + 1]`` in the frame
    ``frame[p]`` (-1: world), inside the circle ``circle[p]`` = (x, y, radius). ``tracks``
    (n, frames, 3) are the poses of the frames over time. ``names`` (p,) say whose each is.
    """

    corners: Floats
    offsets: Indices
    frame: Indices
    circle: Floats
    tracks: Floats
    names: tuple[str, ...]


def footprint_box(footprint: Ring) -> tuple[Point2, Point2]:
    """Return centre and half extents [m] of the box around ``footprint``, base frame."""
    xs, ys = [x for x, _ in footprint], [y for _, y in footprint]
    centre = ((max(xs) + min(xs)) / 2.0, (max(ys) + min(ys)) / 2.0)
    return centre, ((max(xs) - min(xs)) / 2.0, (max(ys) - min(ys)) / 2.0)


def clearance(obstacles: Obstacles, poses: Floats, *, centre: Point2, half: Point2) -> Series:
    """Return the clearance [m] of a box in the base frame at ``poses`` (n, 3), with the object.

    The tracks of ``obstacles`` are sampled at the same times as the poses.
    """
    if not obstacles.names:
        return Series(
            np.full(len(poses), np.nan), note="nothing there as high as the robot to keep clear of"
        )
    values, nearest = box_clearance(
        poses,
        np.array(centre, dtype=np.float64),
        np.array(half, dtype=np.float64),
        obstacles.corners,
        obstacles.offsets,
        obstacles.frame,
        obstacles.circle,
        obstacles.tracks,
    )
    return Series(values, nearest, obstacles.names)


def obstacles_of(trace: Trace, time: Floats) -> Obstacles:
    """Collect what the robot's body can hit: solids and links that overlap its height."""
    shapes = _shapes(_Building(trace.spec.scene, trace.spec.robot.height, trace.scene))
    tracks: list[Floats] = []
    for item, links in shapes.moving:
        poses = link_tracks(item, joint_positions(trace, item, time))
        tracks.extend(poses[name] for name in links)
    stacked = np.stack(tracks, axis=1) if tracks else np.empty((len(time), 0, 3))
    still = shapes.still
    return Obstacles(
        still.corners, still.offsets, still.frame, still.circle,
        np.ascontiguousarray(stacked), still.names,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Building:
    """A scene for robots of one height; equal when the ``digest`` of the scene is."""

    digest: str
    height: float
    scene: Scene = field(compare=False)


@dataclass(frozen=True, slots=True, eq=False)
class _Shapes:
    """Obstacles of a building without their tracks, and the links whose tracks they are."""

    still: Obstacles
    moving: tuple[tuple[SceneObject, tuple[str, ...]], ...]


@functools.lru_cache(maxsize=16)
def _shapes(building: _Building) -> _Shapes:
    """Collect the polygons once for all traces in the same building."""
    scene, height = building.scene, building.height
    rings, names, frames = _fixed(scene, height)
    moving: list[tuple[SceneObject, tuple[str, ...]]] = []
    count = 0
    for item in scene.objects:
        if item.frozen or not item.joints:
            continue
        links = [link for link in item.links if _in_reach(link.z_min, link.z_max, height)]
        for link in links:
            rings.extend(link.polygons)
            names.extend([f"{item.name}.{link.name}"] * len(link.polygons))
            frames.extend([count] * len(link.polygons))
            count += 1
        moving.append((item, tuple(link.name for link in links)))
    return _Shapes(_flatten(rings, names, frames), tuple(moving))


def only(obstacles: Obstacles, name: str) -> Obstacles:
    """Return the polygons of one solid, object (with all its links) or link."""
    kept = [i for i, owner in enumerate(obstacles.names) if about(owner, name)]
    offsets = obstacles.offsets
    parts = [obstacles.corners[offsets[i] : offsets[i + 1]] for i in kept]
    return Obstacles(
        np.concatenate(parts) if parts else np.empty((0, 2)),
        np.cumsum([0, *(len(part) for part in parts)], dtype=np.int64),
        obstacles.frame[kept],
        obstacles.circle[kept],
        obstacles.tracks,
        tuple(obstacles.names[i] for i in kept),
    )


def about(owner: str, name: str) -> bool:
    """Whether the polygon or contact of ``owner`` is one of the thing called ``name``."""
    return owner == name or owner.startswith(f"{name}.")


def _fixed(scene: Scene, height: float) -> tuple[list[Ring], list[str], list[int]]:
    rings: list[Ring] = []
    names: list[str] = []
    for solid in scene.solids:
        if _in_reach(solid.z_min, solid.z_max, height):
            rings.append(solid.polygon)
            names.append(solid.owner)
    for item in scene.objects:
        if not item.frozen and item.joints:
            continue
        poses = link_poses(item, item.initial)
        for link in item.links:
            if _in_reach(link.z_min, link.z_max, height):
                rings.extend(_placed(link, poses[link.name].apply_ring))
                names.extend([f"{item.name}.{link.name}"] * len(link.polygons))
    return rings, names, [-1] * len(rings)


def _placed(link: Link, place: Callable[[Ring], Ring]) -> list[Ring]:
    return [place(ring) for ring in link.polygons]


def _in_reach(z_min: float, z_max: float, height: float) -> bool:
    return z_min < height and z_max > 0.0


def _flatten(rings: list[Ring], names: list[str], frames: list[int]) -> Obstacles:
    """Return polygons as flat arrays, without tracks."""
    corners = np.array([corner for ring in rings for corner in ring], dtype=np.float64)
    offsets = np.cumsum([0, *(len(ring) for ring in rings)], dtype=np.int64)
    circle = np.array([_circle(ring) for ring in rings], dtype=np.float64)
    return Obstacles(
        corners.reshape(-1, 2),
        offsets,
        np.array(frames, dtype=np.int64),
        circle.reshape(-1, 3),
        np.empty((0, 0, 3)),
        tuple(names),
    )


def _circle(ring: Ring) -> tuple[float, float, float]:
    """Return a circle around ``ring``: centre of its bounding box and radius [m]."""
    (x, y), _ = footprint_box(ring)
    return x, y, max(float(np.hypot(cx - x, cy - y)) for cx, cy in ring)
