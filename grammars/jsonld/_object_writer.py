"""Writer of object models in the published vocabulary: bodies, joints, shapes, states."""

from __future__ import annotations

import math
from typing import Final

from grammars.jsonld._kinematics import (
    POINT,
    Json,
    frame_nodes,
    polyhedron_node,
    pose_nodes,
    position_nodes,
)
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.kinematics import WORLD
from grammars.model.scene import Joint, Link
from grammars.scenery.model import ObjectModel

_DIGITS: Final = 12
_SQUARE: Final = 1e-9


def trim_rounding(value: float) -> float:
    """Return ``value`` without rounding errors of sums of decimals."""
    return round(value, _DIGITS) + 0.0


def joint_axis(joint: Joint) -> tuple[Pose2, str]:
    """Return the joint frame in the object frame, and its axis that the joint moves along."""
    x, y = joint.anchor
    if joint.kind == "revolute":
        return Pose2(x, y, 0.0), "z"
    if joint.axis == (0.0, 1.0):
        return Pose2(x, y, 0.0), "y"
    return Pose2(x, y, math.atan2(joint.axis[1], joint.axis[0])), "x"


def relative(parent: Pose2, child: Pose2) -> Pose2:
    """Return the transform from child frame to parent frame."""
    pose = parent.inverse() @ child
    return Pose2(trim_rounding(pose.x), trim_rounding(pose.y), pose.yaw)


def link_frame(link: Link) -> tuple[Pose2, float]:
    """Return the frame of a link in the object frame, and its height: centred for boxes."""
    box = box_of(link)
    # A cuboid of the vocabulary has a size but no place: its centre is the frame of its link.
    # Corners of other shapes are in the frame of the object.
    if box is None:
        return Pose2(), 0.0
    return box[0], trim_rounding((link.z_min + link.z_max) / 2)


def box_of(link: Link) -> tuple[Pose2, float, float] | None:
    """Return centre and edge lengths of a link that is one rectangle, otherwise ``None``."""
    if len(link.polygons) != 1 or len(link.polygons[0]) != 4:
        return None
    a, b, c, d = link.polygons[0]
    along, across = _minus(b, a), _minus(d, a)
    skew = abs(along[0] * across[0] + along[1] * across[1])
    if skew > _SQUARE or math.dist(_plus(b, across), c) > _SQUARE:
        return None
    centre = ((a[0] + c[0]) / 2, (a[1] + c[1]) / 2)
    yaw = math.atan2(along[1], along[0])
    pose = Pose2(
        trim_rounding(centre[0]),
        trim_rounding(centre[1]),
        trim_rounding(yaw) if abs(yaw) < _SQUARE else yaw,
    )
    return pose, trim_rounding(math.hypot(*along)), trim_rounding(math.hypot(*across))


def _minus(a: Point2, b: Point2) -> Point2:
    return (a[0] - b[0], a[1] - b[1])


def _plus(a: Point2, b: Point2) -> Point2:
    return (a[0] + b[0], a[1] + b[1])


def moments(mass: float, x: float, y: float, z: float) -> dict[str, float]:
    """Return the principal moments of inertia of a box [kg m²]."""
    return {
        "xx": mass * (y * y + z * z) / 12,
        "yy": mass * (x * x + z * z) / 12,
        "zz": mass * (x * x + y * y) / 12,
    }


def _extent(link: Link) -> tuple[float, float]:
    """Return the edge lengths of the box around the outlines of a link."""
    xs, ys = zip(*(point for ring in link.polygons for point in ring), strict=True)
    return trim_rounding(max(xs) - min(xs)), trim_rounding(max(ys) - min(ys))


_VECTOR: Final = ["3D", "Euclidean", "Vector", "BoundVector", "UnitLength"]
_FRAME: Final = ["Frame", "Orthonormal", "RigidBody", "RightHanded", "OriginVectorsXYZ"]
_MATERIAL: Final = "Grey"
RESISTANCES: Final = ("friction", "stiffness", "damping", "rest")
"""Our own terms for properties of a joint."""


def object_pose_nodes(of: str, wrt: str, pose: Pose2, z: float = 0.0) -> list[Json]:
    """Return a relative pose and its coordinates."""
    id = f"{of}.pose"
    return pose_nodes((id, f"{id}.coordinates"), of, wrt, pose, z)


def object_frame_nodes(frame: str) -> list[Json]:
    """Return a plain frame and its origin."""
    return frame_nodes(frame, f"{frame}.origin")


def object_nodes(id: str, model: ObjectModel, *, mirror_of: str = "") -> list[Json]:
    """Return the nodes of an object model called ``id`` (a compact IRI)."""
    return _ObjectWriter(id, model).nodes_for(mirror_of)


