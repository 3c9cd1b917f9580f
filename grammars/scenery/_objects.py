"""Reader of object models: links with shapes, joints and named states."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Final

from grammars.model.geometry import Point2, Pose2, Ring, convex_ring
from grammars.model.kinematics import WORLD
from grammars.model.movers import PLANAR_JOINTS, with_planar_chain
from grammars.model.scene import Joint, Link
from grammars.scenery._reader import SceneryReader
from grammars.scenery.model import NamedState, ObjectModel
from grammars.text.diagnostics import SyntaxNode, Where, did_you_mean, rule_of

CIRCLE_CORNERS: Final = 32
_AXES: Final = {"x": (1.0, 0.0), "y": (0.0, 1.0)}
_SMALLEST: Final = 1e-3
_TOLERANCE: Final = 1e-9


def read_object(reader: SceneryReader, node: SyntaxNode) -> ObjectModel:
    """Read ``object hinged_door`` or ``mover person`` with its links, joints and states."""
    for kind, parts in (("link", node.links), ("joint", node.joints), ("state", node.states)):
        _check_names(reader, kind, parts)
    if not node.links:
        reader.error(node, f"object {node.name} has no link", "it needs a shape")
    links = reader.read_all(node.links, _link)
    joints = reader.read_all(node.joints, partial(_joint, {link.name for link in node.links}))
    _check_tree(reader, node.joints)
    names = {joint.name for joint in node.joints}
    by_name = {joint.name: joint for joint in joints}
    states = reader.read_all(node.states, partial(_state, by_name, names))
    model = ObjectModel(node.name, tuple(links), tuple(joints), tuple(states), reader.where(node))
    return _mover(reader, model) if node.kind == "mover" and not reader.errors else model


def _mover(reader: SceneryReader, model: ObjectModel) -> ObjectModel:
    """Return the model on its virtual planar chain; exactly one link must carry all others."""
    children = {joint.child for joint in model.joints}
    roots = [link.name for link in model.links if link.name not in children]
    clashes = {joint.name for joint in model.joints} & set(PLANAR_JOINTS)
    world = [joint.name for joint in model.joints if joint.parent == WORLD]
    if len(roots) != 1 or world:
        hint = "attach the others to it: joint … fixed from body to …"
        message = f"one link of {model.name} must carry all others"
        raise reader.refusal(model.where, message, hint)
    if clashes:
        message = f"a mover already has joints x, y and yaw: {', '.join(sorted(clashes))}"
        raise reader.refusal(model.where, message, "choose other names")
    links, joints = with_planar_chain(model.links, model.joints, roots[0])
    return dataclasses.replace(model, links=links, joints=joints)


def _check_names(reader: SceneryReader, kind: str, nodes: list[SyntaxNode]) -> None:
    places: dict[str, Where] = {}
    for node in nodes:
        if node.name in places:
            reader.error(node, f'{kind} "{node.name}" already exists', f"see {places[node.name]}")
        places.setdefault(node.name, reader.where(node))
        if kind == "link" and node.name == WORLD:
            reader.error(node, 'a link cannot have the name "world"', "choose another name")


def _link(reader: SceneryReader, node: SyntaxNode) -> Link:
    bottom, top = reader.value(node.bottom, "length"), reader.value(node.top, "length")
    mass = reader.value(node.mass, "mass")
    if top <= bottom:
        raise reader.refusal(node, "the link has no height", "write the lower height first")
    if mass <= 0.0:
        raise reader.refusal(node.mass, "a mass must be greater than 0 kg")
    rings = tuple(_ring(reader, shape) for shape in node.shapes)
    return Link(node.name, rings, mass, bottom, top)


def _ring(reader: SceneryReader, node: SyntaxNode) -> Ring:
    """Return the outline of a shape, counter-clockwise."""
    match rule_of(node):
        case "Box":
            return _box(reader, node)
        case "Disc":
            x, y = _point(reader, node.at)
            radius = _size(reader, node.radius)
            angles = (math.tau * k / CIRCLE_CORNERS for k in range(CIRCLE_CORNERS))
            return tuple((x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles)
    points = [_point(reader, point) for point in node.points]
    ring = convex_ring(points)
    if ring is None and not any(math.isnan(number) for point in points for number in point):
        hint = 'list three or more corners in order; join several convex shapes with "and"'
        raise reader.refusal(node, "the polygon is not convex", hint)
    return ring or ()


def _box(reader: SceneryReader, node: SyntaxNode) -> Ring:
    x, y = _point(reader, node.at)
    hx, hy = _size(reader, node.width) / 2, _size(reader, node.depth) / 2
    corners = ((-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy))
    if node.turned is None:
        # A rotation by 0 would change the last digits of the numbers in the file.
        return tuple((x + dx, y + dy) for dx, dy in corners)
    return Pose2(x, y, reader.value(node.turned, "angle")).apply_ring(corners)


def _point(reader: SceneryReader, node: SyntaxNode | None) -> Point2:
    """Return a point [m], by default the origin."""
    if node is None:
        return (0.0, 0.0)
    return (reader.value(node.x, "length"), reader.value(node.y, "length"))


def _size(reader: SceneryReader, node: SyntaxNode) -> float:
    value = reader.value(node, "length")
    if value < _SMALLEST:
        raise reader.refusal(node, "a size must be at least 1 mm")
    return value


def _joint(links: set[str], reader: SceneryReader, node: SyntaxNode) -> Joint:
    for end in (node.carrier, node.child):
        if end.text not in links and not (end is node.carrier and end.text == WORLD):
            hint = did_you_mean(end.text, links)
            raise reader.refusal(end, f'there is no link "{end.text}"', hint)
    if node.kind == "fixed":
        ends = (node.carrier.text, node.child.text)
        return Joint(node.name, "prismatic", *ends, (0.0, 0.0), (1.0, 0.0), 0.0, 0.0)
    return _movable(reader, node)


def _movable(reader: SceneryReader, node: SyntaxNode) -> Joint:
    revolute = node.kind == "revolute"
    position = _position_of(node.kind)
    lower, upper = reader.value(node.lower, position), reader.value(node.upper, position)
    if upper < lower:
        raise reader.refusal(node.lower, "the lower limit is above the upper limit")
    turning = "torsional " if revolute else ""
    friction = reader.value(node.friction, "torque" if revolute else "force")
    stiffness = reader.value(node.stiffness, f"{turning}stiffness")
    damping = reader.value(node.damping, f"{turning}damping")
    if min(friction, stiffness, damping) < 0.0:
        raise reader.refusal(node, "friction, stiffness and damping must not be negative")
    if revolute and node.anchor is None:
        raise reader.refusal(node, "a revolute joint needs a point", "add at (0 m, 0 m)")
    return Joint(
        name=node.name,
        kind=node.kind,
        parent=node.carrier.text,
        child=node.child.text,
        anchor=_point(reader, node.anchor),
        axis=_axis(reader, node, revolute),
        lower=lower,
        upper=upper,
        friction=friction,
        stiffness=stiffness,
        damping=damping,
        rest=reader.value(node.rest, position),
    )


def _position_of(kind: str) -> str:
    """Return the dimension of the position of a joint."""
    return "angle" if kind == "revolute" else "length"


def _axis(reader: SceneryReader, node: SyntaxNode, revolute: bool) -> Point2:
    axis = node.axis
    if revolute:
        if axis is not None:
            raise reader.refusal(axis, "a revolute joint always turns about z", "remove along …")
        return (0.0, 0.0)
    if axis is None:
        raise reader.refusal(node, "a prismatic joint needs a direction", "add along x")
    if axis.name:
        sign = -1.0 if axis.name[0] == "-" else 1.0
        x, y = _AXES[axis.name[-1]]
        return (sign * x + 0.0, sign * y + 0.0)
    angle = reader.value(axis.angle, "angle")
    return (math.cos(angle), math.sin(angle))


def _check_tree(reader: SceneryReader, nodes: list[SyntaxNode]) -> None:
    """Report links moved by two joints, and loops of joints."""
    above: dict[str, str] = {}
    for node in nodes:
        child = node.child.text
        if child in above:
            reader.error(node.child, f'link "{child}" is moved by two joints', "remove one")
        above.setdefault(child, node.carrier.text)
    for node in nodes:
        link, visited = node.child.text, set[str]()
        while link in above and link not in visited:
            visited.add(link)
            link = above[link]
        if link in visited:
            reader.error(node, f'the joints of link "{link}" form a loop')
            return


def _state(
    joints: dict[str, Joint], names: set[str], reader: SceneryReader, node: SyntaxNode
) -> NamedState:
    """Read a state; ``joints`` are the valid joints, ``names`` the names of all."""
    positions: dict[str, float] = {}
    for entry in node.positions:
        joint = joints.get(entry.joint)
        if joint is None:
            if entry.joint in names:
                continue  # The joint has been reported.
            hint = did_you_mean(entry.joint, joints)
            raise reader.refusal(entry, f'there is no joint "{entry.joint}"', hint)
        if joint.name in positions:
            raise reader.refusal(entry, f'the state has two positions for "{joint.name}"')
        position = reader.measure(entry.position, _position_of(joint.kind))
        lower, upper = joint.lower, joint.upper
        if position.value < lower - _TOLERANCE or position.value > upper + _TOLERANCE:
            message = f"{position.text} is outside the limits of joint {joint.name}"
            unit = "rad" if joint.kind == "revolute" else "m"
            raise reader.refusal(position.where, message, f"between {lower:g} and {upper:g} {unit}")
        positions[joint.name] = position.value
    return NamedState(node.name, tuple(positions.items()), reader.where(node))
