"""Reading object models: their links and shapes, joints and named states."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Any, Final, Literal

from grammars.model.geometry import Point2, Pose2, Ring, convex_ring
from grammars.model.kinematics import WORLD
from grammars.model.movers import PLANAR_JOINTS, with_planar_chain
from grammars.model.scene import Joint, Link
from grammars.scenery._reader import NodeReader, QuantityNode, WordNode
from grammars.scenery.measure import require_dimension
from grammars.scenery.model import NamedState, ObjectModel
from grammars.text.diagnostics import InputError, SyntaxNode, TypedNode, Where, did_you_mean

CIRCLE_CORNERS: Final = 32
_AXES: Final = {"x": (1.0, 0.0), "y": (0.0, 1.0)}
_SMALLEST: Final = 1e-3
_TOLERANCE: Final = 1e-9


class ObjectNode(TypedNode):
    """``object hinged_door`` or ``mover person`` with its links, joints and states."""

    kind: Literal["object", "mover"]
    name: WordNode
    links: list[SyntaxNode]
    joints: list[SyntaxNode]
    states: list[SyntaxNode]

    def read(self, reader: NodeReader) -> ObjectModel:
        """Return the object model; problems go to the reader's diagnostics."""
        _unique(reader, "link", self.links)
        _unique(reader, "joint", self.joints)
        _unique(reader, "state", self.states)
        links = reader.read_all(self.links, partial(_link, reader))
        known = {node.name.text for node in self.links}
        if not known:
            hint = "it needs a shape"
            reader.report(reader.where(self), f"object {self.name.text} has no link", hint)
        joints = reader.read_all(self.joints, partial(_joint, reader, known))
        _check_tree(reader, self.joints)
        written = {node.name.text for node in self.joints}
        states = reader.read_all(self.states, partial(_state, reader, joints, written))
        model = ObjectModel(
            self.name.text, tuple(links), tuple(joints), tuple(states), reader.where(self)
        )
        return _mover(reader, model) if self.kind == "mover" and not reader.diagnostics else model


def _mover(reader: NodeReader, model: ObjectModel) -> ObjectModel:
    """Put the model on its virtual chain: one link carries all others, by joints."""
    hung = {joint.child for joint in model.joints}
    feet = [link.name for link in model.links if link.name not in hung]
    taken = {joint.name for joint in model.joints} & set(PLANAR_JOINTS)
    world = [joint.name for joint in model.joints if joint.parent == WORLD]
    if len(feet) != 1 or world:
        hint = "join the others to it: joint … fixed from body to …"
        raise InputError.at(model.where, f"one link of {model.name} must carry all", hint)
    if taken:
        message = f"a mover has joints x, y and yaw already: {', '.join(sorted(taken))}"
        raise InputError.at(model.where, message, "take other names")
    links, joints = with_planar_chain(model.links, model.joints, feet[0])
    return dataclasses.replace(model, links=links, joints=joints)


def _unique(reader: NodeReader, kind: str, nodes: list[Any]) -> None:
    seen: dict[str, Where] = {}
    for node in nodes:
        name, where = str(node.name.text), reader.where(node)
        if name in seen:
            reader.report(where, f'{kind} "{name}" exists already', f"see {seen[name]}")
        seen.setdefault(name, where)
        if kind == "link" and name == "world":
            reader.report(where, 'a link cannot be called "world"', "that is what stands still")


def _link(reader: NodeReader, node: Any) -> Link:
    bottom, top = reader.value(node.bottom, "length"), reader.value(node.top, "length")
    mass = reader.value(node.mass, "mass")
    where = reader.where(node)
    if top <= bottom:
        raise InputError.at(where, "the link has no height", "write from the lower z up")
    if mass <= 0.0:
        raise InputError.at(reader.where(node.mass), "a mass is greater than 0 kg")
    rings = tuple(shape.ring(reader) for shape in node.shapes)
    return Link(str(node.name.text), rings, mass, bottom, top)


def _point(reader: NodeReader, node: Any) -> Point2:
    if node is None:
        return (0.0, 0.0)
    return (reader.value(node.x, "length"), reader.value(node.y, "length"))


def _size(reader: NodeReader, node: Any) -> float:
    value = reader.value(node, "length")
    if value < _SMALLEST:
        raise InputError.at(reader.where(node), "a size is at least 1 mm")
    return value


class BoxNode(TypedNode):
    """``box 5 cm x 90 cm at (0 m, 48 cm) turned 30 deg``."""

    width: QuantityNode
    depth: QuantityNode
    at: SyntaxNode | None
    turned: QuantityNode | None

    def ring(self, reader: NodeReader) -> Ring:
        """Return the outline, counter-clockwise."""
        x, y = _point(reader, self.at)
        hx, hy = _size(reader, self.width) / 2, _size(reader, self.depth) / 2
        corners = ((-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy))
        if self.turned is None:
            # Not turned by 0: sums alone keep the digits that were written.
            return tuple((x + dx, y + dy) for dx, dy in corners)
        return Pose2(x, y, reader.value(self.turned, "angle")).apply_ring(corners)


class DiscNode(TypedNode):
    """``circle radius 3 cm``."""

    radius: QuantityNode
    at: SyntaxNode | None

    def ring(self, reader: NodeReader) -> Ring:
        """Return the outline, counter-clockwise from the x axis."""
        x, y = _point(reader, self.at)
        radius = _size(reader, self.radius)
        return tuple(
            (x + radius * math.cos(a), y + radius * math.sin(a))
            for a in (math.tau * i / CIRCLE_CORNERS for i in range(CIRCLE_CORNERS))
        )


