"""Reader of a :class:`FloorPlan` from nodes in the published vocabulary, of any writer."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, Literal

from grammars.floorplan import (
    WORLD_FRAME,
    Feature,
    FloorPlan,
    Opening,
    Placement,
    Point3,
    Space,
    Wall,
    geometric_flaws,
    opening_at,
    warn_of,
)
from grammars.jsonld._kinematics import LENGTHS, PlacedFrame, PoseGraph, Positions, scaled
from grammars.jsonld._nodes import Node, NodeGraph, Ref
from grammars.jsonld._plan_writer import flat, implied_space, is_polygon
from grammars.jsonld.vocabulary import FP, GEOM, OBJ, POLY, SCN, local_name, namespace_of
from grammars.model.geometry import Ring
from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    Where,
    did_you_mean,
)

_LARGEST: Final = 1e6
# For other tools, one of our free walls is also a divider.
_FEATURES: Final[dict[str, Literal["column", "divider", "wall"]]] = {
    SCN["Wall"]: "wall",
    FP["Column"]: "column",
    FP["Divider"]: "divider",
}


def read_plan(nodes: NodeGraph, file: str = "") -> FloorPlan:
    """Return the floor plan in ``nodes``.

    Raises :class:`InputError` with all errors. The plan's warnings name outdated and incomplete
    parts.
    """
    return _PlanReader(nodes, file).read()


class _PlanReader:
    def __init__(self, nodes: NodeGraph, file: str) -> None:
        self.nodes = nodes
        self.file = file
        self.names: dict[str, str] = {}
        self.walls: dict[str, Wall] = {}
        self.placed: dict[str, PlacedFrame] = {}
        self.positions = Positions(nodes)
        self.outlines: dict[str, tuple[str, tuple[Point3, ...]]] = {}

    def read(self) -> FloorPlan:
        root = self._root()
        self.placed = PoseGraph(self.nodes).reach(self._world(root))
        spaces = [self._space(node) for node in self._listed(root, FP["spaces"])]
        if "" in self.outlines or not _name(root):
            self.nodes.add_error(root.id, "the plan or a space has no name: its IRI ends with /")
        if len(self.outlines) < sum(space is not None for space in spaces):
            self.nodes.add_error(root.id, "two spaces have the same name")
        self.nodes.raise_errors()
        features = self._features(root)
        openings = [
            self._opening(node)
            for kind in ("Entryway", "Window")
            for node in self.nodes.of_type(FP[kind])
        ]
        self.nodes.raise_errors()
        # A plan need not list its openings: the list only gives their order.
        listed = {str(iri): k for k, iri in enumerate(root.refs(FP["openings"]))}
        readable = [o for o in openings if o is not None]
        readable.sort(key=lambda pair: listed.get(pair[0], len(listed)))
        plan = FloorPlan(
            _name(root),
            tuple(
                # A space may be placed against a later one, so placements need all names.
                replace(space, placement=self._placement(*self.outlines[space.name]))
                for space in spaces
                if space is not None
            ),
            features,
            tuple(opening for _, opening in readable),
        )
        findings = Findings()
        warn_of(geometric_flaws(plan), findings)
        return replace(plan, warnings=(*self.nodes.findings, *findings.warnings))

    def _root(self) -> Node:
        plans = self.nodes.of_type(FP["FloorPlan"])
        if len(plans) == 1:
            return plans[0]
        if plans:
            names = " and ".join(local_name(plan.id) for plan in plans)
            self.nodes.add_error(plans[1].id, f"there are several floor plans: {names}")
        else:
            hint = "one node has the type FloorPlan and lists the spaces"
            where = Where(self.file or "<graph>", 1, 1)
            self.nodes.findings.append(Finding(where, "there is no floor plan in it", hint))
        raise InputError(self.nodes.errors)

    def _world(self, root: Node) -> str:
        """Return the world frame: a ``WorldFrame`` of 2023, or the frame of that name."""
        for node in self.nodes.of_type(OBJ["WorldFrame"]):
            frame = node.ref(OBJ["frame"])
            if frame is not None:
                self.names[frame] = WORLD_FRAME
                return frame
        world = namespace_of(root.id) + WORLD_FRAME
        frames = [node.id for node in self.nodes.of_type(GEOM["Frame"])]
        if world not in self.nodes.by_id:
            # Plans of 2023 have separate namespaces for frames and elements.
            called = [id for id in frames if local_name(id) == WORLD_FRAME]
            if len(called) != 1:
                near = map(local_name, frames)
                hint = did_you_mean(local_name(world), near) if frames else ""
                message = f"there is no frame <{world}> to start from"
                self.nodes.add_error(root.id, message, hint)
                raise InputError(self.nodes.errors)
            world = called[0]
        self.names[world] = WORLD_FRAME
        return world

    def _listed(self, owner: Node, predicate: str) -> list[Node]:
        return [self.nodes.by_id[id] for id in owner.refs(predicate)]

    def _outline(self, node: Node, predicate: str) -> tuple[str, tuple[Point3, ...]] | None:
        """Return the frame of an element's shape, and the corners in it."""
        shape = self.nodes.by_id.get(node.ref(predicate) or "")
        points = shape.refs(POLY["points"]) if shape else []
        label = f"the {'body' if predicate == FP['3d-shape'] else 'shape'} of {local_name(node.id)}"
        if len(points) < 3:
            self.nodes.add_error(node.id, f"{label} has no points", "list at least three of them")
            return None
        outline = self.positions.outline(points)
        if outline is None:
            self.nodes.add_error(
                node.id, f"{label} is not drawn in one frame", "give every position"
            )
            return None
        if max(abs(v) for point in outline[1] for v in point) > _LARGEST:
            self.nodes.add_error(node.id, f"{label} is larger than 1000 km")
            return None
        return outline

    def _frame(self, node: Node, frame: str, name: str) -> PlacedFrame | None:
        placed = self.placed.get(frame)
        if placed is None:
            self.nodes.add_error(
                node.id,
                f"{local_name(node.id)} is not connected to the world: no chain of poses leads "
                f"from {local_name(frame)} to {WORLD_FRAME}",
            )
            return None
        self.names.setdefault(frame, name)
        return placed

    def _space(self, node: Node) -> Space | None:
        name = _name(node)
        outline = self._outline(node, FP["shape"])
        placed = self._frame(node, outline[0], f"{name}-frame") if outline else None
        walls = self._listed(node, FP["walls"])
        bodies = [self._wall(wall, name, k) for k, wall in enumerate(walls)]
        solid = [body for body in bodies if body is not None]
        if outline is None or placed is None or len(solid) < len(bodies):
            return None
        ring: Ring = flat(outline[1])
        if not is_polygon(ring):
            self.nodes.add_error(node.id, f"the shape of {local_name(node.id)} has no area")
            return None
        space = self._made(node, name, placed, ring, solid)
        if SCN["Area"] in node.types:
            space = replace(space, holes=self._holes(node, placed))
        for wall_node, wall in zip(walls, space.walls, strict=True):
            self.walls[wall_node.id] = wall
        self.outlines[name] = outline
        return space

    def _holes(self, node: Node, placed: PlacedFrame) -> tuple[Ring, ...]:
        """Return the holes of a space or wall of a walls layer, in the world."""
        holes = []
        for id in node.refs(SCN["holes"]):
            hole = self.nodes.by_id.get(id)
            outline = self.positions.outline(hole.refs(POLY["points"])) if hole else None
            if outline is None or len(outline[1]) < 3:
                message = f"hole {local_name(id)} of {local_name(node.id)} is not a polygon"
                self.nodes.add_error(node.id, message, "list its points and give every position")
                continue
            holes.append(placed.pose.apply_ring(flat(outline[1])))
        return tuple(holes)

    def _wall(self, node: Node, space: str, index: int) -> Wall | None:
        outline = self._outline(node, FP["shape"])
        placed = self._frame(node, outline[0], f"{space}-wall-{index}-frame") if outline else None
        thickness = scaled(node, FP["thickness"], LENGTHS)
        height = scaled(node, FP["height"], LENGTHS)
        # The SHACL shapes guarantee both numbers.
        if outline is None or placed is None or thickness is None or height is None:
            return None
        if len(outline[1]) != 4:
            self.nodes.add_error(
                node.id, f"the shape of wall {local_name(node.id)} does not have 4 corners"
            )
            return None
        local = flat(outline[1])
        footprint = placed.pose.apply_ring(local)
        length = math.dist(footprint[2], footprint[3])
        return Wall(space, index, placed.pose, length, thickness, height, footprint)

    def _made(
        self, node: Node, name: str, placed: PlacedFrame, ring: Ring, walls: list[Wall]
    ) -> Space:
        """Return the space that the outline implies, or the published one if it differs."""
        where = self.nodes.where(node.id, Where(self.file, 1, 1))
        published = Space(name, placed.pose, placed.pose.apply_ring(ring), tuple(walls), where)
        return implied_space(published, ring) or published

    def _placement(self, frame: str, outline: tuple[Point3, ...]) -> Placement | None:
        """Return the placement of a frame in names of frames, if both names are known."""
        placed = self.placed[frame]
        of = frame
        if placed.edge is not None and placed.edge.wrt == frame:
            # The space is placed by one of its own walls.
            of = placed.parent
            placed = self.placed[of]
        names = (self.names.get(of), self.names.get(placed.parent))
        if names[0] is None or names[1] is None:
            return None
        return Placement(names[0], names[1], placed.offset, outline)

    def _features(self, root: Node) -> tuple[Feature, ...]:
        owners = [(node, _name(node)) for node in self._listed(root, FP["spaces"])]
        features: dict[str, Feature] = {}
        for owner, space in (*owners, (root, "")):
            for id in owner.refs(FP["features"]):
                self._feature(id, owner, space, features)
        for kind in ("Column", "Divider"):
            for node in self.nodes.of_type(FP[kind]):
                if node.id not in features:
                    message = f"{kind.lower()} {local_name(node.id)} is in no space's features"
                    self.nodes.add_warning(node.id, message, "it is read as a feature of the plan")
                    self._feature(node.id, root, "", features)
        order = {str(id): k for k, id in enumerate(root.refs(SCN["order"]))}
        ids = sorted(features, key=lambda id: order.get(id, len(order)))
        return tuple(features[id] for id in ids)

    def _feature(
        self, id: Ref | str, owner: Node, space: str, features: dict[str, Feature]
    ) -> None:
        node = self.nodes.by_id.get(id)
        types = node.types if node is not None else []
        kind = next((kind for type, kind in _FEATURES.items() if type in types), None)
        if node is None or kind is None:
            message = f"{local_name(owner.id)} lists {local_name(id)}, not a column or divider"
            self.nodes.add_error(owner.id, message)
            return
        height, outline = scaled(node, FP["height"], LENGTHS), self._outline(node, FP["shape"])
        if node.id in features:
            message = (
                f'{kind} {local_name(id)} is listed by "{features[node.id].space}" and "{space}"'
            )
            self.nodes.add_error(node.id, message, "give each its own identifier: <space>-<name>")
            return
        local = local_name(id)
        # Our writer renamed it, because another element has its name.
        if node.text(SCN["name"]) is not None:
            local = local.removeprefix(f"{kind}-")
        placed = self._frame(node, outline[0], f"{kind}-{local}-frame") if outline else None
        if outline is None or height is None or placed is None:
            return
        name = node.text(SCN["name"]) or (local.removeprefix(f"{space}-") if space else local)
        where = self.nodes.where(node.id, Where(self.file, 1, 1))
        ring = placed.pose.apply_ring(flat(outline[1]))
        features[node.id] = Feature(
            kind,
            local,
            name,
            space,
            placed.pose,
            ring,
            height,
            where,
            self._placement(outline[0], outline[1]),
            self._holes(node, placed),
        )

    def _opening(self, node: Node) -> tuple[str, Opening] | None:
        kind: Literal["entryway", "window"] = (
            "entryway" if FP["Entryway"] in node.types else "window"
        )
        near, body = self._outline(node, FP["shape"]), self._outline(node, FP["3d-shape"])
        voids = [(id, self.walls.get(id)) for id in dict.fromkeys(node.refs(FP["voids"]))]
        for id, wall in voids:
            if wall is None:
                message = f"{kind} {local_name(node.id)} voids {local_name(id)}, not a wall"
                hint = did_you_mean(local_name(id), map(local_name, self.walls))
                self.nodes.add_error(node.id, message, hint)
        name = _name(node)
        placed = self._frame(node, near[0], f"{kind}-{name}-frame") if near else None
        walls = tuple(wall.id for _, wall in voids if wall is not None)
        if near is None or body is None or placed is None or len(walls) < len(voids):
            return None
        depth = scaled(node, FP["thickness"], LENGTHS)
        if depth is None:
            depth = max(point[1] for point in body[1])
        opening = opening_at(
            kind,
            name,
            walls,
            placed.pose,
            self.nodes.where(node.id, Where(self.file, 1, 1)),
            self._placement(*near),
            ring=near[1],
            depth=depth,
            z=placed.z,
            tilt=placed.tilt,
        )
        return node.id, opening


def _name(node: Node) -> str:
    """Return the name of an element, which may differ from its identifier."""
    return node.text(SCN["name"]) or local_name(node.id)
