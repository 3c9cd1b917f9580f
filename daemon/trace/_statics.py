"""Latched messages (footprint, fixed frames, markers of the building), and poses of moving links.

The frame of a link is the frame of its object, moved along by the link. Both coincide if all
joints are at zero, so the polygons of a link in the object frame are constant in the link's frame.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from daemon.model import ros_messages as ros
from grammars.model.geometry import Floats, Point2, Pose2, Ring
from grammars.model.kinematics import cos_sin, link_tracks
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene, SceneObject

_COLOURS: Final = {
    "wall": (0.72, 0.72, 0.70, 1.0),
    "column": (0.55, 0.50, 0.45, 1.0),
    "divider": (0.60, 0.66, 0.62, 1.0),
    "object": (0.62, 0.40, 0.22, 1.0),
    "waypoint": (0.10, 0.55, 0.85, 1.0),
}
# visualization_msgs/Marker: ARROW, TEXT_VIEW_FACING, TRIANGLE_LIST.
_ARROW, _TEXT, _TRIANGLES = 0, 9, 11
_FLOOR_HEIGHT: Final = 0.02
"""Height of arrows above the floor [m], so that its plane does not hide half of them."""


@dataclass(frozen=True, slots=True)
class MovingLinks:
    """Links of a scene that joints can move, prepared for :meth:`poses`.

    ``names`` are ``<object>/<link>``, in the order of the scene.
    """

    names: tuple[str, ...]
    _objects: tuple[tuple[SceneObject, int, int], ...]
    """Objects that move: each with the column of its first joint, and the index of its first
    moving link."""

    @classmethod
    def of(cls, scene: Scene) -> MovingLinks:
        """Collect the moving links of all objects that are not frozen.

        Raises :class:`ValueError` when the joints of an object form no tree.
        """
        names: list[str] = []
        objects: list[tuple[SceneObject, int, int]] = []
        column = 0
        for item in scene.objects:
            if item.joints and not item.frozen:
                # Without rows this only raises an error for joints that form no tree.
                link_tracks(item, np.empty((0, len(item.joints))))
                objects.append((item, column, len(names)))
                names += (f"{item.name}/{link}" for link in _moving(item))
            column += len(item.joints)
        return cls(tuple(names), tuple(objects))

    def poses(self, positions: Floats) -> Floats:
        """Return the world poses (n, links, 4) as x, y, qz, qw for joint positions (n, k).

        ``qz`` and ``qw`` are the quaternion of the yaw.
        """
        out = np.empty((len(positions), len(self.names), 4))
        for item, column, index in self._objects:
            own = positions[:, column : column + len(item.joints)]
            # Doors rest most of the time: compute only rows whose bits differ from the row above.
            bits = np.ascontiguousarray(own).view(np.int64)
            new = np.ones(len(own), np.bool_)
            new[1:] = (bits[1:] != bits[:-1]).any(axis=1)
            tracks = link_tracks(item, own[new])
            latest = np.cumsum(new) - 1
            for place, link in enumerate(_moving(item), start=index):
                track = tracks[link]
                qw, qz = cos_sin(track[:, 2] / 2)
                out[:, place] = np.column_stack((track[:, 0], track[:, 1], qz, qw))[latest]
        return out


def _moving(item: SceneObject) -> list[str]:
    """Return the links of ``item`` that have a joint, in the order of its links."""
    children = {joint.child for joint in item.joints}
    return [link.name for link in item.links if link.name in children]


def footprint(robot: Robot) -> Any:
    """``/footprint`` in base_link."""
    corners = [ros.make("geometry_msgs/msg/Point32", x=x, y=y, z=0.0) for x, y in robot.footprint]
    return ros.make(
        "geometry_msgs/msg/PolygonStamped",
        header=ros.header(ros.time(0), "base_link"),
        polygon=ros.make("geometry_msgs/msg/Polygon", points=corners),
    )


def fixed_frames(robot: Robot, scene: Scene) -> Any:
    """``/tf_static``: base_link -> every laser, and map -> every link that never moves."""
    frames = []
    for laser in robot.lasers:
        mount = laser.mount
        frames.append(_transform("base_link", laser.frame, mount.x, mount.y, mount.yaw, laser.z))
    moving = frozenset(MovingLinks.of(scene).names)
    for item in scene.objects:
        fixed = {name: (p.x, p.y, p.yaw) for name, p in _frozen_poses(item)} if item.frozen else {}
        for link in item.links:
            name = f"{item.name}/{link.name}"
            if name not in moving:
                pose = fixed.get(link.name, (item.pose.x, item.pose.y, item.pose.yaw))
                frames.append(_transform("map", name, *pose))
    return ros.make("tf2_msgs/msg/TFMessage", transforms=frames)


def markers(scene: Scene, mission: Mission) -> Any:
    """``/scene``: the building in 3D for viewers.

    It has triangles for walls, columns and dividers in map, triangles for each link of an object
    in the link's frame (``frame_locked``: doors swing with tf), and an arrow and a label per
    waypoint. The arrow points along x for a waypoint without a heading.
    """
    items: list[Any] = []
    for kind in ("wall", "column", "divider"):
        solids = [s for s in scene.solids if s.kind == kind]
        points = [p for s in solids for p in _prism(s.polygon, s.z_min, s.z_max)]
        if points:
            items.append(_marker("map", f"{kind}s", 0, _TRIANGLES, kind, points=points))
    for item in scene.objects:
        for number, link in enumerate(item.links):
            points = [p for ring in link.polygons for p in _prism(ring, link.z_min, link.z_max)]
            frame = f"{item.name}/{link.name}"
            items.append(
                _marker(frame, item.name, number, _TRIANGLES, "object", points=points, locked=True)
            )
    for number, waypoint in enumerate(mission.waypoints):
        turn = ros.yaw_quaternion(waypoint.yaw or 0.0)
        at = ros.pose(waypoint.x, waypoint.y, *turn, z=_FLOOR_HEIGHT)
        items.append(
            _marker("map", "waypoints", number, _ARROW, "waypoint", at=at, scale=(0.5, 0.08, 0.08))
        )
        above = ros.pose(waypoint.x, waypoint.y, 0.0, 1.0, z=0.4)
        items.append(
            _marker(
                "map", "waypoint names", number, _TEXT, "waypoint",
                at=above, scale=(0.0, 0.0, 0.25), text=waypoint.id,
            )
        )  # fmt: skip
    return ros.make("visualization_msgs/msg/MarkerArray", markers=items)


def _frozen_poses(item: SceneObject) -> Iterable[tuple[str, Any]]:
    """Yield the links of a frozen object with their poses at the initial joint positions."""
    alone = replace(item, frozen=False)
    links = MovingLinks.of(Scene("", (), (), (), (alone,)))
    poses = links.poses(np.array([item.initial], np.float64).reshape(1, -1))
    for i, name in enumerate(links.names):
        x, y, qz, qw = poses[0, i].tolist()
        yield name.removeprefix(f"{item.name}/"), Pose2(x, y, 2.0 * math.atan2(qz, qw))


def _transform(parent: str, child: str, x: float, y: float, yaw: float, z: float = 0.0) -> Any:
    qz, qw = ros.yaw_quaternion(yaw)
    return ros.transform(ros.time(0), parent, child, x=x, y=y, z=z, qz=qz, qw=qw)


def _prism(ring: Ring, bottom: float, top: float) -> list[Any]:
    """Return the corners of triangles for the top and the sides of a convex prism."""
    corners: list[tuple[Point2, float]] = []
    # A fan from the first corner, because links and solids are convex. The bottom is not visible.
    for a, b in itertools.pairwise(ring[1:]):
        corners += [(ring[0], top), (a, top), (b, top)]
    for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
        corners += [(a, bottom), (b, bottom), (b, top), (a, bottom), (b, top), (a, top)]
    return [ros.point(x, y, z) for (x, y), z in corners]


def _marker(
    frame: str, namespace: str, number: int, kind: int, colour: str, *,
    points: list[Any] | None = None, at: Any = None, text: str = "", locked: bool = False,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Any:  # fmt: skip
    fields: dict[str, Any] = {
        "header": ros.header(ros.time(0), frame),
        "ns": namespace,
        "id": number,
        "type": kind,
        "action": 0,
        "pose": at or ros.pose(0.0, 0.0, 0.0, 1.0),
        "scale": ros.vector(*scale),
        "color": _colour(_COLOURS[colour]),
        "lifetime": ros.make("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
        "frame_locked": locked,
        "points": points or [],
        "colors": [],
        "texture_resource": "",
        "texture": ros.make(
            "sensor_msgs/msg/CompressedImage",
            header=ros.header(ros.time(0), ""),
            format="",
            data=np.zeros(0, np.uint8),
        ),
        "uv_coordinates": [],
        "text": text,
        "mesh_resource": "",
        "mesh_file": ros.make(
            "visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, np.uint8)
        ),
        "mesh_use_embedded_materials": False,
    }
    return ros.make("visualization_msgs/msg/Marker", **fields)


def _colour(rgba: tuple[float, float, float, float]) -> Any:
    r, g, b, a = rgba
    return ros.make("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=a)