class ConvexNode(TypedNode):
    """``polygon (0 m, 0 m), (1 m, 0 m), (0 m, 1 m)``."""

    points: list[SyntaxNode]

    def ring(self, reader: NodeReader) -> Ring:
        """Return the outline, counter-clockwise."""
        ring = convex_ring([_point(reader, p) for p in self.points])
        if ring is None:
            raise InputError.at(
                reader.where(self),
                "the polygon is not convex",
                "list three or more corners in order; join several convex shapes with and",
            )
        return ring


def _joint(reader: NodeReader, links: set[str], node: Any) -> Joint:
    _check_ends(reader, links, node)
    return _fixed(node) if node.kind == "fixed" else _movable(reader, node)


def _fixed(node: Any) -> Joint:
    """Return a joint without room to move: the child rides on its carrier."""
    name, carrier, child = (str(n.text) for n in (node.name, node.carrier, node.child))
    return Joint(name, "prismatic", carrier, child, (0.0, 0.0), (1.0, 0.0), 0.0, 0.0)


def _check_ends(reader: NodeReader, links: set[str], node: Any) -> None:
    for end in (node.carrier, node.child):
        if end.text not in links and not (end is node.carrier and end.text == "world"):
            hint = did_you_mean(end.text, links)
            raise InputError.at(reader.where(end), f'there is no link "{end.text}"', hint)


def _movable(reader: NodeReader, node: Any) -> Joint:
    revolute = node.kind == "revolute"
    position = "angle" if revolute else "length"
    lower, upper = reader.value(node.lower, position), reader.value(node.upper, position)
    if upper < lower:
        raise InputError.at(reader.where(node.lower), "the lower limit is above the upper limit")
    turning = "torsional " if revolute else ""
    friction = reader.value(node.friction, "torque" if revolute else "force")
    stiffness = reader.value(node.stiffness, f"{turning}stiffness")
    damping = reader.value(node.damping, f"{turning}damping")
    if min(friction, stiffness, damping) < 0.0:
        raise InputError.at(
            reader.where(node), "friction, stiffness and damping are never negative"
        )
    return Joint(
        name=str(node.name.text),
        kind=node.kind,
        parent=str(node.carrier.text),
        child=str(node.child.text),
        anchor=_anchor(reader, node, revolute),
        axis=_axis(reader, node, revolute),
        lower=lower,
        upper=upper,
        friction=friction,
        stiffness=stiffness,
        damping=damping,
        rest=reader.value(node.rest, position),
    )


def _anchor(reader: NodeReader, node: Any, revolute: bool) -> Point2:
    if revolute and node.anchor is None:
        raise InputError.at(
            reader.where(node), "a revolute joint turns about a point", "add at (0 m, 0 m)"
        )
    return _point(reader, node.anchor)


def _axis(reader: NodeReader, node: Any, revolute: bool) -> Point2:
    if revolute:
        if node.axis is not None:
            raise InputError.at(
                reader.where(node.axis), "a revolute joint turns about z, it has no axis"
            )
        return (0.0, 0.0)
    if node.axis is None:
        raise InputError.at(
            reader.where(node), "a prismatic joint needs a direction", "add along x"
        )
    if node.axis.name:
        sign = -1.0 if node.axis.name[0] == "-" else 1.0
        x, y = _AXES[node.axis.name[-1]]
        return (sign * x + 0.0, sign * y + 0.0)
    angle = reader.value(node.axis.angle, "angle")
    return (math.cos(angle), math.sin(angle))


def _check_tree(reader: NodeReader, nodes: list[Any]) -> None:
    above: dict[str, str] = {}
    for node in nodes:
        child = str(node.child.text)
        if child in above:
            reader.report(
                reader.where(node.child), f'link "{child}" is moved by two joints', "remove one"
            )
        above.setdefault(child, str(node.carrier.text))
    for node in nodes:
        link, seen = str(node.child.text), set[str]()
        while link in above and link not in seen:
            seen.add(link)
            link = above[link]
        if link in seen:
            reader.report(reader.where(node), f'link "{link}" carries itself through its joints')
            return


def _state(reader: NodeReader, joints: list[Joint], written: set[str], node: Any) -> NamedState:
    by_name = {joint.name: joint for joint in joints}
    positions: dict[str, float] = {}
    for entry in node.positions:
        joint = by_name.get(entry.joint.text)
        if joint is None:
            if entry.joint.text in written:
                continue  # the joint itself is wrong and has been reported
            hint = did_you_mean(entry.joint.text, by_name)
            raise InputError.at(
                reader.where(entry), f'there is no joint "{entry.joint.text}"', hint
            )
        if joint.name in positions:
            raise InputError.at(reader.where(entry), f'"{joint.name}" is given twice')
        given = reader.measure(entry.position)
        value = require_dimension(given, "angle" if joint.kind == "revolute" else "length")
        if not joint.lower - _TOLERANCE <= value <= joint.upper + _TOLERANCE:
            raise InputError.at(
                given.where,
                f"{given.text} is outside the limits of joint {joint.name}",
                f"between {joint.lower:g} and {joint.upper:g} "
                + ("rad" if joint.kind == "revolute" else "m"),
            )
        positions[joint.name] = value
    return NamedState(str(node.name.text), tuple(positions.items()), reader.where(node))


OBJECT_RULES: Final = (ObjectNode, BoxNode, DiscNode, ConvexNode)
"""Classes of syntax nodes, named like their rules."""
