"""Obstacles of a robot: filled convex polygons of everything that overlaps it in height.

Joints and links of objects are placed over the whole trace at once.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.trace import Trace
from grammars.model import kinematics
from grammars.model.geometry import Floats, Point2, Ring
from grammars.model.kinematics import WORLD, link_poses
from grammars.model.scene import Joint, Scene, SceneObject


@kernel
def cos_sin(angles: Floats) -> tuple[Floats, Floats]:
    """Return cosine and sine of ``angles`` (n,) [rad] from the C library.

    numpy's own differ in the last bit between machines with different vector units, and verdicts
    must not.
    """
    cosines, sines = np.empty(len(angles)), np.empty(len(angles))
    for i in range(len(angles)):
        cosines[i], sines[i] = math.cos(angles[i]), math.sin(angles[i])
    return cosines, sines


def joint_positions(trace: Trace, obj: SceneObject, time: Floats) -> Floats:
    """Return recorded positions (n, joints) of ``obj`` [rad or m] on ``time`` (n,).

    Positions between recorded samples are interpolated, as :class:`daemon.trace.JointTrack` asks.
    Joints stand at their initial position until first recorded.
    """
    track = trace.joints
    column = {name: index for index, name in enumerate(track.names)}
    positions = np.empty((len(time), len(obj.joints)))
    for index, (joint, initial) in enumerate(zip(obj.joints, obj.initial, strict=True)):
        name = f"{obj.name}.{joint.name}"
        if name not in column or not len(track.time):
            positions[:, index] = initial
            continue
        recorded = track.position[:, column[name]]
        # Most doors never move.
        if (recorded == initial).all():
            positions[:, index] = initial
        else:
            positions[:, index] = np.interp(time, track.time, recorded, left=initial)
    return positions


def link_tracks(obj: SceneObject, positions: Floats) -> dict[str, Floats]:
    """Return :func:`grammars.model.kinematics.link_tracks`, with compiled trigonometry.

    Most doors never move: their tracks are computed once and are read-only.
    """
    if len(positions) < 2 or (positions != positions[:1]).any():
        return kinematics.link_tracks(obj, positions, cos_sin)
    once = kinematics.link_tracks(obj, positions[:1], cos_sin)
    return {name: np.broadcast_to(track, (len(positions), 3)) for name, track in once.items()}


def hinge_foot(obj: SceneObject, joint: Joint, positions: Floats) -> tuple[Floats, Floats]:
    """Return the place of the anchor of ``joint`` in the world over time: x (n,), y (n,) [m]."""
    if joint.parent == WORLD:
        parent = np.tile((obj.pose.x, obj.pose.y, obj.pose.yaw), (len(positions), 1))
    else:
        parent = link_tracks(obj, positions)[joint.parent]
    c, s = cos_sin(parent[:, 2].copy())
    x, y = joint.anchor
    return parent[:, 0] + c * x - s * y, parent[:, 1] + s * x + c * y


IndexArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class ObstaclePolygons:
    """Convex polygons as flat arrays.

    ``corners`` (v, 2) [m]; polygon ``p`` has corners ``offsets[p]:offsets[p + 1]`` in the frame
    ``frame[p]`` (-1: world), inside the circle ``circle[p]`` = (x, y, radius). ``tracks``
    (n, frames, 3) are the poses of the frames over time. ``names`` (p,) are their owners.
    """

    corners: Floats
    offsets: IndexArray
    frame: IndexArray
    circle: Floats
    tracks: Floats
    names: tuple[str, ...]


def footprint_box(footprint: Ring) -> tuple[Point2, Point2]:
    """Return centre and half extents [m] of the box around ``footprint``, base frame."""
    xs, ys = [x for x, _ in footprint], [y for _, y in footprint]
    centre = ((max(xs) + min(xs)) / 2.0, (max(ys) + min(ys)) / 2.0)
    return centre, ((max(xs) - min(xs)) / 2.0, (max(ys) - min(ys)) / 2.0)


def obstacles_of(trace: Trace, time: Floats) -> ObstaclePolygons:
    """Collect the obstacles of the robot's body: solids and links that overlap its height."""
    building = DigestedScene(trace.spec.scene, trace.scene)
    still, moving = _obstacle_shapes(building, trace.spec.robot.height)
    tracks: list[Floats] = []
    for item, links in moving:
        poses = link_tracks(item, joint_positions(trace, item, time))
        tracks.extend(poses[name] for name in links)
    return replace(still, tracks=_side_by_side(tracks, len(time)))


def _side_by_side(tracks: list[Floats], count: int) -> Floats:
    """Return tracks (count, 3) as one array (count, tracks, 3)."""
    stacked = np.empty((count, len(tracks), 3))
    if count and tracks:
        # Fill in all initial poses at once, then overwrite the moving tracks.
        stacked[:] = np.stack([track[0] for track in tracks])
        for index, track in enumerate(tracks):
            if track.strides[0]:
                stacked[:, index] = track
    return stacked


@dataclass(frozen=True, slots=True)
class DigestedScene:
    """A scene as a key, equal by its ``digest``: hashing its polygons would take long."""

    digest: str
    scene: Scene = field(compare=False)


@functools.lru_cache(maxsize=16)
def _obstacle_shapes(
    building: DigestedScene, height: float
) -> tuple[ObstaclePolygons, tuple[tuple[SceneObject, tuple[str, ...]], ...]]:
    """Return the obstacles of a building without their tracks, and the links that have tracks.

    They are the same for all traces of robots of one height in a building.
    """
    scene = building.scene
    rings, names, frames = _fixed_rings(scene, height)
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
    return _flatten(rings, names, frames), tuple(moving)


def obstacles_named(obstacles: ObstaclePolygons, *names: str) -> ObstaclePolygons:
    """Return the polygons of solids, objects (with all their links) or links."""
    owned = {owner: any(belongs_to(owner, name) for name in names) for owner in obstacles.names}
    indices = [i for i, owner in enumerate(obstacles.names) if owned[owner]]
    offsets = obstacles.offsets
    parts = [obstacles.corners[offsets[i] : offsets[i + 1]] for i in indices]
    return ObstaclePolygons(
        np.concatenate(parts) if parts else np.empty((0, 2)),
        np.cumsum([0, *(len(part) for part in parts)], dtype=np.int64),
        obstacles.frame[indices],
        obstacles.circle[indices],
        obstacles.tracks,
        tuple(obstacles.names[i] for i in indices),
    )


def belongs_to(owner: str, name: str) -> bool:
    """Return whether the polygon or contact of ``owner`` belongs to the thing called ``name``."""
    return owner == name or owner.startswith(f"{name}.")


def _fixed_rings(scene: Scene, height: float) -> tuple[list[Ring], list[str], list[int]]:
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
                rings.extend(map(poses[link.name].apply_ring, link.polygons))
                names.extend([f"{item.name}.{link.name}"] * len(link.polygons))
    return rings, names, [-1] * len(rings)


def _in_reach(z_min: float, z_max: float, height: float) -> bool:
    return z_min < height and z_max > 0.0


def _flatten(rings: list[Ring], names: list[str], frames: list[int]) -> ObstaclePolygons:
    """Return polygons as flat arrays, without tracks."""
    corners = np.array([corner for ring in rings for corner in ring], dtype=np.float64)
    offsets = np.cumsum([0, *(len(ring) for ring in rings)], dtype=np.int64)
    circle = np.array([_circle(ring) for ring in rings], dtype=np.float64)
    return ObstaclePolygons(
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
