"""Joints that make sense: limits, states within them, an axis on both bodies."""

from __future__ import annotations

from typing import Final

from grammars.metamodel._nodes import Node, Nodes, Ref, index_by
from grammars.metamodel._poses import ANGLES, LENGTHS, scaled
from grammars.metamodel._vocabulary import GEOM, KC, KC_STATE, OBJ, QUDT, REL, ST, local_name

_TOLERANCE: Final = 1e-9
_SLOTS: Final = ("vector-x", "vector-y", "vector-z")


def limits(nodes: Nodes) -> dict[str, tuple[list[Node], list[Node]]]:
    """Return the lower and upper limit nodes of every joint that has some.

    Positions that a state refers to are not limits, whatever their type says.
    """
    of_states = {
        target for node in nodes.of_type(ST["JointState"]) for target in node.refs(ST["pose"])
    }
    found: dict[str, tuple[list[Node], list[Node]]] = {}
    for side, kind in enumerate(("JointLowerLimit", "JointUpperLimit")):
        for node in nodes.of_type(OBJ[kind]):
            for joint in node.refs(KC_STATE["of-joint"]) if node.id not in of_states else ():
                found.setdefault(joint, ([], []))[side].append(node)
    return found


def is_turning(joint: Node) -> bool:
    """Return whether a joint is revolute."""
    return KC["RevoluteJoint"] in joint.types


def is_moving(joint: Node) -> bool:
    """Return whether a joint is revolute or prismatic."""
    return is_turning(joint) or OBJ["PrismaticJoint"] in joint.types


def position(node: Node, joint: Node) -> float | None:
    """Return a joint position in rad or m."""
    return scaled(node, QUDT["value"], ANGLES if is_turning(joint) else LENGTHS)


def check_joints(nodes: Nodes, found: Nodes) -> None:
    """Report joints without proper limits or axis, and states outside the limits."""
    bounds = limits(nodes)
    states = index_by(nodes.by_id, ST["JointState"], ST["joint"])
    for joint in nodes.of_type(KC["Joint"]):
        if is_moving(joint):
            _check_limits(nodes, found, joint, bounds.get(joint.id, ([], [])), states)
        _check_axis(nodes, found, joint)
    _check_state_types(nodes, found)


def _check_limits(
    nodes: Nodes,
    found: Nodes,
    joint: Node,
    bounds: tuple[list[Node], list[Node]],
    states: dict[str, list[Node]],
) -> None:
    name = local_name(joint.id)
    for side, have in zip(("lower", "upper"), bounds, strict=True):
        if not have:
            found.error(joint.id, f"joint {name} has no {side} limit")
        elif len(have) > 1:
            listed = ", ".join(local_name(node.id) for node in have)
            message = f"joint {name} has {len(have)} {side} limits: {listed}"
            found.error(have[1].id, message, "keep one of them")
    if len(bounds[0]) != 1 or len(bounds[1]) != 1:
        return
    lower, upper = (position(have[0], joint) for have in bounds)
    if lower is None or upper is None:
        found.error(joint.id, f"a limit of joint {name} has no value")
        return
    if lower > upper:
        message = f"the lower limit of joint {name} ({lower:g}) is above the upper ({upper:g})"
        found.error(bounds[0][0].id, message)
    for state in states.get(joint.id, []):
        _check_state(nodes, found, state, joint, (lower, upper))


def _check_state(
    nodes: Nodes, found: Nodes, state: Node, joint: Node, bounds: tuple[float, float]
) -> None:
    pose = nodes.by_id.get(state.ref(ST["pose"]) or "")
    value = position(pose, joint) if pose is not None else None
    label = local_name(state.ref(ST["state"]) or state.id)
    if value is None:
        found.error(state.id, f"state {label} gives joint {local_name(joint.id)} no position")
    elif not bounds[0] - _TOLERANCE <= value <= bounds[1] + _TOLERANCE:
        found.error(
            state.id,
            f"state {label} puts joint {local_name(joint.id)} at {value:g}, outside its limits",
            f"between {bounds[0]:g} and {bounds[1]:g}",
        )


def _check_state_types(nodes: Nodes, found: Nodes) -> None:
    for state in nodes.of_type(ST["JointState"]):
        pose = nodes.by_id.get(state.ref(ST["pose"]) or "")
        for kind in ("JointLowerLimit", "JointUpperLimit") if pose is not None else ():
            if pose is not None and OBJ[kind] in pose.types:
                message = f"{local_name(pose.id)} is the position of a state and typed {kind}"
                found.warn(pose.id, message, "it is not taken as a limit; remove the type")


def axis_vectors(nodes: Nodes, joint: Node) -> list[Ref]:
    """Return the vectors of the line a joint turns about or slides along."""
    axis = nodes.by_id.get(joint.ref(KC["common-axis"]) or "")
    return axis.refs(REL["lines"]) if axis is not None else []


def slots(nodes: Nodes) -> dict[str, list[tuple[str, str]]]:
    """Return of every vector the frames it is an axis of, with the axis (``x``, ``y``, ``z``)."""
    found: dict[str, list[tuple[str, str]]] = {}
    for frame in nodes.of_type(GEOM["Frame"]):
        for slot in _SLOTS:
            for vector in frame.refs(GEOM[slot]):
                found.setdefault(vector, []).append((frame.id, slot[-1]))
    return found


def _check_axis(nodes: Nodes, found: Nodes, joint: Node) -> None:
    name = local_name(joint.id)
    bodies = joint.refs(KC["between-attachments"])
    if len(bodies) != 2:
        found.error(joint.id, f"joint {name} is between {len(bodies)} bodies, not two")
        return
    lines = axis_vectors(nodes, joint)
    if not is_moving(joint):
        return
    if len(lines) != 2:
        message = f"the axis of joint {name} is on {len(lines)} lines, not two"
        found.error(joint.id, message, "one vector of each body is collinear with the other's")
        return
    parts = [set(nodes.get(body).refs(GEOM["simplices"])) for body in bodies]
    sides = [{k for k, part in enumerate(parts) if line in part} for line in lines]
    if not any(a in sides[0] and b in sides[1] for a, b in ((0, 1), (1, 0))):
        found.error(
            joint.id,
            f"the axis of joint {name} is not on both of its bodies",
            f"{' and '.join(map(local_name, lines))} are vectors of "
            f"{' and '.join(map(local_name, bodies))}, one of each",
        )
