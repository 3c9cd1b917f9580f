"""Models as they were published before the current vocabulary, read as current ones.

Floor plans of 2023 have walls without thickness and height whose corners are in the frame of their
space, features without a place, and identifiers with the kind in front (``space-hall``). Their
files and those of objects refer to each other with prefixes that only one of them declares.
Everything that is read otherwise than it is written is a warning that says what was assumed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from grammars.floorplan import wall_frames
from grammars.jsonld._kinematics import ANGLES, LENGTHS, scaled
from grammars.jsonld._nodes import Node, NodeGraph, Ref, Value, index_by
from grammars.jsonld._plan_writer import has_mitres
from grammars.jsonld._references import dangling, reference_rules
from grammars.jsonld.vocabulary import (
    COORD,
    FP,
    GEOM,
    POLY,
    QUDT,
    REL,
    SCN,
    UNIT,
    local_name,
)
from grammars.model.geometry import Point2, Pose2

WALL_HEIGHT: Final = 2.5
"""Height [m] of walls and features whose model gives none: that of the published building C."""
_SAME: Final = 1e-6
_DIGITS: Final = 12
_FRAME_OF_SPACE: Final = "frame-center-"


def settle_models(nodes: NodeGraph) -> None:
    """Read everything in ``nodes`` that is said in an earlier way as it is said today."""
    _settle_identifiers(nodes)
    _settle_origins(nodes)
    walls = [node for node in nodes.of_type(FP["Wall"]) if FP["thickness"] not in node.values]
    if walls:
        _settle_walls(nodes, walls)
        _settle_names(nodes)
    _settle_features(nodes)


def _settle_identifiers(nodes: NodeGraph) -> None:
    """Let references meet what they mean where one of two files does not declare a prefix.

    A reference that leads to nothing is one to the only thing of that local name and of a fitting
    type, provided nothing else is where it leads: nobody is corrected who merely misspelt a name.
    """
    missing = dangling(nodes)
    if not missing:
        return
    homes = {_home(node.id) for node in nodes.by_id.values() if node.types}
    named: dict[str, list[Node]] = {}
    for node in nodes.by_id.values():
        if node.types:
            named.setdefault(local_name(node.id), []).append(node)
    meant: dict[str, str] = {}
    seen: dict[tuple[str, str], list[str]] = {}
    for owner, predicate, target in missing:
        if target in meant:
            continue
        allowed = reference_rules()[predicate].allowed(nodes.get(owner))
        fitting = [
            node
            for node in named.get(local_name(target), ())
            if any(kind in node.types for kind in allowed)
        ]
        if len(fitting) != 1:
            continue
        found = fitting[0].id
        # The definition may be the one without a prefix, then everything is called as it is said.
        if _home(target) not in homes or found in nodes.relative:
            meant[target] = found
            seen.setdefault((_home(target), _home(found)), []).append(owner)
    for (said, found), owners in seen.items():
        targets = [target for target in meant if _home(target) == said]
        example = targets[0]
        more = f" and {len(targets) - 1} more" if len(targets) > 1 else ""
        # An identifier without a prefix is shown as it was written.
        shown = local_name(example) if example.startswith("file:") else example
        hint = f"what has that name in <{found}> is taken: is a prefix missing, or not declared?"
        if meant[example] in nodes.relative:
            hint = f'"{local_name(example)}" is taken, which was written without a prefix'
        nodes.add_warning(owners[0], f'nothing is called "{shown}"{more}', hint)
    if meant:
        _refer(nodes, meant)


def _home(id: str) -> str:
    return id[: len(id) - len(local_name(id))]


def _refer(nodes: NodeGraph, meant: dict[str, str]) -> None:
    """Replace references."""

    def current(value: Value) -> Value:
        if isinstance(value, Ref):
            return Ref(meant.get(value, value))
        if isinstance(value, tuple):
            return tuple(current(item) for item in value)
        return value

    for node in nodes.by_id.values():
        for predicate, values in node.values.items():
            node.values[predicate] = [current(value) for value in values]


def _settle_origins(nodes: NodeGraph) -> None:
    """A position is with respect to a point: of a frame, its origin is meant."""
    first = ""
    for node in nodes.of_type(REL["Position"]):
        for k, value in enumerate(node.all(REL["with-respect-to"])):
            frame = nodes.by_id.get(value) if isinstance(value, Ref) else None
            origin = frame.ref(GEOM["origin"]) if frame and GEOM["Frame"] in frame.types else None
            if origin is not None:
                node.values[REL["with-respect-to"]][k] = origin
                first = first or node.id
    if first:
        nodes.add_warning(
            first, f"{local_name(first)} is with respect to a frame", "its origin is taken"
        )


def _settle_walls(nodes: NodeGraph, walls: list[Node]) -> None:
    """Give walls the thickness their outline has, and a height."""
    geometry = _Geometry(nodes)
    moved = [
        wall
        for space in nodes.of_type(FP["Space"])
        for k, wall in enumerate(_walls_of(nodes, space))
        if geometry.to_own_frame(space, wall, k)
    ]
    if moved:
        nodes.add_warning(
            moved[0].id,
            f"the corners of {_count(moved, 'wall')} are said to be seen by the wall and given in "
            "the frame of its space",
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
            f"{WALL_HEIGHT:g} m is taken; the thickness is that of the outline",
        )
    if not (nodes.of_type(FP["Entryway"]) or nodes.of_type(FP["Window"])):
        nodes.add_warning(
            walls[0].id,
            "no entryways and windows are given: every room is closed",
            "the .fpm text it was made from has them, if there are any",
        )


def _walls_of(nodes: NodeGraph, space: Node) -> list[Node]:
    return [nodes.get(id) for id in space.refs(FP["walls"]) if id in nodes.by_id]


def _count(found: list[Node], word: str) -> str:
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return f"{word} {local_name(found[0].id)}{more}"


class _Geometry:
    """Coordinates of points and frames by what they are of."""

    def __init__(self, nodes: NodeGraph) -> None:
        self._nodes = nodes
        self._positions = index_by(nodes.by_id, REL["Position"], REL["of"])
        self._points = index_by(nodes.by_id, COORD["PositionCoordinate"], COORD["of-position"])
        self._poses = index_by(nodes.by_id, REL["Pose"], REL["of"])
        self._frames = index_by(nodes.by_id, COORD["PoseCoordinate"], COORD["of-pose"])

    def corners(self, element: Node) -> list[tuple[Node, Point2]]:
        """Return the coordinates of an element's outline, or nothing when one is missing."""
        shape = self._nodes.by_id.get(element.ref(FP["shape"]) or "")
        found = []
        for point in shape.refs(POLY["points"]) if shape is not None else ():
            numbers = next(
                (c for p in self._positions.get(point, ()) for c in self._points.get(p.id, ())),
                None,
            )
            at = None if numbers is None else _point(numbers)
            if numbers is None or at is None:
                return []
            found.append((numbers, at))
        return found

    def pose(self, frame: str, wrt: str) -> tuple[Node, Pose2] | None:
        """Return the coordinates of a frame in another one that it is placed against."""
        for pose in self._poses.get(frame, ()):
            if pose.ref(REL["with-respect-to"]) == wrt:
                for numbers in self._frames.get(pose.id, ()):
                    at, yaw = _point(numbers), scaled(numbers, COORD["alpha"], ANGLES)
                    if at is not None:
                        return numbers, Pose2(*at, yaw or 0.0)
        return None

    def to_own_frame(self, space: Node, wall: Node, index: int) -> bool:
        """Put the corners of a wall into its own frame where they are in that of its space."""
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
        placed = self.pose(
            corners[0][0].ref(COORD["as-seen-by"]) or "",
            ring[0][0].ref(COORD["as-seen-by"]) or "",
        )
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
        """Return the frame that the outline implies for a wall, and write it, if that is it.

        Published angles are rounded: a room placed by its wall would come back from an export of
        ours with other last digits.
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
        """Return the distance [m] of the outer edge of a wall from the inner one."""
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


def _settle_names(nodes: NodeGraph) -> None:
    """``space-hall`` is called hall, as in the text it was made from."""
    for space in nodes.of_type(FP["Space"]):
        name = local_name(space.id).removeprefix("space-")
        if name != local_name(space.id) and name and SCN["name"] not in space.values:
            space.add(SCN["name"], name)


def _settle_features(nodes: NodeGraph) -> None:
    """A feature is a column with a height; one without a place cannot be read."""
    vague = [
        node
        for node in nodes.of_type(FP["Feature"])
        if not {FP["Column"], FP["Divider"]} & set(node.types)
    ]
    if not vague:
        return
    geometry = _Geometry(nodes)
    placed = [node for node in vague if geometry.corners(node)]
    lost = [node for node in vague if node not in placed]
    for node in placed:
        kind = "Divider" if "divider" in local_name(node.id) else "Column"
        node.add_type(FP[kind])
        if FP["height"] not in node.values:
            node.add(FP["height"], WALL_HEIGHT)
            node.add(QUDT["unit"], Ref(UNIT["M"]))
    if placed:
        nodes.add_warning(
            placed[0].id,
            f"no type says what {_count(placed, 'feature')} may be",
            f"a divider by its name, else a column; {WALL_HEIGHT:g} m high unless given",
        )
    if lost:
        nodes.add_warning(
            lost[0].id,
            f"no coordinates are given for {_count(lost, 'feature')}: left out",
            "the .fpm text it was made from has them",
        )
        _leave_out(nodes, lost)


def _leave_out(nodes: NodeGraph, lost: Iterable[Node]) -> None:
    gone = {node.id for node in lost}
    shapes = {str(node.ref(FP["shape"])) for node in nodes.by_id.values() if node.id in gone}
    for id in gone | shapes:
        nodes.by_id.pop(id, None)
    for owner in nodes.by_id.values():
        for k, value in enumerate(owner.all(FP["features"])):
            if isinstance(value, tuple):
                owner.values[FP["features"]][k] = tuple(v for v in value if v not in gone)
        kept = [v for v in owner.all(FP["features"]) if v not in gone]
        if FP["features"] in owner.values:
            owner.values[FP["features"]] = kept
