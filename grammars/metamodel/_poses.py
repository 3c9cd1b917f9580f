"""The pose graph: frames joined by relative poses, walked against their direction by inversion.

``Pose(of=A, with-respect-to=B)`` with coordinates T is the transform A -> B: from B to A one
multiplies by T, from A to B by its inverse. Names of nodes carry no meaning here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from grammars.floorplan import Point3
from grammars.metamodel._nodes import Node, Nodes, index_by
from grammars.metamodel._vocabulary import COORD, GEOM, QUDT, REL, UNIT, local_name
from grammars.values import Pose2

LENGTHS: Final = {UNIT["M"]: 1.0, UNIT["CentiM"]: 0.01, UNIT["MilliM"]: 0.001}
ANGLES: Final = {UNIT["RAD"]: 1.0, UNIT["DEG"]: math.pi / 180.0}
_LARGEST: Final = 1e6


@dataclass(frozen=True, slots=True)
class Edge:
    """One relative pose: the transform ``of`` -> ``wrt``, its height and its tilt about y."""

    id: str
    of: str
    wrt: str
    pose: Pose2
    z: float = 0.0
    tilt: float = 0.0


@dataclass(frozen=True, slots=True)
class Placed:
    """A frame seen from a root; ``edge`` is the pose it was reached by, ``parent`` from where."""

    pose: Pose2
    z: float = 0.0
    tilt: float = 0.0
    parent: str = ""
    edge: Edge | None = None

    @property
    def offset(self) -> Pose2:
        """The transform this frame -> ``parent``."""
        if self.edge is None:
            return Pose2()
        return self.edge.pose if self.edge.wrt == self.parent else self.edge.pose.inverse()


def scaled(node: Node, predicate: str, units: dict[str, float]) -> float | None:
    """Return a number of ``node`` in metres or radians, by the first fitting unit it names."""
    value = node.number(predicate)
    if value is None:
        return None
    factor = next((units[u] for u in node.refs(QUDT["unit"]) if u in units), 1.0)
    return value if factor == 1.0 else value * factor


class PoseGraph:
    """Every relative pose of a graph, ready to be walked from any frame."""

    def __init__(self, nodes: Nodes) -> None:
        self._nodes = nodes
        self.edges: list[Edge] = []
        self._around: dict[str, list[Edge]] = {}
        numbers = index_by(nodes.by_id, COORD["PoseCoordinate"], COORD["of-pose"])
        for node in nodes.of_type(REL["Pose"]):
            edge = self._edge(node, numbers.get(node.id, []))
            if edge is not None:
                self.edges.append(edge)
                self._around.setdefault(edge.of, []).append(edge)
                self._around.setdefault(edge.wrt, []).append(edge)

    def _edge(self, node: Node, coordinates: list[Node]) -> Edge | None:
        of, wrt = node.ref(REL["of"]), node.ref(REL["with-respect-to"])
        if of is None or wrt is None:
            self._nodes.error(node.id, f"pose {local_name(node.id)} lacks a frame")
            return None
        if not coordinates:
            self._nodes.error(node.id, f"pose {local_name(node.id)} has no coordinates")
            return None
        seen = coordinates[0].ref(COORD["as-seen-by"])
        if seen is not None and seen != wrt:
            self._nodes.error(
                coordinates[0].id,
                f"{local_name(coordinates[0].id)} is seen by {local_name(seen)}, "
                f"its pose is with respect to {local_name(wrt)}",
                "write the coordinates in the frame the pose is with respect to",
            )
        x, y, z = (scaled(coordinates[0], COORD[axis], LENGTHS) or 0.0 for axis in ("x", "y", "z"))
        alpha, beta = (
            scaled(coordinates[0], COORD[angle], ANGLES) or 0.0 for angle in ("alpha", "beta")
        )
        if max(abs(v) for v in (x, y, z)) > _LARGEST:
            self._nodes.error(coordinates[0].id, "a coordinate is farther away than 1000 km")
            return None
        return Edge(node.id, of, wrt, Pose2(x, y, alpha), z, beta)

    def around(self, frame: str) -> list[Edge]:
        """Return the poses that involve ``frame``."""
        return self._around.get(frame, [])

    def reach(self, root: str) -> dict[str, Placed]:
        """Return every frame that is connected to ``root``, in the root's coordinates.

        A frame reached against its direction hangs on the frame it is placed by: the wall by which
        a room is placed is put, once the room is known, where the room has it.
        """
        found = {root: Placed(Pose2())}
        queue = [root]
        for frame in queue:
            edges = self.around(frame)
            for edge in [e for e in edges if e.of == frame]:
                if edge.wrt not in found:
                    here = found[frame]
                    back = here.pose @ edge.pose.inverse()
                    found[edge.wrt] = Placed(
                        back, here.z - edge.z, here.tilt - edge.tilt, frame, edge
                    )
                    queue.append(edge.wrt)
                    if frame != root:
                        settled = back @ edge.pose
                        found[frame] = Placed(settled, here.z, here.tilt, here.parent, here.edge)
            here = found[frame]
            for edge in edges:
                if edge.wrt == frame and edge.of not in found:
                    found[edge.of] = Placed(
                        here.pose @ edge.pose, here.z + edge.z, here.tilt + edge.tilt, frame, edge
                    )
                    queue.append(edge.of)
        return found


class Positions:
    """Where points are: the frame that sees them, and their coordinates in it [m]."""

    def __init__(self, nodes: Nodes) -> None:
        self._frames: dict[str, str] = {}
        self._points: dict[str, Point3] = {}
        numbers = index_by(nodes.by_id, COORD["PositionCoordinate"], COORD["of-position"])
        origins: dict[str, str] = {}
        for frame in nodes.of_type(GEOM["Frame"]):
            origin = frame.ref(GEOM["origin"])
            if origin is not None:
                origins.setdefault(origin, frame.id)
        for position in nodes.of_type(REL["Position"]):
            point = position.ref(REL["of"])
            for coordinate in numbers.get(position.id, [])[:1] if point else []:
                seen = coordinate.ref(COORD["as-seen-by"]) or origins.get(
                    position.ref(REL["with-respect-to"]) or ""
                )
                if seen is None or point is None:
                    continue
                x, y, z = (
                    scaled(coordinate, COORD[axis], LENGTHS) or 0.0 for axis in ("x", "y", "z")
                )
                self._frames[point] = seen
                self._points[point] = (x, y, z)

    def outline(self, points: Iterable[str]) -> tuple[str, tuple[Point3, ...]] | None:
        """Return the one frame that sees all ``points``, and their coordinates; else nothing."""
        names = list(points)
        frames = {self._frames.get(name) for name in names}
        if len(frames) != 1 or None in frames:
            return None
        return str(self._frames[names[0]]), tuple(self._points[name] for name in names)
