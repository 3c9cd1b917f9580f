"""What must hold in a composed graph and SHACL cannot say, or not fast enough.

References resolve and have the right types, nothing is said twice with two meanings, the poses
are one tree from the world (and one per object model), coordinates are there exactly once.

These rules run whenever layers are loaded: 14 ms for the demo, where SHACL takes a second. Which
classes a reference may lead to, and which may have several values, are rules of the shapes
(``shapes/*.ttl``); a file made from them is read here (:mod:`grammars.jsonld.rdf`). Trees, owners
and the order of limits are what no shape can say.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from grammars.jsonld._kinematics import ANGLES, LENGTHS, check_joints
from grammars.jsonld._nodes import Node, NodeGraph, index_by
from grammars.jsonld._references import reference_rules
from grammars.jsonld.vocabulary import (
    COORD,
    DYN,
    FP,
    GEOM,
    GZB,
    ITEMS,
    KC,
    KC_STATE,
    OBJ,
    POLY,
    QUDT,
    REL,
    SCN,
    ST,
    local_name,
)
from grammars.text.diagnostics import Diagnostic, InputError, Severity, did_you_mean

_FRAMES_SHOWN: Final = 4
_MOST_LOOPS: Final = 50


def check_pose_tree(nodes: NodeGraph, found: NodeGraph, *, partial: bool) -> None:
    """Report loops of poses, and frames that no chain of poses connects to the world."""
    frames = [node.id for node in nodes.of_type(GEOM["Frame"])]
    links = _Forest(frames)
    tree: dict[str, list[Node]] = {}
    placing: dict[str, list[Node]] = {}
    looping: list[Node] = []
    for pose in nodes.of_type(REL["Pose"]):
        of, wrt = _ends(pose)
        if of and wrt:
            placing.setdefault(of, []).append(pose)
            if links.join(of, wrt):
                tree.setdefault(of, []).append(pose)
                tree.setdefault(wrt, []).append(pose)
            else:
                looping.append(pose)
    # Frames that share an identifier make a loop for every pose of each.
    for pose in looping[:_MOST_LOOPS]:
        _report_loop(found, pose, tree, placing)
    roots, defined = _roots(nodes), frozenset(frames)
    anchors = {links.top(root) for root in roots}
    # What leads to a frame of another file may be connected there.
    if partial:
        anchors |= {links.top(id) for id in links.known() if id not in defined}
    plans = nodes.of_type(FP["FloorPlan"])
    if plans and not any(_is_world(nodes, root) for root in roots):
        known = map(local_name, frames)
        message = "there is no frame world-frame to start from"
        found.add_error(plans[0].id, message, did_you_mean("world-frame", known))
        return
    loose: dict[str, list[str]] = {}
    for frame in frames:
        if links.top(frame) not in anchors:
            loose.setdefault(links.top(frame), []).append(frame)
    for group in loose.values():
        _report_loose(nodes, found, group)


def _ends(pose: Node) -> tuple[str, str]:
    return pose.ref(REL["of"]) or "", pose.ref(REL["with-respect-to"]) or ""


def _report_loop(
    found: NodeGraph, pose: Node, tree: dict[str, list[Node]], placing: dict[str, list[Node]]
) -> None:
    """Name the frames that make the loop by being placed more than once in it."""
    loop = [pose, *_path(tree, *_ends(pose))]
    times = Counter(_ends(step)[0] for step in loop)
    often = [frame for frame, count in times.items() if count > 1]
    most = max((len(placing[frame]) for frame in often), default=0)
    for frame in often:
        if len(placing[frame]) == most:
            against = ", ".join(local_name(_ends(p)[1]) for p in placing[frame][:_FRAMES_SHOWN])
            found.add_error(
                frame,
                f"{local_name(frame)} is placed {most} times: with respect to {against}",
                "do several things share this identifier? Give each its own: <space>-<name>",
            )
    if not often:
        message = f"pose {local_name(pose.id)} closes a loop of poses"
        found.add_error(pose.id, message, "poses are a tree: one way from the world to every frame")


def _path(tree: dict[str, list[Node]], start: str, end: str) -> list[Node]:
    """Return the poses of the tree on the way between two frames."""
    came: dict[str, Node | None] = {start: None}
    queue = [start]
    for frame in queue:
        for pose in tree.get(frame, []):
            other = next((e for e in _ends(pose) if e != frame), frame)
            if other not in came:
                came[other] = pose
                queue.append(other)
    path: list[Node] = []
    step = came.get(end)
    while step is not None:
        path.append(step)
        end = next((e for e in _ends(step) if e != end), start)
        step = came.get(end)
    return path


def _report_loose(nodes: NodeGraph, found: NodeGraph, group: list[str]) -> None:
    instances = {
        str(instance.ref(OBJ["frame"])): instance
        for instance in nodes.of_type(OBJ["ObjectInstance"])
    }
    names = ", ".join(local_name(frame) for frame in group[:_FRAMES_SHOWN])
    more = ", …" if len(group) > _FRAMES_SHOWN else ""
    hint = "add a pose of it with respect to a frame of the floor plan"
    for frame in group:
        if frame in instances:
            name = local_name(instances[frame].id)
            message = f"instance {name} is not connected to the world"
            found.add_error(instances[frame].id, message, hint)
            return
    found.add_error(group[0], f"no chain of poses connects {names}{more} to the world", hint)


def _roots(nodes: NodeGraph) -> list[str]:
    roots = [id for id in nodes.by_id if local_name(id) == "world-frame"]
    for kind, predicate in (("WorldFrame", "frame"), ("Object", "object-frame")):
        for node in nodes.of_type(OBJ[kind]):
            roots.extend(node.refs(OBJ[predicate]))
    return roots


def _is_world(nodes: NodeGraph, frame: str) -> bool:
    declared = any(frame in node.refs(OBJ["frame"]) for node in nodes.of_type(OBJ["WorldFrame"]))
    return declared or local_name(frame) == "world-frame"


class _Forest:
    """Disjoint sets of frames (union by path halving)."""

    def __init__(self, members: Iterable[str]) -> None:
        self._above = {member: member for member in members}

    def known(self) -> list[str]:
        return list(self._above)

    def top(self, member: str) -> str:
        above = self._above
        above.setdefault(member, member)
        while above[member] != member:
            above[member] = above[above[member]]
            member = above[member]
        return member

    def join(self, one: str, other: str) -> bool:
        """Put two sets together; return whether they were apart."""
        a, b = self.top(one), self.top(other)
        self._above[a] = b
        return a != b


_OURS: Final = tuple(
    str(n) for n in (GEOM, REL, COORD, KC, KC_STATE, DYN, POLY, FP, OBJ, ST, GZB, QUDT, SCN)
)
_KIND_NAMES: Final = {
    **{FP[k]: k for k in ("FloorPlan", "Space", "Wall", "Column", "Divider")},
    **{FP[k]: k for k in ("Entryway", "Window")},
    **{GEOM[k]: k for k in ("Point", "Frame", "Vector", "SimplicialComplex")},
    **{REL[k]: k for k in ("Pose", "Position", "LineCollinearity")},
    **{POLY[k]: k for k in ("Polygon", "Polyhedron", "CuboidWithSize")},
    **{OBJ[k]: k for k in ("Object", "ObjectLink", "ObjectInstance")},
    **{KC[k]: k for k in ("Joint", "KinematicChain")},
    **{ST[k]: k for k in ("State", "JointState")},
    COORD["PoseReference"]: "pose coordinate",
    COORD["PositionReference"]: "position coordinate",
    KC_STATE["JointPosition"]: "joint position",
}
"""Kinds of things of which one identifier can only be one."""
_UNIT: Final = QUDT["unit"]
_MEASURED: Final = (
    *(COORD[word] for word in ("x", "y", "z", "alpha")),
    *(POLY[f"{axis}-size"] for axis in "xyz"),
    *(FP[word] for word in ("height", "thickness")),
)
"""Predicates whose numbers are lengths and angles."""
_OF_THE_PLAN: Final = (REL["with-respect-to"], COORD["as-seen-by"], OBJ["world"])
"""What leads from a layer to the floor plan it is for."""
_SHOWN: Final = 4
_HINTS: Final = 20
"""Looking for similar names takes time in a large graph: later errors go without."""


def refuse_broken(nodes: NodeGraph, *, partial: bool = False) -> None:
    """Check ``nodes``; warnings are added to their diagnostics, errors raise ``InputError``."""
    found = check_structure(nodes, partial=partial)
    errors = tuple(d for d in found if d.severity is Severity.ERROR)
    if errors:
        raise InputError(errors)
    nodes.diagnostics.extend(found)


def check_structure(nodes: NodeGraph, *, partial: bool = False) -> tuple[Diagnostic, ...]:
    """Return everything that is wrong with the structure of a graph.

    A ``partial`` graph is one layer: what it refers to may be in another one.
    """
    found = NodeGraph(places=nodes.places)
    _check_identity(nodes, found)
    _check_references(nodes, found, partial)
    _check_coordinates(nodes, found)
    _check_units(nodes, found)
    check_pose_tree(nodes, found, partial=partial)
    _check_owners(nodes, found)
    check_joints(nodes, found)
    return tuple(dict.fromkeys(found.diagnostics))


def _check_identity(nodes: NodeGraph, found: NodeGraph) -> None:
    """One identifier is one thing, which says one thing of each sort."""
    rules = reference_rules()
    for node in nodes.by_id.values():
        kinds = [_KIND_NAMES[kind] for kind in node.types if kind in _KIND_NAMES]
        if len(kinds) > 1:
            listed = " and a ".join(kinds)
            found.add_error(
                node.id,
                f'"{local_name(node.id)}" is a {listed}: two things have one identifier',
                "rename one of them",
            )
        for predicate, values in node.values.items():
            if len(values) < 2 or not predicate.startswith(_OURS):
                continue
            if predicate not in rules or not rules[predicate].several:
                shown = ", ".join(_shown(v) for v in values[:_SHOWN])
                found.add_error(
                    node.id,
                    f'"{local_name(node.id)}" has {len(values)} values of '
                    f"{local_name(predicate)}: {shown}",
                    "do two things share this identifier?",
                )


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return f"a list of {len(value)}"
    return local_name(value) if isinstance(value, str) else f"{value}"


def _check_references(nodes: NodeGraph, found: NodeGraph, partial: bool) -> None:
    homes = {_home(node.id) for node in nodes.by_id.values() if node.types}

    def elsewhere(node: Node, predicate: str, target: str) -> bool:
        # Earlier models have the names of plan and objects in one namespace.
        of_the_plan = predicate in _OF_THE_PLAN or OBJ["WorldFrame"] in node.types
        return partial and (of_the_plan or _home(target) not in homes)

    rules = reference_rules()
    for node in nodes.by_id.values():
        for predicate in node.values:
            rule = rules.get(predicate)
            allowed = rule.allowed(node) if rule is not None else ()
            wanted = frozenset(allowed)
            for target in node.refs(predicate) if allowed else ():
                other = nodes.by_id.get(target)
                if other is None or wanted.isdisjoint(other.types):
                    _explain_reference(nodes, found, elsewhere, node, predicate, target, allowed)


def _home(id: str) -> str:
    """Return what belongs together: a namespace, or an object of ours with all its parts."""
    if id.startswith(ITEMS):
        return id.partition(".")[0]
    return id[: len(id) - len(local_name(id))]


def _explain_reference(
    nodes: NodeGraph,
    found: NodeGraph,
    elsewhere: Callable[[Node, str, str], bool],
    node: Node,
    predicate: str,
    target: str,
    allowed: Sequence[str],
) -> None:
    other = nodes.by_id.get(target)
    words = f"{local_name(predicate)} of {local_name(node.id)} is {local_name(target)}"
    if other is not None and other.types:
        kinds = ", ".join(map(local_name, other.types))
        wanted = " or ".join(dict.fromkeys(map(local_name, allowed)))
        found.add_error(node.id, f"{words}, a {kinds}", f"expected a {wanted}")
    elif not elsewhere(node, predicate, target):
        hint = ""
        if len(found.diagnostics) < _HINTS:
            near = [n.id for kind in allowed for n in nodes.of_type(kind)]
            hint = did_you_mean(local_name(target), map(local_name, near))
        message = f"{words}, which does not exist"
        note = found.add_warning if reference_rules()[predicate].harmless else found.add_error
        note(node.id, message, hint)


def _check_coordinates(nodes: NodeGraph, found: NodeGraph) -> None:
    """Every pose and position has its numbers exactly once."""
    offsets = {o for joint in nodes.of_type(KC["Joint"]) for o in joint.refs(KC["origin-offset"])}
    for kind, numbers, of in (
        ("Pose", "PoseCoordinate", "of-pose"),
        ("Position", "PositionCoordinate", "of-position"),
    ):
        by_relation = index_by(nodes.by_id, COORD[numbers], COORD[of])
        for node in nodes.of_type(REL[kind]):
            have = by_relation.get(node.id, [])
            if not have and node.id in offsets:
                message = f"origin-offset {local_name(node.id)} has no coordinates"
                found.add_warning(node.id, message, "the frames of the joint say where it is")
            elif not have:
                found.add_error(node.id, f"{kind.lower()} {local_name(node.id)} has no coordinates")
            elif len(have) > 1:
                names = ", ".join(local_name(n.id) for n in have[:_SHOWN])
                message = f"{kind.lower()} {local_name(node.id)} has {len(have)} coordinates"
                found.add_error(have[1].id, message, f"keep one of {names}")


def _check_units(nodes: NodeGraph, found: NodeGraph) -> None:
    """Numbers that are read are in units known here: another one would be taken for metres."""
    for node in nodes.by_id.values():
        units = node.values.get(_UNIT)
        if units is None or not any(word in node.values for word in _MEASURED):
            continue
        for unit in node.refs(_UNIT):
            if unit not in LENGTHS and unit not in ANGLES:
                message = f'"{local_name(unit)}", the unit of {local_name(node.id)}, is not known'
                known = ", ".join(map(local_name, (*LENGTHS, *ANGLES)))
                found.add_error(node.id, message, f"one of {known}")


def _check_owners(nodes: NodeGraph, found: NodeGraph) -> None:
    """A wall or feature belongs to one space, an opening to one plan."""
    for predicate in ("walls", "features"):
        owners: dict[str, list[str]] = {}
        for kind in ("Space", "FloorPlan"):
            for owner in nodes.of_type(FP[kind]):
                for target in map(str, owner.refs(FP[predicate])):
                    owners.setdefault(target, []).append(local_name(owner.id))
        for target, names in owners.items():
            if len(names) > 1:
                found.add_error(
                    target,
                    f"{local_name(target)} belongs to {' and to '.join(names[:_SHOWN])}",
                    "give each its own identifier: <space>-<name>",
                )
