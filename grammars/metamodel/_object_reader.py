"""From objects in the published vocabulary to :class:`ObjectModel` values, whoever wrote them."""

from __future__ import annotations

import math
import re
from typing import Final

from grammars.diagnostics import Where
from grammars.metamodel._joints import (
    axis_vectors,
    is_moving,
    is_turning,
    limits,
    position,
    slots,
)
from grammars.metamodel._link_shapes import LinkShapes, is_level
from grammars.metamodel._nodes import Node, Nodes, index_by
from grammars.metamodel._object_geometry import tidy
from grammars.metamodel._object_writer import WORLD
from grammars.metamodel._poses import Placed, PoseGraph
from grammars.metamodel._vocabulary import DYN, GEOM, KC, OBJ, SCN, ST, local_name
from grammars.scene import Joint, Link
from grammars.scenery.model import ObjectModel, State
from grammars.values import Point2, Pose2, Ring

_AXES: Final = {"x": 0.0, "y": math.pi / 2}


def spoken(name: str) -> str:
    """Return a name the scenery language can say: letters, digits and underscores."""
    word = re.sub(r"\W+", "_", name).strip("_") or "unnamed"
    return f"_{word}" if word[0].isdigit() else word


def name_of(node: Node, owner: Node | None = None) -> str:
    """Return what a node is called: as it says, or by its identifier without its owner's."""
    said = node.text(SCN["name"])
    if said is not None:
        return said
    name = local_name(node.id)
    if owner is not None:
        name = name.removeprefix(f"{local_name(owner.id)}-")
    return spoken(name)


