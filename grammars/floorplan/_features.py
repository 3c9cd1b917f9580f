"""Columns and dividers on the floor, entryways and windows cut through one or two walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from grammars.floorplan._attributes import Location, read_location
from grammars.floorplan._shapes import floor_outline, wall_outline
from grammars.floorplan._spaces import PlanReader, SpaceDraft, frame_id
from grammars.floorplan.model import Feature, Opening, Placement, Point3, Wall
from grammars.model.geometry import Pose2, Ring
from grammars.text.diagnostics import SyntaxNode, Where


@dataclass(frozen=True, slots=True)
class FeatureDraft:
    """Feature before its space is placed; ``against`` is a space, ``wall`` one of its walls."""

    node: SyntaxNode
    owner: SpaceDraft | None
    ring: Ring
    height: float
    location: Location
    against: SpaceDraft
    wall: int | None


def draft_feature(
    node: SyntaxNode, owner: SpaceDraft | None, reader: PlanReader
) -> FeatureDraft | None:
    """Return a feature of ``owner`` (``None``: the plan), or ``None`` without a reference.

    Raises :class:`InputError` for an invalid reference.
    """
    ring = floor_outline(node.shape, reader)
    height = reader.length(node.height)
    if height <= 0.0:
        reader.warning(
            node.height, f'{node.kind.lower()} "{node.name}" has no height ({height:g} m)'
        )
    location = read_location(node, node.kind.lower(), reader)
    if "wrt" not in location:
        return None
    reference = location.parts["wrt"].frame
    against = _reference_space(reference, owner, reader)
    wall = reader.wall(reference, against)
    return FeatureDraft(node, owner, ring, height, location, against, wall)


def _reference_space(
    reference: SyntaxNode, owner: SpaceDraft | None, reader: PlanReader
) -> SpaceDraft:
    if reference.name == "this":
        if owner is None:
            hint = 'name the space: "wrt: hall", or write the feature into its "features:"'
            raise reader.refusal(reference, '"this" has no meaning outside a space', hint)
        return owner
    # A space may be called world; then the reference means this space.
    if reference.name == "world" and "world" not in reader.spaces:
        message = "features belong in a space, not in the world"
        raise reader.refusal(reference, message, 'write "wrt: hall"')
    return reader.space(reference)


def build_feature(
    draft: FeatureDraft, world: dict[str, Pose2], unique: bool, reader: PlanReader
) -> Feature:
    """Return the feature in the world frame: ``World(wrt) . T(x, y, yaw)``."""
    location = draft.location
    offset = Pose2(
        location.get("translation.x"), location.get("translation.y"), location.get("rotation.z")
    )
    frame = world[draft.against.name] @ draft.against.frame(draft.wall) @ offset
    name = draft.node.name
    space = "" if draft.owner is None else draft.owner.name
    scoped = name if unique or not space else f"{space}-{name}"
    where = reader.where(draft.node)
    if scoped != name:
        reader.warning(
            where, f'the name "{name}" is used in several spaces', f'it is published as "{scoped}"'
        )
    kind: Literal["column", "divider"] = "column" if draft.node.kind == "Column" else "divider"
    return Feature(
        kind=kind,
        id=scoped,
        name=name,
        space=space,
        frame=frame,
        footprint=frame.apply_ring(draft.ring),
        height=draft.height,
        where=where,
        placement=Placement(
            f"{kind}-{scoped}-frame",
            frame_id(draft.against.name, draft.wall),
            offset,
            tuple((x, y, 0.0) for x, y in draft.ring),
        ),
    )


@dataclass(frozen=True, slots=True)
class OpeningDraft:
    """Opening before its walls are placed; ``walls`` are (space name, wall index)."""

    node: SyntaxNode
    ring: tuple[Point3, ...]
    location: Location
    walls: tuple[tuple[str, int], ...]


def draft_opening(node: SyntaxNode, location: Location, reader: PlanReader) -> OpeningDraft | None:
    """Return an opening, or ``None`` after an error."""
    ring = wall_outline(node.shape, reader)
    if "in" not in location:
        return None
    references = location.parts["in"].walls
    walls: list[tuple[str, int]] = []
    for reference in references:
        with reader.collecting():
            walls.append(_cut_wall(reference, reader))
    if len(references) > 2:
        reader.error(references[2], "an opening cuts one or two walls", "make a second opening")
    elif len(walls) == 2 and walls[0] == walls[1]:
        reader.error(references[1], "an opening cannot cut the same wall twice")
    elif len(walls) == len(references):
        return OpeningDraft(node, ring, location, tuple(walls))
    return None


def _cut_wall(reference: SyntaxNode, reader: PlanReader) -> tuple[str, int]:
    if reference.name == "this":
        hint = "name the space: in: hall.walls[0]"
        raise reader.refusal(reference, '"this" has no meaning in an opening', hint)
    space = reader.space(reference)
    if not reference.index:
        message = f'an opening cuts walls, but "{reference.name}" is a space'
        raise reader.refusal(reference, message, f"write {reference.name}.walls[0]")
    return space.name, reader.wall_index(reference, space)


def build_opening(draft: OpeningDraft, walls: tuple[Wall, ...], reader: PlanReader) -> Opening:
    """Return the opening in the world frame; it cuts ``walls`` in this order.

    ``World(opening) = World(first wall) . Translate(x, 0, z) . Ry(tilt)``. The far ring has the
    same x and z; its y is the depth, the total thickness of the walls.
    """
    location = draft.location
    kind: Literal["entryway", "window"] = "entryway" if draft.node.kind == "Entryway" else "window"
    offset = Pose2(location.get("translation.x"), 0.0, 0.0)
    return opening_at(
        kind,
        draft.node.name,
        tuple(wall.id for wall in walls),
        walls[0].frame @ offset,
        reader.where(draft.node),
        Placement(f"{kind}-{draft.node.name}-frame", f"{walls[0].id}-frame", offset, draft.ring),
        ring=draft.ring,
        depth=sum(wall.thickness for wall in walls),
        z=location.get("translation.z"),
        tilt=location.get("rotation.y"),
    )


def opening_at(
    kind: Literal["entryway", "window"],
    name: str,
    walls: tuple[str, ...],
    frame: Pose2,
    where: Where,
    placement: Placement | None = None,
    *,
    ring: tuple[Point3, ...],
    depth: float,
    z: float,
    tilt: float = 0.0,
) -> Opening:
    """Return the opening that a prism cuts at ``frame`` (on the floor) through ``walls``.

    ``ring`` is the near ring of the prism in its own frame, which stands at ``z`` and is tilted.
    """
    c, s = math.cos(tilt), math.sin(tilt)
    # Ry(tilt) of the ring, which lies in the x-z plane of the opening (y only where a polygon
    # leans).
    turned = [(c * px + s * pz, py, c * pz - s * px) for px, py, pz in ring]
    low, high = min(p[0] for p in turned), max(p[0] for p in turned)
    # A polygon may lean out of the face of its wall; the footprint begins at its nearest point.
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
