"""Features: columns and dividers standing on the floor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from grammars.floorplan._location import Location, read_location
from grammars.floorplan._placement import Draft, find_space, find_wall, frame_id
from grammars.floorplan._shapes import floor_outline
from grammars.floorplan._source import Findings, Node
from grammars.floorplan._values import Quantities
from grammars.floorplan.model import Feature, Placement
from grammars.values import Pose2, Ring


@dataclass(frozen=True, slots=True)
class FeatureDraft:
    """A feature before its space is placed; ``against`` is a space, ``wall`` one of its walls."""

    node: Node
    owner: Draft | None
    ring: Ring
    height: float
    location: Location
    against: Draft
    wall: int | None


def draft_feature(
    node: Node,
    owner: Draft | None,
    spaces: dict[str, Draft],
    quantities: Quantities,
    findings: Findings,
) -> FeatureDraft | None:
    """Read a feature of ``owner`` (none: of the plan), or return ``None`` after reporting."""
    ring = floor_outline(node.shape, quantities, findings)
    height = quantities.length(node.height)
    if height is not None and height <= 0.0:
        findings.warn(
            node.height, f'{node.kind.lower()} "{node.name}" has no height ({height:g} m)'
        )
    location = read_location(node, node.kind.lower(), quantities, findings)
    if location is None:
        return None
    reference = location.parts["wrt"].frame
    against = _find(reference, owner, spaces, findings)
    if against is None:
        return None
    good, wall = find_wall(reference, against, findings)
    if ring is None or height is None or not good:
        return None
    return FeatureDraft(node, owner, ring, height, location, against, wall)


def _find(
    reference: Node, owner: Draft | None, spaces: dict[str, Draft], findings: Findings
) -> Draft | None:
    if reference.name == "this":
        if owner is None:
            findings.error(
                reference,
                '"this" has no meaning outside a space',
                'name the space: "wrt: hall", or write the feature into its "features:"',
            )
        return owner
    if reference.name == "world" and "world" not in spaces:
        findings.error(
            reference, "features stand in a space, not in the world", 'write "wrt: hall"'
        )
        return None
    return find_space(reference, spaces, findings)


def build_feature(
    draft: FeatureDraft, world: dict[str, Pose2], unique: bool, findings: Findings
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
    where = findings.source.at(draft.node)
    if scoped != name:
        findings.warn(
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
