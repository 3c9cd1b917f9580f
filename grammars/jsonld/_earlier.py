"""Conversion of earlier published models to the current vocabulary.

Walls in floor plans of 2023 lack thickness and height, and their corners are in the frame of their
space. Features have no place, and identifiers begin with the kind (``space-hall``). Files of plans
and of objects refer to each other with prefixes that only one of them declares. Every assumption
is a warning.
"""

from __future__ import annotations

import math
from typing import Final

from grammars.floorplan import wall_frames
from grammars.jsonld._kinematics import ANGLES, LENGTHS, scaled
from grammars.jsonld._nodes import Node, NodeGraph, Ref, Value, index_by
from grammars.jsonld._plan_writer import has_mitres
from grammars.jsonld.vocabulary import (
    COORD,
    FP,
    GEOM,
    KC_STATE,
    OBJ,
    POLY,
    QUDT,
    REL,
    SCN,
    ST,
    UNIT,
    UNKNOWN,
    local_name,
    namespace_of,
)
from grammars.model.geometry import Point2, Pose2

WALL_HEIGHT: Final = 2.5
"""Default height of walls [m]: that of the published building C."""
_SAME: Final = 1e-6
_DIGITS: Final = 12


def rename_terms(nodes: NodeGraph) -> NodeGraph:
    """Replace earlier terms of ``nodes`` by current ones, and return ``nodes``."""
    examples: dict[str, str] = {}
    for node in nodes.by_id.values():
        for fix in (_yaw, _degrees, _quantity, _features):
            message = fix(node)
            if message:
                examples.setdefault(message, node.id)
    for message, id in examples.items():
        nodes.add_warning(id, message, "read as its current form")
    return nodes


def _yaw(node: Node) -> str:
    for old in (COORD["theta"], POLY["theta"]):
        if old in node.values:
            node.values[COORD["alpha"]] = node.values.pop(old)
            return '"theta" is an outdated term for "alpha"'
    return ""


def _degrees(node: Node) -> str:
    units = node.values.get(QUDT["unit"], [])
    if UNKNOWN["degrees"] not in units:
        return ""
    units[units.index(UNKNOWN["degrees"])] = Ref(UNIT["DEG"])
    return '"degrees" is not a unit of QUDT'


def _quantity(node: Node) -> str:
    # comp-rob2b now defines "value" only for the type Quantity, which door files of 2023 lack.
    if QUDT["value"] not in node.values or QUDT["Quantity"] in node.types:
        return ""
    node.add_type(QUDT["Quantity"])
    label = "the value of a joint" if KC_STATE["of-joint"] in node.values else "a value"
    return f'{label} needs the type "Quantity"; without it, RDF tools drop the value'


def _features(node: Node) -> str:
    if FP["feature"] not in node.values:
        return ""
    node.values[FP["features"]] = node.values.pop(FP["feature"])
    return '"feature" is in no published context; RDF tools drop the link to features'


def settle_models(nodes: NodeGraph) -> None:
    """Rewrite earlier forms in ``nodes`` as current ones."""
    _settle_limits(nodes)
    if not nodes.is_earlier:
        return
    _settle_identifiers(nodes)
    _settle_origins(nodes)
    walls = [node for node in nodes.of_type(FP["Wall"]) if FP["thickness"] not in node.values]
    if walls:
        _settle_walls(nodes, walls)
    _leave_out_features(nodes)


def _settle_limits(nodes: NodeGraph) -> None:
    """Remove limit types from positions that a state refers to."""
    for state in nodes.of_type(ST["JointState"]):
        for pose in (nodes.get(id) for id in state.refs(ST["pose"])):
            for kind in (OBJ["JointLowerLimit"], OBJ["JointUpperLimit"]):
                if kind in pose.types:
                    pose.types.remove(kind)
                    message = f"{local_name(pose.id)} is the position of a state and has the type "
                    hint = "it is not read as a limit; remove the type"
                    nodes.add_warning(pose.id, f"{message}{local_name(kind)}", hint)


