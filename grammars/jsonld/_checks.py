"""Checks of a model: the shapes, and rules that shapes cannot express.

The shapes in ``shapes/*.ttl`` check classes of references, and that values are complete, unique and
in known units. This module checks the frames of coordinates and that poses form a tree from the
world and from every object. It also checks limits, states and axes of joints.
"""

from __future__ import annotations

from typing import Final

from grammars.jsonld._kinematics import axis_vectors, is_moving, joint_position, limits
from grammars.jsonld._nodes import NodeGraph, index_by
from grammars.jsonld.vocabulary import (
    COORD,
    FP,
    GEOM,
    ITEMS,
    KC,
    OBJ,
    REL,
    ST,
    local_name,
    namespace_of,
)

_MOST_SHOWN: Final = 4
_MOST_LOOPS: Final = 50
_TOLERANCE: Final = 1e-9


def check_nodes(nodes: NodeGraph, *, partial: bool = False) -> None:
    """Check ``nodes`` and add errors and warnings to their findings.

    A ``partial`` model is one layer. It describes its own namespaces completely. Its references to
    the floor plan and into namespaces without nodes lead elsewhere and are not checked.
    """
    from grammars.jsonld.rdf import check_shapes

    homes = {_home(node.id) for node in nodes.by_id.values() if node.types}

    def is_elsewhere(predicate: str, target: str) -> bool:
        # Earlier models keep the names of plan and objects in one namespace.
        return partial and (predicate in _OF_THE_PLAN or _home(target) not in homes)

    check_shapes(nodes, is_elsewhere)
    _check_coordinates(nodes)
    _check_views(nodes)
    _check_pose_tree(nodes, partial)
    # Joints that fit their shapes have both limits, two bodies and two lines.
    if not nodes.errors:
        _check_joints(nodes)


def refuse_broken(nodes: NodeGraph, *, partial: bool = False) -> None:
    """Check ``nodes``: add warnings to their findings, raise ``InputError`` for errors."""
    check_nodes(nodes, partial=partial)
    nodes.raise_errors()


_OF_THE_PLAN: Final = (REL["with-respect-to"], COORD["as-seen-by"], OBJ["world"])
"""Predicates that lead from a layer to its floor plan."""


def _home(id: str) -> str:
    """Return the namespace of ``id``; each object of ours has one of its own."""
    if id.startswith(ITEMS):
        return id.partition(".")[0]
    return namespace_of(id)


def _check_coordinates(nodes: NodeGraph) -> None:
    """Report coordinates that are not numbers; for so many nodes shapes take a second longer."""
    for node in nodes.by_id.values():
        for name in ("x", "y", "z", "alpha", "beta"):
            for value in node.all(COORD[name]):
                if isinstance(value, bool) or not isinstance(value, int | float):
                    nodes.add_error(node.id, f"{name} of {local_name(node.id)} is not a number")


def _check_views(nodes: NodeGraph) -> None:
    """Report pose coordinates seen by a frame that is not the reference frame of the pose."""
    for node in nodes.of_type(COORD["PoseCoordinate"]):
        for pose in (nodes.by_id.get(id) for id in node.refs(COORD["of-pose"])):
            observer = node.ref(COORD["as-seen-by"])
            wrt = pose.ref(REL["with-respect-to"]) if pose is not None else None
            if observer is not None and wrt is not None and observer != wrt:
                nodes.add_error(
                    node.id,
                    f"{local_name(node.id)} is seen by {local_name(observer)}, "
                    f"its pose is with respect to {local_name(wrt)}",
                    "write the coordinates in the frame the pose is with respect to",
                )


