"""Geometry that has a meaning, though probably not the intended one: warnings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from grammars.floorplan._placement import Draft
from grammars.floorplan._shapes import signed_area
from grammars.floorplan._source import Findings
from grammars.floorplan.model import FloorPlan, Opening, Wall

_TOUCHING: Final = 1e-3
"""How far walls may be apart and still touch, or openings stick out [m]."""
_OVERLAP: Final = 1e-2
"""Area two rooms may share before it is worth a word [m²]."""


def check_geometry(plan: FloorPlan, drafts: Sequence[Draft], findings: Findings) -> None:
    """Warn of rooms, openings and features that are placed suspiciously."""
    _check_winding(drafts, findings)
    _check_gaps(drafts, findings)
    walls = {wall.id: wall for wall in plan.walls}
    for opening in plan.openings:
        _check_opening(opening, [walls[name] for name in opening.walls], findings)
    _check_floor(plan, findings)


def _check_winding(drafts: Sequence[Draft], findings: Findings) -> None:
    for draft in drafts:
        if draft.ring is not None and signed_area(draft.ring) > 0.0:
            findings.warn(
                draft.node.shape,
                f'the outline of "{draft.name}" runs counter-clockwise: its walls grow inwards',
                "list the points clockwise",
            )


def _check_gaps(drafts: Sequence[Draft], findings: Findings) -> None:
    """Warn of facing walls that overlap because the gap is smaller than both together."""
    for draft in drafts:
        location, other = draft.location, draft.against
        if location is None or other is None or draft.own is None or draft.other is None:
            continue
        if "spaced" in location or "not aligned" in location or location.get("rotation.z"):
            continue
        gap = location.get("translation.y")
        needed = (draft.thickness or 0.0) + (other.thickness or 0.0)
        if gap < needed - 1e-9:
            findings.warn(
                draft.node,
                f'the facing walls of "{draft.name}" and "{other.name}" overlap: '
                f"{gap:g} m apart, {needed:g} m thick together",
                'write "spaced" to make them touch',
            )


def _check_opening(opening: Opening, walls: Sequence[Wall], findings: Findings) -> None:
    label = f'{opening.kind} "{opening.name}"'
    corners = [(p[0], p[1]) for p in opening.near]
    for wall in walls:
        along = [wall.frame.inverse().apply(corner)[0] for corner in corners]
        if max(map(abs, along)) > wall.length / 2 + _TOUCHING:
            findings.warn(
                opening.where,
                f"{label} reaches beyond the end of {wall.id}",
                f"the wall reaches from x = {-wall.length / 2:g} m to {wall.length / 2:g} m",
            )
        if opening.z_max > wall.height + _TOUCHING:
            findings.warn(
                opening.where, f"{label} reaches above {wall.id} ({wall.height:g} m high)"
            )
    if opening.z_min < -_TOUCHING:
        findings.warn(
            opening.where,
            f"{label} reaches below the floor (z = {opening.z_min:g} m)",
            "z is the height of its middle: half its height for a door",
        )
    if len(walls) == 2:
        _check_pair(opening, walls[0], walls[1], findings)


def _check_pair(opening: Opening, first: Wall, second: Wall, findings: Findings) -> None:
    relative = first.frame.inverse() @ second.frame
    label = f'{opening.kind} "{opening.name}": {first.id} and {second.id}'
    if math.cos(relative.yaw) > -1.0 + 1e-6:
        findings.warn(opening.where, f"{label} do not face each other")
    elif abs(relative.y - opening.depth) > _TOUCHING:
        findings.warn(
            opening.where,
            f"{label} do not touch: {relative.y:.3f} m between their inner faces, "
            f"{opening.depth:.3f} m thick together",
        )


def _check_floor(plan: FloorPlan, findings: Findings) -> None:
    """Warn of rooms that share floor and of features outside their space."""
    import shapely

    outlines = [shapely.Polygon(space.outline) for space in plan.spaces]
    tree = shapely.STRtree(outlines)
    first, second = tree.query(outlines, predicate="intersects")
    for a, b in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        if a < b:
            area = outlines[a].intersection(outlines[b]).area
            if area > _OVERLAP:
                findings.warn(
                    plan.spaces[b].where,
                    f'"{plan.spaces[b].name}" and "{plan.spaces[a].name}" overlap ({area:.2f} m²)',
                )
    by_name = {space.name: outline for space, outline in zip(plan.spaces, outlines, strict=True)}
    for feature in plan.features:
        if feature.space and not by_name[feature.space].intersects(
            shapely.Polygon(feature.footprint)
        ):
            findings.warn(
                feature.where, f'{feature.kind} "{feature.name}" stands outside "{feature.space}"'
            )