def _settle_identifiers(nodes: NodeGraph) -> None:
    """Redirect a reference without a node to the only node of its local name.

    Earlier files often fail to declare the prefix of another file.
    """
    existing = {node.id for node in nodes.by_id.values() if node.types}
    by_name: dict[str, list[str]] = {}
    for id in existing:
        by_name.setdefault(local_name(id), []).append(id)
    redirects: dict[str, str] = {}
    # By the written and the right namespace: the first owner of every stray reference.
    strays: dict[tuple[str, str], dict[str, str]] = {}
    for node in nodes.by_id.values():
        for predicate in node.values:
            for target in node.refs(predicate):
                namesakes = by_name.get(local_name(target), ())
                if target not in existing and len(namesakes) == 1:
                    redirects[target] = namesakes[0]
                    homes = namespace_of(target), namespace_of(namesakes[0])
                    strays.setdefault(homes, {}).setdefault(target, node.id)
    for (_, right), owners in strays.items():
        (stray, owner), *_ = owners.items()
        more = f" and {len(owners) - 1} more" if len(owners) > 1 else ""
        # An identifier without a prefix is shown as written.
        label = local_name(stray) if stray.startswith("file:") else stray
        hint = f"the node of that name in <{right}> is used: is a prefix missing or not declared?"
        nodes.add_warning(owner, f'no node has the identifier "{label}"{more}', hint)

    def current(value: Value) -> Value:
        if isinstance(value, tuple):
            return tuple(current(item) for item in value)
        return Ref(redirects.get(value, value)) if isinstance(value, Ref) else value

    for node in nodes.by_id.values() if redirects else ():
        for predicate, values in node.values.items():
            node.values[predicate] = [current(value) for value in values]


def _settle_origins(nodes: NodeGraph) -> None:
    """Replace the frame that a position is with respect to by its origin."""
    settled = []
    for node in nodes.of_type(REL["Position"]):
        for id in node.refs(REL["with-respect-to"]):
            frame = nodes.by_id.get(id)
            if frame is not None and GEOM["origin"] in frame.values:
                node.values[REL["with-respect-to"]] = list(frame.refs(GEOM["origin"]))
                settled.append(node.id)
    if settled:
        message = f"{local_name(settled[0])} is with respect to a frame"
        nodes.add_warning(settled[0], message, "the origin of the frame is used")


def _settle_walls(nodes: NodeGraph, walls: list[Node]) -> None:
    """Give walls the thickness of their outline and a height, and spaces their names."""
    geometry = _Geometry(nodes)
    moved = [
        wall
        for space in nodes.of_type(FP["Space"])
        for k, wall in enumerate(nodes.get(id) for id in space.refs(FP["walls"]))
        if geometry.to_own_frame(space, wall, k)
    ]
    if moved:
        nodes.add_warning(
            moved[0].id,
            f"the corners of {_count(moved, 'wall')} name the frame of the wall, "
            "but are in the frame of its space",
            "read in the frame of the space",
        )
    for wall in walls:
        thickness = geometry.thickness(wall)
        if thickness is not None:
            wall.add(FP["thickness"], thickness)
    without = [wall for wall in walls if FP["height"] not in wall.values]
    for wall in without:
        wall.add(FP["height"], WALL_HEIGHT)
        wall.add(QUDT["unit"], Ref(UNIT["M"]))
    if without:
        nodes.add_warning(
            without[0].id,
            f"the height of {_count(without, 'wall')} is not given",
            f"{WALL_HEIGHT:g} m is used; the thickness is that of the outline",
        )
    if not (nodes.of_type(FP["Entryway"]) or nodes.of_type(FP["Window"])):
        nodes.add_warning(
            walls[0].id,
            "there are no entryways and windows: every room is closed",
            "if the building has any, they are in the .fpm text of the plan",
        )
    # space-hall is called hall in the text of the plan.
    for space in nodes.of_type(FP["Space"]):
        name = local_name(space.id).removeprefix("space-")
        if name and name != local_name(space.id):
            space.add(SCN["name"], name)


def _count(nodes: list[Node], word: str) -> str:
    more = f" and {len(nodes) - 1} more" if len(nodes) > 1 else ""
    return f"{word} {local_name(nodes[0].id)}{more}"