class _ObjectWriter:
    def __init__(self, id: str, model: ObjectModel) -> None:
        self.id = id
        self.model = model
        self.nodes: list[Json] = []
        self.frames = {link.name: link_frame(link) for link in model.links}
        self.members: dict[str, list[str]] = {link.name: [] for link in model.links}

    def nodes_for(self, mirror_of: str) -> list[Json]:
        base = f"{self.id}.frame"
        self.nodes += object_frame_nodes(base)
        if any(joint.parent == WORLD for joint in self.model.joints):
            self.members[WORLD] = [base, f"{base}.origin"]
        moved = {joint.child for joint in self.model.joints}
        for link in self.model.links:
            self._own(link.name, object_frame_nodes(self._frame_id(link.name)))
            if link.name not in moved:
                pose, z = self.frames[link.name]
                self.nodes += object_pose_nodes(self._frame_id(link.name), base, pose, z)
        for joint in self.model.joints:
            self._joint(joint)
        for link in self.model.links:
            self._link(link)
        for name, members in self.members.items():
            body = {"@id": self._body(name), "@type": ["SimplicialComplex", "RigidBody"]}
            self.nodes.append({**body, "simplices": members, "scn:name": name})
        for state in self.model.states:
            self._state(state.name, dict(state.positions))
        self._object(base, mirror_of)
        return self.nodes

    def _body(self, link: str) -> str:
        return f"{self.id}.link.{link}"

    def _frame_id(self, link: str) -> str:
        return f"{self.id}.frame" if link == WORLD else f"{self._body(link)}.frame"

    def _joint_id(self, joint: str) -> str:
        return f"{self.id}.joint.{joint}"

    def _own(self, link: str, nodes: list[Json]) -> None:
        """Add nodes to the body of a link, its frame first."""
        self.nodes += nodes
        # The published generator of Gazebo models places joints in the first simplex of a body.
        ids = sorted(nodes, key=lambda node: "Frame" not in node["@type"])
        self.members[link] += [node["@id"] for node in ids]

    def _joint(self, joint: Joint) -> None:
        id = self._joint_id(joint.name)
        axis, slot = joint_axis(joint)
        parent, parent_z = self.frames.get(joint.parent, (Pose2(), 0.0))
        child, child_z = self.frames[joint.child]
        # Each body has a frame; both coincide while the joint is at zero. Their axes are the two
        # collinear lines that the vocabulary requires.
        ends = f"{id}.parent", f"{id}.child"
        for frame, link in zip(ends, (joint.parent, joint.child), strict=True):
            vector = f"{frame}.axis"
            self._own(
                link,
                [
                    {"@id": f"{frame}.origin", "@type": POINT},
                    {"@id": vector, "@type": _VECTOR, "start": f"{frame}.origin"},
                    {
                        "@id": frame,
                        "@type": _FRAME,
                        "origin": f"{frame}.origin",
                        f"vector-{slot}": vector,
                    },
                ],
            )
        self.nodes += object_pose_nodes(
            ends[0], self._frame_id(joint.parent), relative(parent, axis), trim_rounding(-parent_z)
        )
        self.nodes += object_pose_nodes(ends[1], ends[0], Pose2())
        self.nodes += object_pose_nodes(
            self._frame_id(joint.child), ends[1], relative(axis, child), child_z
        )
        bodies = [self._body(joint.parent), self._body(joint.child)]
        kind = "RevoluteJoint" if joint.kind == "revolute" else "PrismaticJoint"
        node: Json = {"@id": id, "@type": ["Joint", kind], "scn:name": joint.name}
        node |= {"between-attachments": bodies, "common-axis": f"{id}.axis"}
        for word in RESISTANCES:
            if getattr(joint, word):
                node[f"scn:{word}"] = getattr(joint, word)
        lines = [f"{end}.axis" for end in ends]
        self.nodes += [
            {"@id": f"{id}.axis", "@type": "LineCollinearity", "lines": lines},
            node,
            {
                "@id": f"{id}.tree",
                "@type": "JointWithTree",
                "joint-without-tree": id,
                "parent": bodies[0],
                "children": [bodies[1]],
            },
            self._position(f"{id}.lower", joint, joint.lower, "JointLowerLimit"),
            self._position(f"{id}.upper", joint, joint.upper, "JointUpperLimit"),
        ]

    def _position(self, id: str, joint: Joint, value: float, *types: str) -> Json:
        return {
            "@id": id,
            "@type": ["JointReference", "JointPosition", "Quantity", *types],
            "of-joint": self._joint_id(joint.name),
            "quantity-kind": "Angle" if joint.kind == "revolute" else "Length",
            "unit": "RAD" if joint.kind == "revolute" else "M",
            "value": value,
        }

    def _link(self, link: Link) -> None:
        body = self._body(link.name)
        node: Json = {"@id": f"{body}.object-link", "@type": "ObjectLink", "link": body}
        node["link-frame"] = self._frame_id(link.name)
        self.nodes.append(node)
        if not link.polygons:
            # A carrier between two joints of a planar chain has neither shape nor mass.
            node["scn:carrier"] = True
            return
        self._matter(link, body)

    def _matter(self, link: Link, body: str) -> None:
        box = box_of(link)
        shapes: list[str] = []
        if box is not None:
            shapes.append(f"{body}.shape")
            size = {
                "x-size": box[1],
                "y-size": box[2],
                "z-size": trim_rounding(link.z_max - link.z_min),
            }
            types = ["Polytope", "3DPolytope", "CuboidWithSize"]
            self.nodes.append({"@id": shapes[0], "@type": types, "unit": "M", **size})
        else:
            for k, ring in enumerate(link.polygons):
                shapes.append(f"{body}.shape-{k}")
                self._prism(link, shapes[-1], ring)
        inertia: Json = {"@id": f"{body}.inertia", "of-body": body, "mass": link.mass}
        inertia["@type"] = [
            *("RigidBodyInertia", "Mass"),
            *("RotationalInertia", "PrincipalMomentsOfInertiaXYZ"),
        ]
        # Published readers require moments: other shapes get those of the box around them.
        length, width = box[1:] if box is not None else _extent(link)
        inertia |= moments(link.mass, length, width, link.z_max - link.z_min)
        self.nodes.append(inertia)
        views: dict[str, list[str]] = {"visual": [], "collision": []}
        for k, shape in enumerate(shapes):
            for view, kind in (("visual", "Visual"), ("collision", "Physics")):
                id = f"{body}.{view}" if k == 0 else f"{body}.{view}-{k}"
                views[view].append(id)
                types = ["LinkWithPolytope", f"Link{kind}Representation"]
                self.nodes.append({"@id": id, "@type": types, "link": body, "polytope": shape})
        self.nodes.append(
            {
                "@id": f"{body}.gazebo",
                "@type": "GazeboLinkRepresentation",
                **views,
                "inertia": f"{body}.inertia",
                "material": _MATERIAL,
                "gz-link": f"{body}.object-link",
            }
        )

    def _prism(self, link: Link, id: str, ring: Ring) -> None:
        """Write a polygon as a prism with corners in the frame of the link."""
        frame = self._frame_id(link.name)
        corners = [(*p, link.z_min) for p in ring] + [(*p, link.z_max) for p in ring]
        points = [f"{id}.corner-{k}" for k in range(len(corners))]
        for point, at in zip(points, corners, strict=True):
            ids = (f"{point}.position", f"{point}.position.coordinates")
            self.nodes.append({"@id": point, "@type": POINT})
            self.nodes += position_nodes(ids, point, frame, f"{frame}.origin", at)
        self.nodes.append(polyhedron_node(id, points))

    def _state(self, name: str, positions: dict[str, float]) -> None:
        id = f"{self.id}.state.{name}"
        self.nodes.append({"@id": id, "@type": "State", "scn:name": name})
        for joint in self.model.joints:
            if joint.name not in positions:
                continue
            place = f"{id}.{joint.name}"
            self.nodes += [
                self._position(f"{place}.position", joint, positions[joint.name]),
                {
                    "@id": place,
                    "@type": "JointState",
                    "joint": self._joint_id(joint.name),
                    "pose": f"{place}.position",
                    "state": id,
                },
            ]

    def _object(self, base: str, mirror_of: str) -> None:
        links = [f"{self._body(link.name)}.object-link" for link in self.model.links]
        joints = [self._joint_id(joint.name) for joint in self.model.joints]
        states = [f"{self.id}.state.{state.name}" for state in self.model.states]
        node: Json = {"@id": self.id, "@type": ["Object"], "object-frame": base}
        node |= {"object-links": links, "scn:name": self.model.name}
        # RDF has no order; this list preserves that of links and joints.
        order = [*links, *joints, *states]
        node["scn:order"] = {"@list": [{"@id": part} for part in order]}
        if joints:
            node["@type"].append("ObjectWithKinematicChain")
            node["kinematic-chain"] = f"{self.id}.chain"
            chain = {"@id": f"{self.id}.chain", "@type": "KinematicChain", "joints": joints}
            self.nodes.append(chain)
        if mirror_of:
            node["scn:mirror-of"] = {"@id": mirror_of}
        self.nodes.append(node)
