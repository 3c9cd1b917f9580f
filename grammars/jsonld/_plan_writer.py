"""Writer of a floor plan as the six published JSON-LD files.

Poses and outlines are those of the plan's text, so a reader gets the same numbers back, bit by bit.
For walls that the outline implies, the numbers of the outline are written.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from grammars.floorplan import (
    Feature,
    FloorPlan,
    Opening,
    Point3,
    Space,
    Wall,
    outer_corners,
    space_at,
    wall_frames,
)
from grammars.jsonld._kinematics import (
    POINT,
    Json,
    frame_nodes,
    polyhedron_node,
    pose_nodes,
    position_nodes,
)
from grammars.jsonld.vocabulary import PLANS, SCN, plan_context, rob2b, secoro
from grammars.model.geometry import Pose2, Ring, signed_area

_SAME: Final = 1e-9


def implied_space(space: Space, ring: Ring) -> Space | None:
    """Return the space that the outline ``ring`` implies, if it is the same as ``space``.

    ``ring`` is in the frame of the space.
    """
    if not space.walls or len(space.walls) != len(ring) or not has_mitres(ring):
        return None
    first = space.walls[0]
    implied = space_at(space.name, space.frame, ring, first.thickness, first.height, space.where)
    return implied if _have_same_walls(implied, space) else None


def is_polygon(ring: Ring) -> bool:
    """Return whether a ring has an area."""
    return abs(2 * signed_area(ring)) > _SAME


def has_mitres(ring: Ring) -> bool:
    """Return whether every corner has a mitre: no edge has length zero or turns back."""
    edges = [(q[0] - p[0], q[1] - p[1]) for p, q in zip(ring, ring[1:] + ring[:1], strict=True)]
    if any(math.hypot(*edge) < _SAME for edge in edges):
        return False
    units = [(x / math.hypot(x, y), y / math.hypot(x, y)) for x, y in edges]
    turns = zip(units[-1:] + units[:-1], units, strict=True)
    return all(1.0 + a[0] * b[0] + a[1] * b[1] > _SAME for a, b in turns)


def _have_same_walls(one: Space, other: Space) -> bool:
    """Return whether two spaces have the same walls, to a nanometre."""
    return all(
        a.thickness == b.thickness
        and a.height == b.height
        and _close(a.frame, b.frame)
        and all(math.dist(p, q) < _SAME for p, q in zip(a.footprint, b.footprint, strict=True))
        for a, b in zip(one.walls, other.walls, strict=True)
    )


def _close(a: Pose2, b: Pose2) -> bool:
    turn = abs(math.remainder(a.yaw - b.yaw, math.tau))
    return math.dist((a.x, a.y), (b.x, b.y)) < _SAME and turn < _SAME


WORLD: Final = "world"
_WALL_FRAME: Final = re.compile(r"-wall-\d+-frame$")
_QUDT: Final = rob2b("qudt.json").replace("https:", "http:")
FILES: Final = {
    "skeleton": [rob2b("geometry/structural-entities.json")],
    "shape": [secoro("geometry/polytope.json")],
    "polyhedron": [secoro("geometry/polytope.json")],
    "spatial_relations": [rob2b("geometry/spatial-relations.json")],
    "coordinate": [
        _QUDT,
        rob2b("geometry/coordinates.json"),
        secoro("geometry/coordinates.json"),
    ],
    "floorplan": [_QUDT, secoro("floorplan/floorplan.json")],
}
"""Published files, in order, with the contexts of each."""


@dataclass(slots=True)
class PlanWriter:
    """Builder of the nodes of every file; ``files`` holds them by file name."""

    plan: FloorPlan
    files: dict[str, list[Json]] = field(default_factory=lambda: {name: [] for name in FILES})
    ids: dict[tuple[str, str], str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._name_everything()
        self._frame_of(WORLD)
        for space in self.plan.spaces:
            self._space(space)
        for feature in self.plan.features:
            self._feature(feature)
        for opening in self.plan.openings:
            self._opening(opening)
        self._structure()

    @property
    def nodes(self) -> list[Json]:
        """The nodes of all six files."""
        return [node for nodes in self.files.values() for node in nodes]

    @property
    def base(self) -> str:
        """Base IRI of the plan's identifiers."""
        return f"{PLANS}{self.plan.name}/"

    def frame(self, published: str) -> str:
        """Return the identifier of a frame in these files."""
        return self.ids.get(("frame", published), published)

    def _name_everything(self) -> None:
        """Give every element a unique identifier; spaces keep their names."""
        # A room may have the name of the plan or of a door; in a graph they would be one node.
        names = {f"{WORLD}-frame", WORLD}
        for space in self.plan.spaces:
            id = space.name if space.name not in names else f"space-{space.name}"
            self.ids["space", space.name] = id
            names.add(id)
            self.ids["frame", f"{space.name}-frame"] = f"{id}-frame"
            for wall in space.walls:
                self.ids["wall", wall.id] = f"{id}-wall-{wall.index}"
                self.ids["frame", f"{wall.id}-frame"] = f"{id}-wall-{wall.index}-frame"
        self.ids["frame", f"{WORLD}-frame"] = f"{WORLD}-frame"
        for kind, name in (
            *((f.kind, f.id) for f in self.plan.features),
            *((o.kind, o.id) for o in self.plan.openings),
            ("plan", self.plan.name),
        ):
            id = name if name not in names else f"{kind}-{name}"
            names.add(id)
            self.ids[kind, name] = id

    def _space(self, space: Space) -> None:
        id = self.ids["space", space.name]
        placed = space.placement
        ring = flat(placed.outline) if placed else space.frame.inverse().apply_ring(space.outline)
        self._frame_of(id)
        self._outline(id, id, _level_ring(ring, 0.0), len(ring))
        self._holes(id, id, space)
        self._place(self.frame(placed.of) if placed else f"{id}-frame", space)
        for wall, (pose, footprint) in zip(space.walls, _walls(space, ring), strict=True):
            wall_id = self.ids["wall", wall.id]
            self._solid(wall_id, wall_id, _prism(footprint, wall.height))
            self._pose(f"{wall_id}-frame", f"{id}-frame", pose)

    def _feature(self, feature: Feature) -> None:
        id, placed = self.ids[feature.kind, feature.id], feature.placement
        stem = f"{feature.kind}-{feature.id}"
        local = feature.frame.inverse().apply_ring(feature.footprint)
        self._solid(id, stem, _prism(flat(placed.outline) if placed else local, feature.height))
        self._holes(id, stem, feature)
        self._place(f"{stem}-frame", feature)

    def _opening(self, opening: Opening) -> None:
        id, placed = self.ids[opening.kind, opening.id], opening.placement
        stem = f"{opening.kind}-{opening.id}"
        near = placed.outline if placed else _untilted(opening)
        self._solid(id, stem, (*near, *((x, opening.depth, z) for x, _, z in near)))
        self._place(f"{stem}-frame", opening, opening.z, opening.tilt)

    def _solid(self, id: str, stem: str, corners: tuple[Point3, ...]) -> None:
        """Write the body of an element; the first half of the corners is its outline."""
        self._frame_of(stem)
        points = self._outline(id, stem, corners, len(corners) // 2)
        self.files["polyhedron"].append(polyhedron_node(f"{id}-polyhedron", points))

    def _holes(self, id: str, stem: str, element: Space | Feature) -> None:
        """Write the outlines of holes in the frame of their element."""
        for number, ring in enumerate(map(element.frame.inverse().apply_ring, element.holes)):
            self._outline(f"{id}-hole-{number}", stem, _level_ring(ring, 0.0), len(ring))

    def _outline(self, id: str, stem: str, corners: tuple[Point3, ...], outline: int) -> list[str]:
        """Write corners and return their names; the first ``outline`` corners are the outline."""
        frame, origin = f"{stem}-frame", f"{stem}-origin"
        points = [f"{id}-corner-{k}" for k in range(len(corners))]
        polygon = {"@id": f"{id}-polygon", "@type": "Polygon", "points": points[:outline]}
        self.files["shape"].append(polygon)
        for point, at in zip(points, corners, strict=True):
            self.files["skeleton"].append({"@id": point, "@type": POINT})
            name = f"position-{point}-wrt-{frame}"
            self._relate(position_nodes((name, f"coord-{name}"), point, frame, origin, at))
        return points

    def _frame_of(self, stem: str) -> None:
        self.files["skeleton"] += frame_nodes(f"{stem}-frame", f"{stem}-origin")

    def _place(
        self, of: str, element: Space | Feature | Opening, z: float = 0.0, tilt: float = 0.0
    ) -> None:
        """Write the placement of an element, by default its pose in the world."""
        placed = element.placement
        wrt = self.frame(placed.wrt if placed else f"{WORLD}-frame")
        self._pose(of, wrt, placed.offset if placed else element.frame, z, tilt)

    def _pose(self, of: str, wrt: str, pose: Pose2, z: float = 0.0, tilt: float = 0.0) -> None:
        # If an identifier contains "wall" twice, published readers invert the pose before it: they
        # assume a room placed by its wall against another wall. A room placed by its wall against
        # another frame needs the second "wall" too.
        own = of.startswith(f"{wrt.removesuffix('frame')}wall-")
        by_wall = _WALL_FRAME.search(of) and not _WALL_FRAME.search(wrt) and not own
        id = f"pose-{'wall-' if by_wall else ''}{of}-wrt-{wrt}"
        self._relate(pose_nodes((id, f"coord-{id}"), of, wrt, pose, z, tilt))

    def _relate(self, nodes: list[Json]) -> None:
        """Write a relation and its coordinates."""
        relation, coordinates = nodes
        self.files["spatial_relations"].append(relation)
        self.files["coordinate"].append(coordinates)

    def _structure(self) -> None:
        nodes, plan = self.files["floorplan"], self.plan
        whole: Json = {"@id": self.ids["plan", plan.name], "@type": "FloorPlan"}
        whole["spaces"] = [self.ids["space", s.name] for s in plan.spaces]
        loose = [self.ids[f.kind, f.id] for f in plan.features if not f.space]
        if loose:
            whole["features"] = loose
            order = [{"@id": self.ids[f.kind, f.id]} for f in plan.features]
            whole[SCN["order"]] = {"@list": order}
        if plan.openings:
            whole["openings"] = [self.ids[o.kind, o.id] for o in plan.openings]
        nodes.append(self._named(whole, plan.name))
        for space in plan.spaces:
            nodes.append(self._space_node(space))
            nodes.extend(self._wall_node(wall) for wall in space.walls)
        nodes.extend(self._feature_node(feature) for feature in plan.features)
        nodes.extend(self._opening_node(opening) for opening in plan.openings)

    def _named(self, node: Json, name: str) -> Json:
        """Add the name to a node whose identifier differs from it."""
        return node if node["@id"] == name else node | {SCN["name"]: name}

    def _space_node(self, space: Space) -> Json:
        id = self.ids["space", space.name]
        inside = [self.ids[f.kind, f.id] for f in self.plan.features if f.space == space.name]
        node = {
            "@id": id,
            "@type": "Space",
            "walls": [self.ids["wall", wall.id] for wall in space.walls],
            "features": inside,
            "shape": f"{id}-polygon",
        }
        # The published vocabulary has no spaces without walls, and no holes.
        if not space.walls:
            node |= {"@type": ["Space", SCN["Area"]], **_hole_list(id, space.holes)}
        return self._named(node, space.name)

    def _wall_node(self, wall: Wall) -> Json:
        id = self.ids["wall", wall.id]
        body = {"thickness": wall.thickness, "height": wall.height, "unit": "M"}
        return {"@id": id, "@type": "Wall", **_shapes(id), **body}

    def _feature_node(self, feature: Feature) -> Json:
        id = self.ids[feature.kind, feature.id]
        body = {"height": feature.height, "unit": "M"}
        node = {"@id": id, "@type": feature.kind.capitalize(), **_shapes(id), **body}
        # For other tools, a wall without a space is a divider.
        if feature.kind == "wall":
            node |= {"@type": ["Divider", SCN["Wall"]], **_hole_list(id, feature.holes)}
        return self._named(node, feature.name)

    def _opening_node(self, opening: Opening) -> Json:
        id = self.ids[opening.kind, opening.id]
        node = {"@id": id, "@type": opening.kind.capitalize(), **_shapes(id)}
        node |= {"thickness": opening.depth, "unit": "M"}
        node["voids"] = [self.ids["wall", wall] for wall in opening.walls]
        if not opening.walls:
            node["@type"] = [node["@type"], SCN["Gap"]]
        return self._named(node, opening.name)


def plan_documents(plan: FloorPlan) -> dict[str, Json]:
    """Return the six published files of a plan by name, without ``.json``."""
    writer = PlanWriter(plan)
    return {
        name: {"@context": plan_context(writer.base, FILES[name]), "@graph": writer.files[name]}
        for name in FILES
    }


def _walls(space: Space, ring: Ring) -> list[tuple[Pose2, Ring]]:
    """Return the pose of every wall in the space, and its footprint in its own frame.

    Walls that the outline implies get the numbers of the outline: both faces exactly level, the
    inner one at y = 0. Only plans published by others have different walls.
    """
    # The published mesh generator thickens an opening by moving corners with y == 0 one way and all
    # others the other way: a corner at 1e-17 would move with the others.
    if implied_space(space, ring) is None:
        return [
            (
                space.frame.inverse() @ wall.frame,
                _level(wall.frame.inverse().apply_ring(wall.footprint)),
            )
            for wall in space.walls
        ]
    thickness = space.walls[0].thickness
    outer = outer_corners(ring, thickness)
    walls: list[tuple[Pose2, Ring]] = []
    for wall, pose, ends in zip(
        space.walls, wall_frames(ring), zip(outer, outer[1:] + outer[:1], strict=True), strict=True
    ):
        start, end = pose.inverse().apply_ring(ends)
        half = wall.length / 2
        level: Ring = ((start[0], thickness), (end[0], thickness), (half, 0.0), (-half, 0.0))
        walls.append((pose, level))
    return walls


def _level(ring: Ring) -> Ring:
    """Return a ring with y = 0 exactly for corners on the x axis."""
    return tuple((x, y if abs(y) > _SAME else 0.0) for x, y in ring)


def _shapes(id: str) -> Json:
    return {"shape": f"{id}-polygon", "3d-shape": f"{id}-polyhedron"}


def _hole_list(id: str, holes: Sequence[Ring]) -> Json:
    polygons = [{"@id": f"{id}-hole-{number}-polygon"} for number in range(len(holes))]
    return {SCN["holes"]: {"@list": polygons}} if polygons else {}


def flat(points: Iterable[Point3]) -> Ring:
    """Return points without their height."""
    return tuple((x, y) for x, y, _ in points)


def _level_ring(ring: Ring, height: float) -> tuple[Point3, ...]:
    return tuple((x, y, height) for x, y in ring)


def _prism(ring: Ring, height: float) -> tuple[Point3, ...]:
    return _level_ring(ring, 0.0) + _level_ring(ring, height)


def _untilted(opening: Opening) -> tuple[Point3, ...]:
    """Return the near ring in the opening's own frame, neither lifted nor tilted."""
    to_local = opening.frame.inverse()
    c, s = math.cos(opening.tilt), math.sin(opening.tilt)
    corners = []
    for px, py, pz in opening.near:
        x, y = to_local.apply((px, py))
        z = pz - opening.z
        corners.append((c * x - s * z, y if abs(y) > _SAME else 0.0, s * x + c * z))
    return tuple(corners)
