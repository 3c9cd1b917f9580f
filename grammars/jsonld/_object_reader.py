"""Reader of :class:`ObjectModel` values from the published vocabulary, of any writer."""

from __future__ import annotations

import math
import re
from typing import Final, TypeAlias

from grammars.jsonld._kinematics import (
    LENGTHS,
    PlacedFrame,
    PoseGraph,
    Positions,
    axis_vectors,
    is_moving,
    is_turning,
    joint_position,
    limits,
    scaled,
    slots,
)
from grammars.jsonld._nodes import Node, NodeGraph, index_by
from grammars.jsonld._object_writer import RESISTANCES, trim_rounding
from grammars.jsonld.vocabulary import DYN, GEOM, KC, OBJ, POLY, SCN, ST, local_name
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.kinematics import WORLD
from grammars.model.scene import Joint, Link
from grammars.scenery.model import NamedState, ObjectModel
from grammars.text.diagnostics import Severity, Where

_LEVEL: Final = 1e-6


class LinkShapes:
    """Reader of the shapes of links; adds problems to the findings of the nodes."""

    def __init__(self, nodes: NodeGraph) -> None:
        self._nodes = nodes
        self._positions = Positions(nodes)
        self._views: dict[str, list[Node]] = {}
        for kind in ("LinkPhysicsRepresentation", "LinkVisualRepresentation"):
            for body, views in index_by(nodes.by_id, OBJ[kind], OBJ["link"]).items():
                self._views.setdefault(body, views)

    def of(self, body: str) -> list[Node]:
        """Return the representations of a body, for collisions if there are any, or visual."""
        return self._views.get(body, [])

    def shape(
        self, view: Node, here: PlacedFrame, placed: dict[str, PlacedFrame]
    ) -> tuple[Ring, tuple[float, float]] | None:
        """Return the outline, the lowest and the highest point of a shape, in the object frame.

        ``here`` is the frame of its link. Returns ``None`` after an error.
        """
        shape = self._nodes.by_id.get(view.ref(OBJ["polytope"]) or "")
        if shape is None:
            return None
        if POLY["CuboidWithSize"] in shape.types:
            sizes = [scaled(shape, POLY[f"{axis}-size"], LENGTHS) for axis in "xyz"]
            if any(size is None or not 1e-6 < size < 1e6 for size in sizes):
                message = f"a size of cuboid {local_name(shape.id)} is below 1 µm or above 1000 km"
                self._nodes.add_error(shape.id, message)
                return None
            x, y, z = (size / 2 for size in sizes if size is not None)
            ring = here.pose.apply_ring(((-x, -y), (x, -y), (x, y), (-x, y)))
            return _tidy_ring(ring), (trim_rounding(here.z - z), trim_rounding(here.z + z))
        points = shape.refs(POLY["points"])
        outline = self._positions.outline(points) if len(points) >= 6 else None
        frame = placed.get(outline[0]) if outline is not None else None
        if outline is None or frame is None or not is_level(frame):
            message = (
                f"shape {local_name(shape.id)} is neither a cuboid nor a prism of known corners"
            )
            self._nodes.add_error(shape.id, message)
            return None
        corners = frame.pose.apply_ring(tuple((x, y) for x, y, _ in outline[1]))
        return self._prism(shape, corners, [trim_rounding(z + frame.z) for _, _, z in outline[1]])

    def _prism(
        self, shape: Node, corners: Ring, heights: list[float]
    ) -> tuple[Ring, tuple[float, float]] | None:
        import shapely

        hull = shapely.MultiPoint(corners).convex_hull
        half = len(corners) // 2
        ring = _tidy_ring(corners[:half])
        if not isinstance(hull, shapely.Polygon) or hull.area < 1e-9:
            self._nodes.add_error(shape.id, f"shape {local_name(shape.id)} has no area")
            return None
        if shapely.Polygon(ring).is_valid and abs(shapely.Polygon(ring).area - hull.area) < 1e-9:
            return ring, (min(heights), max(heights))
        outline = [(float(x), float(y)) for x, y in hull.exterior.coords[:-1]]
        message = f"shape {local_name(shape.id)} is not a convex prism: its convex hull is used"
        self._nodes.add_warning(shape.id, message)
        return _tidy_ring(tuple(reversed(outline))), (min(heights), max(heights))


def is_level(placed: PlacedFrame) -> bool:
    """Return whether a frame is not tilted."""
    return abs(placed.tilt) < _LEVEL


def _tidy_ring(ring: Ring) -> Ring:
    return tuple((trim_rounding(x), trim_rounding(y)) for x, y in ring)


