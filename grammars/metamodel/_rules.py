"""What must hold in a composed graph and SHACL cannot say, or not fast enough.

References resolve and have the right types, nothing is said twice with two meanings, the poses
are one tree (and one per object model), coordinates are there exactly once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from grammars.diagnostics import Diagnostic, InputError, Severity, did_you_mean
from grammars.metamodel._joints import check_joints
from grammars.metamodel._nodes import Node, Nodes, index_by
from grammars.metamodel._pose_tree import check_pose_tree
from grammars.metamodel._vocabulary import (
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

_BODY: Final = (GEOM["SimplicialComplex"], GEOM["RigidBody"])
_SHAPE: Final = (POLY["Polygon"], POLY["Polyhedron"], POLY["Polytope"], POLY["CuboidWithSize"])
_SOLID: Final = (*_SHAPE, POLY["3DPolytope"], POLY["Cylinder"])
_FRAME: Final = (GEOM["Frame"],)
_JOINT: Final = (KC["Joint"], KC["RevoluteJoint"], OBJ["PrismaticJoint"])

TARGETS: Final[dict[str, tuple[str, ...]]] = {
    GEOM["origin"]: (GEOM["Point"],),
    GEOM["start"]: (GEOM["Point"],),
    GEOM["vector-x"]: (GEOM["Vector"],),
    GEOM["vector-y"]: (GEOM["Vector"],),
    GEOM["vector-z"]: (GEOM["Vector"],),
    GEOM["simplices"]: (GEOM["Point"], GEOM["Vector"], GEOM["Frame"]),
    REL["lines"]: (GEOM["Vector"],),
    COORD["of-pose"]: (REL["Pose"],),
    COORD["of-position"]: (REL["Position"],),
    COORD["as-seen-by"]: _FRAME,
    POLY["points"]: (GEOM["Point"],),
    POLY["faces"]: (GEOM["Point"],),
    FP["spaces"]: (FP["Space"],),
    FP["walls"]: (FP["Wall"],),
    FP["features"]: (FP["Column"], FP["Divider"], FP["Feature"]),
    FP["openings"]: (FP["Entryway"], FP["Window"], FP["Opening"]),
    FP["voids"]: (FP["Wall"],),
    FP["shape"]: _SHAPE,
    FP["3d-shape"]: _SOLID,
    KC["between-attachments"]: _BODY,
    KC["common-axis"]: (REL["LineCollinearity"],),
    KC["origin-offset"]: (REL["Position"],),
    KC["joints"]: _JOINT,
    KC_STATE["of-joint"]: _JOINT,
    DYN["of-body"]: _BODY,
    DYN["reference-point"]: (GEOM["Point"],),
    OBJ["object-frame"]: _FRAME,
    OBJ["object-links"]: (OBJ["ObjectLink"],),
    OBJ["kinematic-chain"]: (KC["KinematicChain"],),
    OBJ["link"]: _BODY,
    OBJ["link-frame"]: _FRAME,
    OBJ["polytope"]: _SOLID,
    OBJ["joint-without-tree"]: _JOINT,
    OBJ["parent"]: _BODY,
    OBJ["children"]: _BODY,
    OBJ["frame"]: _FRAME,
    OBJ["of-object"]: (OBJ["Object"],),
    OBJ["world"]: (FP["FloorPlan"],),
    ST["joint"]: _JOINT,
    ST["pose"]: (KC_STATE["JointPosition"],),
    ST["state"]: (ST["State"],),
    ST["start-state"]: (ST["State"],),
    ST["end-state"]: (ST["State"],),
    GZB["visual"]: (OBJ["LinkVisualRepresentation"],),
    GZB["collision"]: (OBJ["LinkPhysicsRepresentation"],),
    GZB["inertia"]: (DYN["RigidBodyInertia"],),
    GZB["gz-link"]: (OBJ["ObjectLink"],),
    SCN["mirror-of"]: (OBJ["Object"],),
    SCN["stands-in"]: (FP["Entryway"],),
    SCN["about"]: (OBJ["ObjectInstance"], *_JOINT),
}
"""What may stand at the end of each reference."""
_HARMLESS: Final = frozenset((GEOM["start"], GEOM["simplices"], KC["origin-offset"]))
"""References whose loss changes nothing that is read."""
_SHARED: Final = frozenset(
    (
        *(GEOM["simplices"], REL["lines"], KC["between-attachments"], KC["joints"]),
        *(GZB["visual"], GZB["collision"]),
        *(OBJ["object-links"], OBJ["children"], QUDT["unit"], QUDT["quantityKind"], SCN["about"]),
    )
)
"""Predicates of our vocabularies that may have several values."""
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
_SHOWN: Final = 4
_HINTS: Final = 20
"""Looking for similar names takes time in a large graph: later errors go without."""


def refuse_broken(nodes: Nodes, *, partial: bool = False) -> None:
    """Check ``nodes``; warnings are added to their findings, errors raise ``InputError``."""
    found = check(nodes, partial=partial)
    errors = tuple(d for d in found if d.severity is Severity.ERROR)
    if errors:
        raise InputError(errors)
    nodes.findings.extend(found)


def check(nodes: Nodes, *, partial: bool = False) -> tuple[Diagnostic, ...]:
    """Return everything that is wrong with the structure of a graph.

    A ``partial`` graph is one layer: what it refers to may be in another one.
    """
    found = Nodes(places=nodes.places)
    _check_identity(nodes, found)
    _check_references(nodes, found, partial)
    _check_coordinates(nodes, found)
    check_pose_tree(nodes, found, partial=partial)
    _check_owners(nodes, found)
    check_joints(nodes, found)
    return tuple(dict.fromkeys(found.findings))


def _check_identity(nodes: Nodes, found: Nodes) -> None:
    """One identifier is one thing, which says one thing of each sort."""
    for node in nodes.by_id.values():
        kinds = [_KIND_NAMES[kind] for kind in node.types if kind in _KIND_NAMES]
        if len(kinds) > 1:
            listed = " and a ".join(kinds)
            found.error(
                node.id,
                f'"{local_name(node.id)}" is a {listed}: two things have one identifier',
                "rename one of them",
            )
        for predicate, values in node.values.items():
            if len(values) > 1 and predicate not in _SHARED and predicate.startswith(_OURS):
                shown = ", ".join(_shown(v) for v in values[:_SHOWN])
                found.error(
                    node.id,
                    f'"{local_name(node.id)}" has {len(values)} values of '
                    f"{local_name(predicate)}: {shown}",
                    "do two things share this identifier?",
                )


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return f"a list of {len(value)}"
    return local_name(value) if isinstance(value, str) else f"{value}"


def _check_references(nodes: Nodes, found: Nodes, partial: bool) -> None:
    homes = {_home(node.id) for node in nodes.by_id.values() if node.types}

    def elsewhere(target: str) -> bool:
        return partial and _home(target) not in homes

    for node in nodes.by_id.values():
        for predicate in node.values:
            allowed = TARGETS.get(predicate)
            if allowed is None and predicate in (REL["of"], REL["with-respect-to"]):
                pose = REL["Pose"] in node.types
                allowed = (GEOM["Frame"],) if pose else (GEOM["Point"],)
            if allowed is not None:
                for target in node.refs(predicate):
                    _check_reference(nodes, found, elsewhere, node, predicate, target, allowed)


def _home(id: str) -> str:
    """Return what belongs together: a namespace, or an object of ours with all its parts."""
    if id.startswith(ITEMS):
        return id.partition(".")[0]
    return id[: len(id) - len(local_name(id))]


def _check_reference(
    nodes: Nodes,
    found: Nodes,
    elsewhere: Callable[[str], bool],
    node: Node,
    predicate: str,
    target: str,
    allowed: tuple[str, ...],
) -> None:
    other = nodes.by_id.get(target)
    if other is not None and any(kind in other.types for kind in allowed):
        return
    words = f"{local_name(predicate)} of {local_name(node.id)} is {local_name(target)}"
    if other is not None and other.types:
        kinds = ", ".join(map(local_name, other.types))
        wanted = " or ".join(dict.fromkeys(map(local_name, allowed)))
        found.error(node.id, f"{words}, a {kinds}", f"expected a {wanted}")
    elif not elsewhere(target):
        hint = ""
        if len(found.findings) < _HINTS:
            near = [n.id for kind in allowed for n in nodes.of_type(kind)]
            hint = did_you_mean(local_name(target), map(local_name, near))
        message = f"{words}, which does not exist"
        note = found.warn if predicate in _HARMLESS else found.error
        note(node.id, message, hint)


def _check_coordinates(nodes: Nodes, found: Nodes) -> None:
    """Every pose and position has its numbers exactly once."""
    for kind, numbers, of in (
        ("Pose", "PoseCoordinate", "of-pose"),
        ("Position", "PositionCoordinate", "of-position"),
    ):
        by_relation = index_by(nodes.by_id, COORD[numbers], COORD[of])
        for node in nodes.of_type(REL[kind]):
            have = by_relation.get(node.id, [])
            if not have:
                found.error(node.id, f"{kind.lower()} {local_name(node.id)} has no coordinates")
            elif len(have) > 1:
                names = ", ".join(local_name(n.id) for n in have[:_SHOWN])
                message = f"{kind.lower()} {local_name(node.id)} has {len(have)} coordinates"
                found.error(have[1].id, message, f"keep one of {names}")


def _check_owners(nodes: Nodes, found: Nodes) -> None:
    """A wall or feature belongs to one space, an opening to one plan."""
    for predicate in ("walls", "features"):
        owners: dict[str, list[str]] = {}
        for kind in ("Space", "FloorPlan"):
            for owner in nodes.of_type(FP[kind]):
                for target in map(str, owner.refs(FP[predicate])):
                    owners.setdefault(target, []).append(local_name(owner.id))
        for target, names in owners.items():
            if len(names) > 1:
                found.error(
                    target,
                    f"{local_name(target)} belongs to {' and to '.join(names[:_SHOWN])}",
                    "give each its own identifier: <space>-<name>",
                )
