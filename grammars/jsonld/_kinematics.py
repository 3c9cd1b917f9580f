"""Geometry in a graph: frames, relative poses, joints, and the nodes of shapes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from grammars.floorplan import Point3
from grammars.jsonld._nodes import Node, NodeGraph, Ref, index_by
from grammars.jsonld.vocabulary import (
    COORD,
    GEOM,
    KC,
    KC_STATE,
    OBJ,
    QUDT,
    REL,
    UNIT,
)
from grammars.model.geometry import Pose2

LENGTHS: Final = {UNIT["M"]: 1.0, UNIT["CentiM"]: 0.01, UNIT["MilliM"]: 0.001}
ANGLES: Final = {UNIT["RAD"]: 1.0, UNIT["DEG"]: math.pi / 180.0}
_LARGEST: Final = 1e6


@dataclass(frozen=True, slots=True)
class PoseEdge:
    """Relative pose: the transform ``of`` -> ``wrt``, its height and its tilt about y."""

    id: str
    of: str
    wrt: str
    pose: Pose2
    z: float = 0.0
    tilt: float = 0.0


@dataclass(frozen=True, slots=True)
class PlacedFrame:
    """Frame in root coordinates; ``edge`` is the pose that connects it to ``parent``."""

    pose: Pose2
    z: float = 0.0
    tilt: float = 0.0
    parent: str = ""
    edge: PoseEdge | None = None

    @property
    def offset(self) -> Pose2:
        """Transform from this frame to ``parent``."""
        if self.edge is None:
            return Pose2()
        return self.edge.pose if self.edge.wrt == self.parent else self.edge.pose.inverse()


def scaled(node: Node, predicate: str, units: dict[str, float]) -> float | None:
    """Return a number of ``node`` in metres or radians, converted from the first fitting unit."""
    value = node.number(predicate)
    if value is None:
        return None
    # Coordinates of a pose name a unit of length and one of angle; the default is metres, radians.
    factor = next((units[u] for u in node.refs(QUDT["unit"]) if u in units), 1.0)
    return value if factor == 1.0 else value * factor


class PoseGraph:
    """Relative poses of a graph as edges between frames."""

    def __init__(self, nodes: NodeGraph) -> None:
        self._nodes = nodes
        self._around: dict[str, list[PoseEdge]] = {}
        numbers = index_by(nodes.by_id, COORD["PoseCoordinate"], COORD["of-pose"])
        for node in nodes.of_type(REL["Pose"]):
            for coordinates in numbers.get(node.id, ())[:1]:
                edge = self._edge(node, coordinates)
                self._around.setdefault(edge.of, []).append(edge)
                self._around.setdefault(edge.wrt, []).append(edge)

    def _edge(self, node: Node, coordinates: Node) -> PoseEdge:
        of, wrt = node.refs(REL["of"])[0], node.refs(REL["with-respect-to"])[0]
        x, y, z = (scaled(coordinates, COORD[axis], LENGTHS) or 0.0 for axis in ("x", "y", "z"))
        alpha, beta = (
            scaled(coordinates, COORD[angle], ANGLES) or 0.0 for angle in ("alpha", "beta")
        )
        if max(abs(v) for v in (x, y, z)) > _LARGEST:
            self._nodes.add_error(coordinates.id, "a coordinate is farther away than 1000 km")
        return PoseEdge(node.id, of, wrt, Pose2(x, y, alpha), z, beta)

    def reach(self, root: str) -> dict[str, PlacedFrame]:
        """Return every frame connected to ``root``, in coordinates of the root.

        A frame reached against the direction of its pose is placed anew from its target. For
        example, the wall by which a room is placed finally takes its place from the room.
        """
        placed = {root: PlacedFrame(Pose2())}
        queue = [root]
        for frame in queue:
            edges = self._around.get(frame, ())
            for edge in [e for e in edges if e.of == frame]:
                if edge.wrt not in placed:
                    here = placed[frame]
                    back = here.pose @ edge.pose.inverse()
                    placed[edge.wrt] = PlacedFrame(
                        back, here.z - edge.z, here.tilt - edge.tilt, frame, edge
                    )
                    queue.append(edge.wrt)
                    # Composing a pose with its inverse changes the last digits. Placing the frame
                    # anew, as the language does, gives the same bits as the text of the plan.
                    if frame != root:
                        settled = back @ edge.pose
                        placed[frame] = PlacedFrame(
                            settled, here.z, here.tilt, here.parent, here.edge
                        )
            here = placed[frame]
            for edge in edges:
                if edge.wrt == frame and edge.of not in placed:
                    placed[edge.of] = PlacedFrame(
                        here.pose @ edge.pose, here.z + edge.z, here.tilt + edge.tilt, frame, edge
                    )
                    queue.append(edge.of)
        return placed


class Positions:
    """Places of points: the frame that sees them, and their coordinates in it [m]."""

    def __init__(self, nodes: NodeGraph) -> None:
        self._frames: dict[str, str] = {}
        self._points: dict[str, Point3] = {}
        numbers = index_by(nodes.by_id, COORD["PositionCoordinate"], COORD["of-position"])
        origins: dict[str, str] = {}
        for frame in nodes.of_type(GEOM["Frame"]):
            origin = frame.ref(GEOM["origin"])
            if origin is not None:
                origins.setdefault(origin, frame.id)
        for position in nodes.of_type(REL["Position"]):
            point = position.refs(REL["of"])[0]
            for coordinate in numbers.get(position.id, [])[:1]:
                # Other tools may omit the frame that sees a point: then it is the frame of the
                # origin that the position is with respect to.
                observer = coordinate.ref(COORD["as-seen-by"]) or origins.get(
                    position.ref(REL["with-respect-to"]) or ""
                )
                if observer is None:
                    continue
                x, y, z = (
                    scaled(coordinate, COORD[axis], LENGTHS) or 0.0 for axis in ("x", "y", "z")
                )
                self._frames[point] = observer
                self._points[point] = (x, y, z)

    def outline(self, points: Iterable[str]) -> tuple[str, tuple[Point3, ...]] | None:
        """Return the common frame of ``points`` and their coordinates, or ``None``."""
        names = list(points)
        frames = {self._frames.get(name) for name in names}
        if len(frames) != 1 or None in frames:
            return None
        return str(self._frames[names[0]]), tuple(self._points[name] for name in names)


_SLOTS: Final = ("vector-x", "vector-y", "vector-z")


def limits(nodes: NodeGraph) -> dict[str, tuple[list[Node], list[Node]]]:
    """Return the lower and upper limit nodes of every joint with limits."""
    by_joint: dict[str, tuple[list[Node], list[Node]]] = {}
    for side, kind in enumerate(("JointLowerLimit", "JointUpperLimit")):
        for node in nodes.of_type(OBJ[kind]):
            for joint in node.refs(KC_STATE["of-joint"]):
                by_joint.setdefault(joint, ([], []))[side].append(node)
    return by_joint


def is_turning(joint: Node) -> bool:
    """Return whether a joint is revolute."""
    return KC["RevoluteJoint"] in joint.types


def is_moving(joint: Node) -> bool:
    """Return whether a joint is revolute or prismatic."""
    return is_turning(joint) or OBJ["PrismaticJoint"] in joint.types


def joint_position(node: Node, joint: Node) -> float:
    """Return a joint position in rad or m."""
    return scaled(node, QUDT["value"], ANGLES if is_turning(joint) else LENGTHS) or 0.0


def axis_vectors(nodes: NodeGraph, joint: Node) -> list[Ref]:
    """Return the vectors of the line that a joint turns about or slides along."""
    axis = nodes.by_id.get(joint.ref(KC["common-axis"]) or "")
    return axis.refs(REL["lines"]) if axis is not None else []


def slots(nodes: NodeGraph) -> dict[str, list[tuple[str, str]]]:
    """Return, by vector, the frames whose axis it is, with the axis (``x``, ``y``, ``z``)."""
    by_vector: dict[str, list[tuple[str, str]]] = {}
    for frame in nodes.of_type(GEOM["Frame"]):
        for slot in _SLOTS:
            for vector in frame.refs(GEOM[slot]):
                by_vector.setdefault(vector, []).append((frame.id, slot[-1]))
    return by_vector


Json: TypeAlias = dict[str, Any]

POINT: Final = ["3D", "Euclidean", "Point"]
_POSE_COORDINATE: Final = ["PoseReference", "PoseCoordinate", "VectorXYZ", "EulerAngles"]
_POSITION_COORDINATE: Final = ["PositionReference", "PositionCoordinate", "VectorXYZ"]


def frame_nodes(frame: str, origin: str) -> list[Json]:
    """Return a plain frame and its origin."""
    return [
        {"@id": origin, "@type": POINT},
        {"@id": frame, "@type": "Frame", "origin": origin},
    ]


def pose_nodes(
    ids: tuple[str, str], of: str, wrt: str, pose: Pose2, z: float = 0.0, tilt: float = 0.0
) -> list[Json]:
    """Return the pose of frame ``of`` with respect to ``wrt``, and its coordinates.

    ``ids`` are the identifiers of these two nodes.
    """
    return [
        {"@id": ids[0], "@type": "Pose", "of": of, "with-respect-to": wrt},
        {
            "@id": ids[1],
            "@type": _POSE_COORDINATE,
            "of-pose": ids[0],
            "as-seen-by": wrt,
            "unit": ["M", "RAD"],
            "alpha": pose.yaw,
            "beta": tilt,
            "x": pose.x,
            "y": pose.y,
            "z": z,
        },
    ]


def position_nodes(
    ids: tuple[str, str], point: str, frame: str, origin: str, at: Point3
) -> list[Json]:
    """Return the position of a point in a frame with this origin, and its coordinates.

    ``ids`` are the identifiers of these two nodes.
    """
    x, y, z = at
    return [
        {"@id": ids[0], "@type": "Position", "of": point, "with-respect-to": origin},
        {
            "@id": ids[1],
            "@type": _POSITION_COORDINATE,
            "of-position": ids[0],
            "as-seen-by": frame,
            "unit": "M",
            "x": x,
            "y": y,
            "z": z,
        },
    ]


def polyhedron_node(id: str, points: list[str]) -> Json:
    """Return a prism; the first half of ``points`` is its near ring, the second its far ring."""
    count = len(points) // 2
    sides = [[k, (k + 1) % count, (k + 1) % count + count, k + count] for k in range(count)]
    faces = [list(range(count)), list(range(count, 2 * count)), *sides]
    return {
        "@id": id,
        "@type": "Polyhedron",
        "points": points,
        "faces": [[points[k] for k in face] for face in faces],
    }