_AXES: Final = {"x": 0.0, "y": math.pi / 2}
_Motion: TypeAlias = tuple[Point2, Point2, tuple[float, float]]
"""Anchor [m], axis, and limits [rad or m]."""


def scenery_name(name: str) -> str:
    """Return a valid name of the scenery language: letters, digits and underscores."""
    word = re.sub(r"\W+", "_", name).strip("_") or "unnamed"
    return f"_{word}" if word[0].isdigit() else word


def name_of(node: Node, owner: Node | None = None) -> str:
    """Return the name of a node: its own, or its identifier without that of its owner."""
    name = node.text(SCN["name"])
    if name is not None:
        return name
    name = local_name(node.id)
    if owner is not None:
        name = name.removeprefix(f"{local_name(owner.id)}-")
    return scenery_name(name)


class ObjectReader:
    """Reader of object models; adds problems to the findings of the nodes."""

    def __init__(self, nodes: NodeGraph, file: str) -> None:
        self._nodes = nodes
        self._file = file
        self._poses = PoseGraph(nodes)
        self._slots = slots(nodes)
        self._limits = limits(nodes)
        self._shapes = LinkShapes(nodes)
        self._inertias = index_by(nodes.by_id, DYN["RigidBodyInertia"], DYN["of-body"])
        self._trees = index_by(nodes.by_id, OBJ["JointWithTree"], OBJ["joint-without-tree"])
        self._states = index_by(nodes.by_id, ST["JointState"], ST["joint"])

    def read(self, node: Node) -> ObjectModel | None:
        """Return the model of an ``Object`` node, or ``None`` after an error."""
        previous = len(self._nodes.findings)
        placed = self._poses.reach(node.refs(OBJ["object-frame"])[0])
        order = {str(id): k for k, id in enumerate(node.refs(SCN["order"]))}
        bodies = self._bodies(node, order)
        links = {body: self._link(body, link, placed) for body, link in bodies.items()}
        chain = self._nodes.by_id.get(node.ref(OBJ["kinematic-chain"]) or "")
        ids = sorted(
            chain.refs(KC["joints"]) if chain is not None else [],
            key=lambda id: order.get(id, len(order)),
        )
        joints = {str(id): self._joint(self._nodes.get(id), node, bodies, placed) for id in ids}
        states = self._object_states(node, joints, order)
        if any(d.severity is Severity.ERROR for d in self._nodes.findings[previous:]):
            return None
        return ObjectModel(
            name_of(node),
            tuple(link for link in links.values() if link is not None),
            self._needed(joints),
            states,
            self._nodes.where(node.id, Where(self._file, 1, 1)),
        )

    def _bodies(self, node: Node, order: dict[str, int]) -> dict[str, Node]:
        """Return the links of an object by body, in order."""
        ids = sorted(node.refs(OBJ["object-links"]), key=lambda id: order.get(id, len(order)))
        bodies: dict[str, Node] = {}
        for id in ids:
            link = self._nodes.get(id)
            bodies[link.refs(OBJ["link"])[0]] = link
        return bodies

    def _link(self, body: str, link: Node, placed: dict[str, PlacedFrame]) -> Link | None:
        name = name_of(self._nodes.get(body))
        frame = link.ref(OBJ["link-frame"])
        here = placed.get(frame or "")
        if here is None or not is_level(here):
            problem = "is not connected to its object" if here is None else "is tilted"
            self._nodes.add_error(link.id, f"the frame of link {name} {problem}")
            return None
        if link.all(SCN["carrier"])[:1] == [True]:
            return Link(name, (), 0.0, 0.0, 0.0)
        rings: list[Ring] = []
        heights: list[float] = []
        for view in self._shapes.of(body):
            shape = self._shapes.shape(view, here, placed)
            if shape is not None:
                rings.append(shape[0])
                heights.extend(shape[1])
        if not rings:
            self._nodes.add_error(link.id, f"link {name} has no shape that can be read")
            return None
        return Link(name, tuple(rings), self._mass(body, name), min(heights), max(heights))

    def _mass(self, body: str, name: str) -> float:
        for inertia in self._inertias.get(body, []):
            mass = inertia.number(DYN["mass"])
            if mass is not None:
                return mass
        self._nodes.add_warning(body, f"link {name} has no mass", "1 kg is used")
        return 1.0

    def _joint(
        self, joint: Node, owner: Node, bodies: dict[str, Node], placed: dict[str, PlacedFrame]
    ) -> Joint | None:
        name = name_of(joint, owner)
        ends = self._ends(joint, bodies, placed)
        if ends is None:
            self._nodes.add_error(joint.id, f"joint {name} is not between two links of its object")
            return None
        parent, child = ends
        at = placed.get(bodies[child].ref(OBJ["link-frame"]) or "", PlacedFrame(Pose2())).pose
        motion: _Motion | None = ((at.x, at.y), (0.0, 0.0), (0.0, 0.0))
        if is_moving(joint):
            motion = self._motion(joint, name, parent, placed)
        if motion is None:
            return None
        anchor, axis, bounds = motion
        resistances = [joint.number(SCN[word]) or 0.0 for word in RESISTANCES]
        if min(resistances[:3]) < 0.0:
            self._nodes.add_error(joint.id, f"friction, stiffness or damping of {name} is negative")
        return Joint(
            name,
            "prismatic" if OBJ["PrismaticJoint"] in joint.types else "revolute",
            name_of(self._nodes.get(parent)) if parent in bodies else WORLD,
            name_of(self._nodes.get(child)),
            anchor,
            axis,
            *bounds,
            *resistances,
        )

    def _motion(
        self, joint: Node, name: str, parent: str, placed: dict[str, PlacedFrame]
    ) -> _Motion | None:
        """Return the motion of a joint in the object frame, or ``None`` after an error."""
        frame, slot = self._axis_frame(joint, parent)
        here = placed.get(frame)
        if here is None or not is_level(here):
            self._nodes.add_error(joint.id, f"joint {name} has no axis in its object")
            return None
        if is_turning(joint) != (slot == "z"):
            motion = "turns about a horizontal axis" if is_turning(joint) else "slides up and down"
            message = f"joint {name} {motion}: only motion in the plane is simulated"
            self._nodes.add_error(joint.id, message)
            return None
        axis = (0.0, 0.0)
        if not is_turning(joint):
            angle = here.pose.yaw + _AXES[slot]
            axis = (trim_rounding(math.cos(angle)), trim_rounding(math.sin(angle)))
        anchor = (trim_rounding(here.pose.x), trim_rounding(here.pose.y))
        lower, upper = (joint_position(side[0], joint) for side in self._limits[joint.id])
        return anchor, axis, (lower, upper)

    def _ends(
        self, joint: Node, bodies: dict[str, Node], placed: dict[str, PlacedFrame]
    ) -> tuple[str, str] | None:
        """Return parent and child body: from the tree, or the body nearer to the object first."""
        for tree in self._trees.get(joint.id, []):
            parent, children = tree.ref(OBJ["parent"]), tree.refs(OBJ["children"])
            if parent is not None and len(children) == 1 and children[0] in bodies:
                return parent, children[0]
        # Frames are in the order of their distance from the object's frame.
        near = list(placed)
        both = joint.refs(KC["between-attachments"])
        if len(both) != 2:
            return None

        def distance(body: str) -> int:
            parts = self._nodes.get(body).refs(GEOM["simplices"])
            return min((near.index(part) for part in parts if part in placed), default=len(near))

        parent, child = sorted(both, key=distance)
        return (parent, child) if child in bodies else None

    def _axis_frame(self, joint: Node, parent: str) -> tuple[str, str]:
        """Return the frame and the axis of the parent that the joint moves along."""
        members = set(self._nodes.get(parent).refs(GEOM["simplices"]))
        lines = sorted(axis_vectors(self._nodes, joint), key=lambda line: line not in members)
        for line in lines:
            for frame, slot in self._slots.get(line, []):
                return frame, slot
        return "", ""

    def _needed(self, joints: dict[str, Joint | None]) -> tuple[Joint, ...]:
        """Return the joints without fixed joints to links that stand still."""
        readable = {id: joint for id, joint in joints.items() if joint is not None}
        moving = {id for id in readable if is_moving(self._nodes.get(id))}
        moved = {readable[id].child for id in moving}
        while True:
            more = {id for id, j in readable.items() if id not in moving and j.parent in moved}
            if not more:
                return tuple(joint for id, joint in readable.items() if id in moving)
            moving |= more
            moved |= {readable[id].child for id in more}

    def _object_states(
        self, owner: Node, joints: dict[str, Joint | None], order: dict[str, int]
    ) -> tuple[NamedState, ...]:
        positions: dict[str, dict[str, float]] = {}
        for id, joint in joints.items():
            for entry in self._states.get(id, []):
                state, pose = (entry.refs(ST[word])[0] for word in ("state", "pose"))
                if joint is not None and pose in self._nodes.by_id:
                    value = joint_position(self._nodes.get(pose), self._nodes.get(id))
                    positions.setdefault(state, {})[joint.name] = value
        ids = sorted(positions, key=lambda id: order.get(id, len(order)))
        return tuple(
            NamedState(
                name_of(self._nodes.get(id), owner),
                tuple(positions[id].items()),
                self._nodes.where(id, Where(self._file, 1, 1)),
            )
            for id in ids
        )
