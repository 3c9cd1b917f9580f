"""Compiler from the syntax tree of a plan to world geometry: names, values, placement.

The last step warns of valid geometry that is probably not intended.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from grammars.floorplan._attributes import ElementReader, read_location
from grammars.floorplan._features import (
    FeatureDraft,
    OpeningDraft,
    build_feature,
    build_opening,
    draft_feature,
    draft_opening,
)
from grammars.floorplan._geometry import geometric_flaws, warn_of
from grammars.floorplan._shapes import floor_outline
from grammars.floorplan._spaces import (
    PlanReader,
    SpaceDraft,
    build_space,
    check_anchored,
    place_all,
    resolve_placement,
)
from grammars.floorplan.model import FloorPlan
from grammars.model.geometry import signed_area
from grammars.text.diagnostics import (
    Findings,
    SourceText,
    SyntaxNode,
)


def compile_plan(
    tree: SyntaxNode, source: SourceText, values: Mapping[str, float] | None = None
) -> FloorPlan:
    """Return the plan of a syntax tree; ``values`` [m or rad] replace those of its variables.

    Raises ``InputError`` with all errors.
    """
    reader = PlanReader(source)
    # Each step refers only to earlier ones. No error ends the compilation early: people get all
    # errors of a plan at once. Only an error-free plan is built.
    _check_order(tree, reader)
    reader.define(tree.variables, values or {})
    dimensions = _dimensions(tree.defaults, reader)
    drafts = [_draft_space(node, dimensions, reader) for node in tree.spaces]
    for draft in drafts:
        reader.spaces.setdefault(draft.name, draft)
    _check_names([draft.node for draft in drafts], "space", reader)
    for draft in drafts:
        resolve_placement(draft, reader)
    check_anchored(drafts, reader)
    features = _draft_features(tree.features, drafts, reader)
    openings = _draft_openings(tree.openings, reader)
    if not drafts and not reader.errors:
        reader.error(tree, f'plan "{tree.name}" has no spaces', 'add one: "Space room: …"')
    reader.raise_errors()
    return _build(tree.name, drafts, features, openings, reader)


def _check_order(tree: SyntaxNode, reader: ElementReader) -> None:
    """Check that Defaults come first, once, then variables, then elements."""
    elements = (*tree.spaces, *tree.features, *tree.openings)
    ranked = [
        (node._tx_position, rank, node)
        for rank, nodes in enumerate((tree.defaults, tree.variables, elements))
        for node in nodes
    ]
    reached = 0
    for _, rank, node in sorted(ranked, key=lambda entry: entry[0]):
        if rank == 0 and node is not tree.defaults[0]:
            reader.error(node, '"Defaults:" is given twice')
        elif rank < reached:
            label = '"Defaults:"' if rank == 0 else f'variable "{node.name}"'
            reader.error(
                node, f"{label} comes too late", "first Defaults, then variables, then elements"
            )
        reached = max(reached, rank)


def _dimensions(nodes: Sequence[SyntaxNode], reader: ElementReader) -> dict[str, float]:
    """Return the wall thickness and height [m] written in ``walls:`` blocks."""
    values: dict[str, float] = {}
    for node in nodes:
        for dimension in node.dimensions:
            value = reader.length(dimension.value)
            if dimension.key in values:
                reader.error(dimension, f'"{dimension.key}" is given twice')
            elif value <= 0.0:
                reader.warning(dimension, f"a wall {dimension.key} of {value:g} m makes no wall")
            values[dimension.key] = value
    return values


def _draft_space(node: SyntaxNode, defaults: dict[str, float], reader: ElementReader) -> SpaceDraft:
    sizes = defaults | _dimensions([node], reader)
    missing = [key for key in ("thickness", "height") if key not in sizes]
    if missing:
        reader.error(
            node,
            f'space "{node.name}" has no wall {" and ".join(missing)}',
            'give it in "walls:" of the space or of Defaults',
        )
    if node.name in ("this", "world"):
        reader.warning(node, f'a space called "{node.name}" cannot be referred to by its name')
    ring = floor_outline(node.shape, reader)
    location = read_location(node, "space", reader)
    thickness, height = sizes.get("thickness", math.nan), sizes.get("height", math.nan)
    return SpaceDraft(node, node.name, ring, thickness, height, location)


def _check_names(nodes: Sequence[SyntaxNode], kind: str, reader: ElementReader) -> None:
    first: dict[str, SyntaxNode] = {}
    for node in nodes:
        if node.name in first:
            line = reader.where(first[node.name]).line
            reader.error(node, f'{kind} "{node.name}" is already defined in line {line}')
        first.setdefault(node.name, node)


def _draft_features(
    top_level: Sequence[SyntaxNode], drafts: Sequence[SpaceDraft], reader: PlanReader
) -> list[FeatureDraft]:
    groups: list[tuple[SpaceDraft | None, Sequence[SyntaxNode]]] = [
        *((draft, draft.node.features) for draft in drafts),
        (None, top_level),
    ]
    features: list[FeatureDraft] = []
    for owner, nodes in groups:
        _check_names(nodes, "feature", reader)
        for node in nodes:
            with reader.collecting():
                if feature := draft_feature(node, owner, reader):
                    features.append(feature)
    return sorted(features, key=lambda feature: feature.node._tx_position)


def _draft_openings(nodes: Sequence[SyntaxNode], reader: PlanReader) -> list[OpeningDraft]:
    _check_names(nodes, "opening", reader)
    for node in nodes:
        if node.name in reader.spaces:
            line = reader.where(reader.spaces[node.name].node).line
            message = f'{node.kind.lower()} "{node.name}" has the name of the space in line {line}'
            reader.warning(node, message, "rename one: oracles find both by their name")
    located = [(node, read_location(node, node.kind.lower(), reader)) for node in nodes]
    drafts = (draft_opening(node, location, reader) for node, location in located)
    return [draft for draft in drafts if draft is not None]


def _build(
    name: str,
    drafts: list[SpaceDraft],
    features: list[FeatureDraft],
    openings: list[OpeningDraft],
    reader: PlanReader,
) -> FloorPlan:
    world = place_all(drafts)
    spaces = tuple(build_space(draft, world[draft.name], reader) for draft in drafts)
    walls = {(wall.space, wall.index): wall for space in spaces for wall in space.walls}
    # Features of different spaces may share a name; published identifiers are unique.
    names = Counter(feature.node.name for feature in features)
    plan = FloorPlan(
        name,
        spaces,
        tuple(build_feature(f, world, names[f.node.name] == 1, reader) for f in features),
        tuple(build_opening(o, tuple(walls[key] for key in o.walls), reader) for o in openings),
    )
    _check_winding(drafts, reader)
    overlapping = _check_gaps(drafts, reader)
    # One mistake, one message: doorways between overlapping walls have the wrong depth too.
    known = {
        f"{opening.node.name} depth"
        for opening in openings
        if frozenset(space for space, _ in opening.walls) in overlapping
    }
    warn_of((flaw for flaw in geometric_flaws(plan) if flaw.key not in known), reader)
    return replace(plan, warnings=reader.warnings)


def _check_winding(drafts: Sequence[SpaceDraft], findings: Findings) -> None:
    for draft in drafts:
        if signed_area(draft.ring) > 0.0:
            findings.warning(
                draft.node.shape,
                f'the outline of "{draft.name}" runs counter-clockwise: its walls grow inwards',
                "list the points clockwise",
            )


def _check_gaps(drafts: Sequence[SpaceDraft], findings: Findings) -> set[frozenset[str]]:
    """Warn of facing walls that overlap because the gap is smaller than both together.

    Returns the pairs of spaces.
    """
    overlapping: set[frozenset[str]] = set()
    for draft in drafts:
        location, other = draft.location, draft.against
        if other is None or draft.own is None or draft.other is None:
            continue
        # One number describes the gap only if the walls face each other without a turn.
        if "spaced" in location or "not aligned" in location or location.get("rotation.z"):
            continue
        gap = location.get("translation.y")
        needed = draft.thickness + other.thickness
        if gap < needed - 1e-9:
            overlapping.add(frozenset((draft.name, other.name)))
            findings.warning(
                draft.node,
                f'the facing walls of "{draft.name}" and "{other.name}" overlap: '
                f"{gap:g} m apart, {needed:g} m thick together",
                'write "spaced" to make them touch',
            )
    return overlapping