class _Geometry:
    """Coordinates of points and frames."""

    def __init__(self, nodes: NodeGraph) -> None:
        self._nodes = nodes
        self._positions = index_by(nodes.by_id, REL["Position"], REL["of"])
        self._points = index_by(nodes.by_id, COORD["PositionCoordinate"], COORD["of-position"])
        self._poses = index_by(nodes.by_id, REL["Pose"], REL["of"])
        self._frames = index_by(nodes.by_id, COORD["PoseCoordinate"], COORD["of-pose"])

    def corners(self, element: Node) -> list[tuple[Node, Point2]]:
        """Return the coordinates of an element's outline, or nothing if one is missing."""
        shape = self._nodes.by_id.get(element.ref(FP["shape"]) or "")
        corners = []
        for point in shape.refs(POLY["points"]) if shape is not None else ():
            positions = self._positions.get(point, ())
            numbers = [c for p in positions for c in self._points.get(p.id, ())][:1]
            ats = [(each, at) for each in numbers if (at := _point(each)) is not None]
            if not ats:
                return []
            corners += ats
        return corners

    def pose(self, frame: str, wrt: str) -> tuple[Node, Pose2] | None:
        """Return the coordinates of a frame in the frame it is placed against."""
        for pose in self._poses.get(frame, ()):
            for numbers in self._frames.get(pose.id, ()):
                at, yaw = _point(numbers), scaled(numbers, COORD["alpha"], ANGLES)
                if at is not None and pose.ref(REL["with-respect-to"]) == wrt:
                    return numbers, Pose2(*at, yaw or 0.0)
        return None

    def to_own_frame(self, space: Node, wall: Node, index: int) -> bool:
        """Transform the corners of a wall from the frame of its space to its own, if necessary."""
        ring, corners = self.corners(space), self.corners(wall)
        if len(corners) != 4 or index >= len(ring):
            return False
        start, end = ring[index][1], ring[(index + 1) % len(ring)][1]
        inner = corners[2][1], corners[3][1]
        if math.dist(inner[0], end) > _SAME or math.dist(inner[1], start) > _SAME:
            return False
        half = math.dist(start, end) / 2
        if math.dist(inner[0], (half, 0.0)) < _SAME and math.dist(inner[1], (-half, 0.0)) < _SAME:
            return False
        seen_by = COORD["as-seen-by"]
        placed = self.pose(corners[0][0].ref(seen_by) or "", ring[0][0].ref(seen_by) or "")
        if placed is None:
            return False
        own = self._implied(*placed, [at for _, at in ring], index)
        for numbers, at in corners:
            x, y = own.inverse().apply(at)
            units = [unit for unit in numbers.refs(QUDT["unit"]) if unit not in LENGTHS]
            _write(numbers, {"x": round(x, _DIGITS) + 0.0, "y": round(y, _DIGITS) + 0.0})
            numbers.values[QUDT["unit"]] = [Ref(UNIT["M"]), *units]
        return True

    def _implied(self, numbers: Node, pose: Pose2, ring: list[Point2], index: int) -> Pose2:
        """Return and write the frame that the outline implies for a wall, if ``pose`` is close.

        Published angles are rounded. Without the exact frame, a room placed by its wall would come
        back from our export with other last digits.
        """
        if not has_mitres(tuple(ring)):
            return pose
        implied = wall_frames(tuple(ring))[index]
        turn = abs(math.remainder(implied.yaw - pose.yaw, math.tau))
        if math.dist((implied.x, implied.y), (pose.x, pose.y)) > _SAME or turn > _SAME:
            return pose
        _write(numbers, {"x": implied.x, "y": implied.y, "alpha": implied.yaw})
        numbers.values[QUDT["unit"]] = [Ref(UNIT["M"]), Ref(UNIT["RAD"])]
        return implied

    def thickness(self, wall: Node) -> float | None:
        """Return the distance between the inner and outer edge of a wall [m]."""
        corners = [at for _, at in self.corners(wall)]
        if len(corners) != 4:
            return None
        (ax, ay), (bx, by) = corners[2], corners[3]
        length = math.hypot(bx - ax, by - ay)
        if length < _SAME:
            return None
        x, y = corners[0]
        return round(abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / length, _DIGITS)


def _write(numbers: Node, values: dict[str, float]) -> None:
    for name, value in values.items():
        numbers.values[COORD[name]] = [value]


def _point(numbers: Node) -> Point2 | None:
    x, y = (scaled(numbers, COORD[axis], LENGTHS) for axis in ("x", "y"))
    return None if x is None or y is None else (x, y)


def _leave_out_features(nodes: NodeGraph) -> None:
    """Remove features without coordinates: columns and dividers whose place is unknown."""
    geometry = _Geometry(nodes)
    unplaced = [node for node in nodes.of_type(FP["Feature"]) if not geometry.corners(node)]
    if not unplaced:
        return
    nodes.add_warning(
        unplaced[0].id,
        f"{_count(unplaced, 'feature')} without coordinates: left out",
        "the .fpm text of the plan has them",
    )
    ids = {node.id for node in unplaced}
    for id in ids | {shape for node in unplaced for shape in node.refs(FP["shape"])}:
        nodes.by_id.pop(id, None)
    for owner in nodes.by_id.values():
        if FP["features"] in owner.values:
            remaining = tuple(id for id in owner.refs(FP["features"]) if id not in ids)
            owner.values[FP["features"]] = [remaining]
