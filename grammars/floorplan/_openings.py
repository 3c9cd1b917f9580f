"""Openings: prisms cut through one or two walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from grammars.diagnostics import Where
from grammars.floorplan._location import Location
from grammars.floorplan._placement import Draft, find_space, find_wall
from grammars.floorplan._shapes import wall_outline
from grammars.floorplan._source import Findings, Node
from grammars.floorplan._values import Quantities
from grammars.floorplan.model import Opening, Placement, Point3, Wall
from grammars.values import Pose2


@dataclass(frozen=True, slots=True)
class OpeningDraft:
    """An opening before its walls are placed; ``walls`` are (space name, wall index)."""

    node: Node
    ring: tuple[Point3, ...]
    location: Location
    walls: tuple[tuple[str, int], ...]


def draft_opening(
    node: Node,
    location: Location | None,
    spaces: dict[str, Draft],
    quantities: Quantities,
    findings: Findings,
) -> OpeningDraft | None:
    """Read an opening, or return ``None`` after reporting what is wrong with it."""
    ring = wall_outline(node.shape, quantities, findings)
    if location is None:
        return None
    references = location.parts["in"].walls
    walls = [_find(reference, spaces, findings) for reference in references]
    known = tuple(wall for wall in walls if wall is not None)
    if len(references) > 2:
        findings.error(references[2], "an opening cuts one or two walls", "make a second opening")
    elif len(known) == 2 and known[0] == known[1]:
        findings.error(references[1], "an opening cannot cut the same wall twice")
    elif ring is not None and len(known) == len(references):
        return OpeningDraft(node, ring, location, known)
    return None


def _find(reference: Node, spaces: dict[str, Draft], findings: Findings) -> tuple[str, int] | None:
    if reference.name == "this":
        findings.error(
            reference, '"this" has no meaning in an opening', "name the space: in: hall.walls[0]"
        )
        return None
    space = find_space(reference, spaces, findings)
    if space is None:
        return None
    if not reference.index:
        findings.error(
            reference,
            f'an opening cuts walls, but "{reference.name}" is a space',
            f"write {reference.name}.walls[0]",
        )
        return None
    good, index = find_wall(reference, space, findings)
    return (space.name, index) if good and index is not None else None


def build_opening(draft: OpeningDraft, walls: tuple[Wall, ...], findings: Findings) -> Opening:
    """Return the opening in the world frame; ``walls`` are those it cuts, in order.

    ``World(opening) = World(first wall) . Translate(x, 0, z) . Ry(tilt)``; the far ring has the
    same x and z with y replaced by the depth, the summed thickness of the walls.
    """
    location = draft.location
    kind: Literal["entryway", "window"] = "entryway" if draft.node.kind == "Entryway" else "window"
    offset = Pose2(location.get("translation.x"), 0.0, 0.0)
    return opening_at(
        kind,
        draft.node.name,
        tuple(wall.id for wall in walls),
        walls[0].frame @ offset,
        Prism(
            draft.ring,
            sum(wall.thickness for wall in walls),
            location.get("translation.z"),
            location.get("rotation.y"),
        ),
        findings.source.at(draft.node),
        Placement(f"{kind}-{draft.node.name}-frame", f"{walls[0].id}-frame", offset, draft.ring),
    )


@dataclass(frozen=True, slots=True)
class Prism:
    """The cut of an opening: near ring in its own frame, depth, height and tilt of that frame."""

    ring: tuple[Point3, ...]
    depth: float
    z: float
    tilt: float


def opening_at(
    kind: Literal["entryway", "window"],
    name: str,
    walls: tuple[str, ...],
    frame: Pose2,
    prism: Prism,
    where: Where,
    placement: Placement | None = None,
) -> Opening:
    """Return the opening that a prism cuts at ``frame`` (on the floor) through ``walls``."""
    z, tilt, depth = prism.z, prism.tilt, prism.depth
    c, s = math.cos(tilt), math.sin(tilt)
    turned = [(c * px + s * pz, py, c * pz - s * px) for px, py, pz in prism.ring]
    low, high = min(p[0] for p in turned), max(p[0] for p in turned)
    near_y = min(p[1] for p in turned)
    return Opening(
        kind=kind,
        id=name,
        name=name,
        walls=walls,
        frame=frame,
        z=z,
        tilt=tilt,
        depth=depth,
        near=tuple((*frame.apply((px, py)), z + pz) for px, py, pz in turned),
        far=tuple((*frame.apply((px, depth)), z + pz) for px, _, pz in turned),
        footprint=frame.apply_ring(((low, depth), (high, depth), (high, near_y), (low, near_y))),
        where=where,
        placement=placement,
    )