def _check_pose_tree(nodes: NodeGraph, partial: bool) -> None:
    """Report loops of poses, and frames without a chain of poses to the world."""
    # Slow to import.
    from scipy.cluster.hierarchy import DisjointSet

    frames = [node.id for node in nodes.of_type(GEOM["Frame"])]
    roots = _roots(nodes)
    # Sets of frames that poses connect.
    groups = DisjointSet([*frames, *roots])
    placings = index_by(nodes.by_id, REL["Pose"], REL["of"])
    # Frames with several poses come last: if poses form a loop, one of these closes it.
    poses = sorted(
        ((of, pose) for of, several in placings.items() for pose in several),
        key=lambda pair: len(placings[pair[0]]),
    )
    loops: dict[str, None] = {}
    for of, pose in poses:
        wrt = pose.ref(REL["with-respect-to"])
        if wrt is None:
            continue
        for frame in (of, wrt):
            groups.add(frame)
        if not groups.merge(of, wrt):
            loops[of] = None
    for frame in list(loops)[:_MOST_LOOPS]:
        ends = [pose.ref(REL["with-respect-to"]) or "" for pose in placings[frame]]
        nodes.add_error(
            frame,
            f"{local_name(frame)} is placed {len(ends)} times: with respect to "
            f"{', '.join(map(local_name, ends[:_MOST_SHOWN]))}, which closes a loop of poses",
            "do several things share this identifier? Give each its own: <space>-<name>",
        )
    defined = frozenset(frames)
    anchors = {groups[root] for root in roots}
    # A frame of another file may be connected there.
    if partial:
        anchors |= {groups[id] for id in groups if id not in defined}
    if nodes.of_type(FP["FloorPlan"]) and not any(local_name(id) == "world-frame" for id in frames):
        return  # the reader of plans reports it
    loose: dict[str, list[str]] = {}
    for frame in frames:
        if groups[frame] not in anchors:
            loose.setdefault(groups[frame], []).append(frame)
    for group in loose.values():
        _report_loose(nodes, group)


def _report_loose(nodes: NodeGraph, group: list[str]) -> None:
    instances = index_by(nodes.by_id, OBJ["ObjectInstance"], OBJ["frame"])
    hint = "add a pose of it with respect to a frame of the floor plan"
    for instance in (each for frame in group for each in instances.get(frame, ())):
        message = f"instance {local_name(instance.id)} is not connected to the world"
        nodes.add_error(instance.id, message, hint)
        return
    names = ", ".join(local_name(frame) for frame in group[:_MOST_SHOWN])
    more = ", …" if len(group) > _MOST_SHOWN else ""
    nodes.add_error(group[0], f"no chain of poses connects {names}{more} to the world", hint)


def _roots(nodes: NodeGraph) -> list[str]:
    roots = [id for id in nodes.by_id if local_name(id) == "world-frame"]
    for kind, predicate in (("WorldFrame", "frame"), ("Object", "object-frame")):
        for node in nodes.of_type(OBJ[kind]):
            roots.extend(node.refs(OBJ[predicate]))
    return roots


def _check_joints(nodes: NodeGraph) -> None:
    """Report limits in the wrong order, states outside of them, and axes on only one body."""
    bounds = limits(nodes)
    states = index_by(nodes.by_id, ST["JointState"], ST["joint"])
    for joint in nodes.of_type(KC["Joint"]):
        if not is_moving(joint):
            continue
        name = local_name(joint.id)
        least, most = (joint_position(side[0], joint) for side in bounds[joint.id])
        if least > most:
            message = f"the lower limit of joint {name} ({least:g}) is above the upper ({most:g})"
            nodes.add_error(bounds[joint.id][0][0].id, message)
        for state in states.get(joint.id, ()):
            value = joint_position(nodes.get(state.refs(ST["pose"])[0]), joint)
            if not least - _TOLERANCE <= value <= most + _TOLERANCE:
                label = local_name(state.refs(ST["state"])[0])
                message = f"state {label} puts joint {name} at {value:g}, outside its limits"
                nodes.add_error(state.id, message, f"between {least:g} and {most:g}")
        bodies = joint.refs(KC["between-attachments"])
        lines = axis_vectors(nodes, joint)
        first, second = (set(nodes.get(body).refs(GEOM["simplices"])) for body in bodies)
        if not any(a in first and b in second for a, b in (lines, reversed(lines))):
            nodes.add_error(
                joint.id,
                f"the axis of joint {name} is not on both of its bodies",
                f"{' and '.join(map(local_name, lines))} are vectors of "
                f"{' and '.join(map(local_name, bodies))}, one of each",
            )