class ObjectReader:
    """Reads object models; problems are noted in the nodes' findings."""

    def __init__(self, nodes: Nodes, file: str) -> None:
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
        """Return the model an ``Object`` node describes, or ``None`` after noting why not."""
        before = len(self._nodes.findings)
        base = node.ref(OBJ["object-frame"])
        if base is None:
            self._nodes.error(node.id, f"object {local_name(node.id)} has no object-frame")
            return None
        placed = self._poses.reach(base)
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
        if any(d.severity.value == "error" for d in self._nodes.findings[before:]):
            return None
        return ObjectModel(
            name_of(node),
            tuple(link for link in links.values() if link is not None),
            self._needed(joints),
            states,
            self._nodes.where(node.id, Where(self._file)),
        )

    def _bodies(self, node: Node, order: dict[str, int]) -> dict[str, Node]:
        """Return the object links of an object by their body, in order."""
        ids = sorted(node.refs(OBJ["object-links"]), key=lambda id: order.get(id, len(order)))
        found: dict[str, Node] = {}
        for id in ids:
            link = self._nodes.get(id)
            body = link.ref(OBJ["link"])
            if body is None:
                self._nodes.error(id, f"link {local_name(id)} has no body")
            else:
                found[body] = link
        if not found:
            self._nodes.error(node.id, f"object {local_name(node.id)} has no links")
        return found

    def _link(self, body: str, link: Node, placed: dict[str, Placed]) -> Link | None:
        name = self._body_name(body)
        frame = link.ref(OBJ["link-frame"])
        here = placed.get(frame or "")
        if here is None or not is_level(here):
            problem = "is not connected to its object" if here is None else "is tilted"
            self._nodes.error(link.id, f"the frame of link {name} {problem}")
            return None
        if link.all(SCN["carrier"])[:1] == [True]:
            return Link(name, (), 0.0, 0.0, 0.0)
        rings: list[Ring] = []
        heights: list[float] = []
        for view in self._shapes.of(body):
            drawn = self._shapes.shape(view, here, placed)
            if drawn is not None:
                rings.append(drawn[0])
                heights.extend(drawn[1])
        if not rings:
            self._nodes.error(link.id, f"link {name} has no shape that can be read")
            return None
        return Link(name, tuple(rings), self._mass(body, name), min(heights), max(heights))

    def _body_name(self, body: str) -> str:
        return name_of(self._nodes.get(body))

    def _mass(self, body: str, name: str) -> float:
        for inertia in self._inertias.get(body, []):
            mass = inertia.number(DYN["mass"])
            if mass is not None and 0.0 < mass < 1e6:
                return mass
            self._nodes.error(inertia.id, f"the mass of link {name} is not greater than 0 kg")
            return 1.0
        self._nodes.warn(body, f"link {name} has no mass", "1 kg is taken")
        return 1.0

    def _joint(
        self, joint: Node, owner: Node, bodies: dict[str, Node], placed: dict[str, Placed]
    ) -> Joint | None:
        name = name_of(joint, owner)
        ends = self._ends(joint, bodies, placed)
        if ends is None:
            self._nodes.error(joint.id, f"joint {name} is not between two links of its object")
            return None
        parent, child = ends
        if not is_moving(joint):
            at = placed.get(bodies[child].ref(OBJ["link-frame"]) or "", Placed(Pose2())).pose
            return self._made(joint, name, ends, bodies, (at.x, at.y), (0.0, 0.0), (0.0, 0.0))
        frame, slot = self._axis_frame(joint, parent)
        here = placed.get(frame)
        bounds = self._limits.get(joint.id, ([], []))
        values = [position(side[0], joint) if side else None for side in bounds]
        if here is None or not is_level(here) or values[0] is None or values[1] is None:
            message = f"joint {name} has no axis in its object, or no limits"
            self._nodes.error(joint.id, message)
            return None
        if is_turning(joint) != (slot == "z"):
            what = "turns about a lying axis" if is_turning(joint) else "slides up and down"
            message = f"joint {name} {what}: only motion in the plane is simulated"
            self._nodes.error(joint.id, message)
            return None
        anchor = (tidy(here.pose.x), tidy(here.pose.y))
        axis = (0.0, 0.0)
        if not is_turning(joint):
            angle = here.pose.yaw + _AXES[slot]
            axis = (tidy(math.cos(angle)), tidy(math.sin(angle)))
        return self._made(joint, name, ends, bodies, anchor, axis, (values[0], values[1]))

    def _made(
        self,
        joint: Node,
        name: str,
        ends: tuple[str, str],
        bodies: dict[str, Node],
        anchor: Point2,
        axis: Point2,
        bounds: tuple[float, float],
    ) -> Joint:
        parent = self._body_name(ends[0]) if ends[0] in bodies else WORLD
        friction, stiffness, damping, rest = (
            joint.number(SCN[word]) or 0.0 for word in ("friction", "stiffness", "damping", "rest")
        )
        if min(friction, stiffness, damping) < 0.0:
            self._nodes.error(joint.id, f"friction, stiffness or damping of {name} is negative")
        return Joint(
            name,
            "prismatic" if OBJ["PrismaticJoint"] in joint.types else "revolute",
            parent,
            self._body_name(ends[1]),
            anchor,
            axis,
            *bounds,
            friction,
            stiffness,
            damping,
            rest,
        )

    def _ends(
        self, joint: Node, bodies: dict[str, Node], placed: dict[str, Placed]
    ) -> tuple[str, str] | None:
        """Return parent and child body: as the tree says, else the nearer to the object frame."""
        for tree in self._trees.get(joint.id, []):
            parent, children = tree.ref(OBJ["parent"]), tree.refs(OBJ["children"])
            if parent is not None and len(children) == 1 and children[0] in bodies:
                return parent, children[0]
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
        """Return the frame of the parent whose axis the joint moves along, and which axis."""
        members = set(self._nodes.get(parent).refs(GEOM["simplices"]))
        lines = sorted(axis_vectors(self._nodes, joint), key=lambda line: line not in members)
        for line in lines:
            for frame, slot in self._slots.get(line, []):
                return frame, slot
        return "", ""

    def _needed(self, joints: dict[str, Joint | None]) -> tuple[Joint, ...]:
        """Leave out fixed joints to what stands still: such links need no joint here."""
        known = {id: joint for id, joint in joints.items() if joint is not None}
        moving = {id for id in known if is_moving(self._nodes.get(id))}
        moved = {known[id].child for id in moving}
        while True:
            more = {id for id, j in known.items() if id not in moving and j.parent in moved}
            if not more:
                return tuple(joint for id, joint in known.items() if id in moving)
            moving |= more
            moved |= {known[id].child for id in more}

    def _object_states(
        self, owner: Node, joints: dict[str, Joint | None], order: dict[str, int]
    ) -> tuple[State, ...]:
        found: dict[str, dict[str, float]] = {}
        for id, joint in joints.items():
            for entry in self._states.get(id, []):
                state = entry.ref(ST["state"])
                pose = self._nodes.by_id.get(entry.ref(ST["pose"]) or "")
                value = position(pose, self._nodes.get(id)) if pose is not None else None
                if state is not None and value is not None and joint is not None:
                    found.setdefault(state, {})[joint.name] = value
        ids = sorted(found, key=lambda id: order.get(id, len(order)))
        return tuple(
            State(
                name_of(self._nodes.get(id), owner),
                tuple(found[id].items()),
                self._nodes.where(id, Where(self._file)),
            )
            for id in ids
        )
