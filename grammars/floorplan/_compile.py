"""From syntax tree to world geometry: names, values, placement, then everything at its place."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from grammars.floorplan._checks import check_geometry
from grammars.floorplan._features import FeatureDraft, build_feature, draft_feature
from grammars.floorplan._location import read_location
from grammars.floorplan._openings import OpeningDraft, build_opening, draft_opening
from grammars.floorplan._placement import (
    Draft,
    build_space,
    check_anchored,
    connect,
    outer_corners,
    place_all,
    wall_frames,
)
from grammars.floorplan._shapes import floor_outline
from grammars.floorplan._source import Findings, Node, Source, in_source_order
from grammars.floorplan._values import Quantities
from grammars.floorplan.model import FloorPlan

_RANK = {"Defaults": 0, "Variable": 1}


def compile_plan(tree: Node, source: Source) -> FloorPlan:
    """Return the plan a syntax tree means; raises ``InputError`` with all errors found."""
    findings = Findings(source)
    by_kind = _sort_statements(tree, findings)
    quantities = Quantities(by_kind["Variable"], findings)
    dimensions = _dimensions(by_kind["Defaults"], quantities, findings)
    drafts = [_draft_space(n, dimensions, quantities, findings) for n in by_kind["Space"]]
    spaces: dict[str, Draft] = {}
    for draft in drafts:
        spaces.setdefault(draft.name, draft)
    _check_names([draft.node for draft in drafts], "space", findings)
    for draft in drafts:
        connect(draft, spaces, findings)
    check_anchored(drafts, findings)
    features = _draft_features(by_kind["Feature"], drafts, spaces, quantities, findings)
    openings = _draft_openings(by_kind["Opening"], spaces, quantities, findings)
    if not drafts and not findings.errors:
        findings.error(tree, f'plan "{tree.name}" has no spaces', 'add one: "Space room: …"')
    findings.refuse_if_errors()
    return _build(tree.name, drafts, features, openings, findings)


def _sort_statements(tree: Node, findings: Findings) -> dict[str, list[Node]]:
    """Group the statements; defaults come first, once, then variables, then elements."""
    by_kind: dict[str, list[Node]] = {
        kind: [] for kind in ("Defaults", "Variable", "Space", "Feature", "Opening")
    }
    reached = 0
    for node in tree.statements:
        kind = type(node).__name__
        rank = _RANK.get(kind, 2)
        if kind == "Defaults" and by_kind[kind]:
            findings.error(node, '"Defaults:" is given twice')
        elif rank < reached:
            what = '"Defaults:"' if kind == "Defaults" else f'variable "{node.name}"'
            findings.error(
                node, f"{what} comes too late", "first Defaults, then variables, then elements"
            )
        reached = max(reached, rank)
        by_kind[kind].append(node)
    return by_kind


def _dimensions(
    nodes: Sequence[Node], quantities: Quantities, findings: Findings
) -> dict[str, float | None]:
    """Return the wall thickness and height written in ``walls:`` blocks (``None``: refused)."""
    values: dict[str, float | None] = {}
    for node in nodes:
        for dimension in node.dimensions:
            value = quantities.length(dimension.value)
            if dimension.key in values:
                findings.error(dimension, f'"{dimension.key}" is given twice')
            elif value is not None and value <= 0.0:
                findings.warn(dimension, f"a wall {dimension.key} of {value:g} m makes no wall")
            values[dimension.key] = value
    return values


def _draft_space(
    node: Node, defaults: dict[str, float | None], quantities: Quantities, findings: Findings
) -> Draft:
    sizes = defaults | _dimensions([node], quantities, findings)
    missing = [key for key in ("thickness", "height") if key not in sizes]
    if missing:
        findings.error(
            node,
            f'space "{node.name}" has no wall {" and ".join(missing)}',
            'give it in "walls:" of the space or of Defaults',
        )
    if node.name in ("this", "world"):
        findings.warn(node, f'a space called "{node.name}" cannot be referred to by its name')
    ring = floor_outline(node.shape, quantities, findings)
    location = read_location(node, "space", quantities, findings)
    draft = Draft(node, node.name, ring, sizes.get("thickness"), sizes.get("height"), location)
    if ring is not None and draft.thickness is not None:
        draft.frames = wall_frames(ring)
        draft.outer = outer_corners(ring, draft.thickness)
    return draft


def _check_names(nodes: Sequence[Node], what: str, findings: Findings) -> None:
    first: dict[str, Node] = {}
    for node in nodes:
        if node.name in first:
            line = findings.source.at(first[node.name]).line
            findings.error(node, f'{what} "{node.name}" is already defined in line {line}')
        first.setdefault(node.name, node)


def _draft_features(
    top_level: Sequence[Node],
    drafts: Sequence[Draft],
    spaces: dict[str, Draft],
    quantities: Quantities,
    findings: Findings,
) -> list[FeatureDraft]:
    groups: list[tuple[Draft | None, Sequence[Node]]] = [(d, d.node.features) for d in drafts]
    groups.append((None, top_level))
    found: list[FeatureDraft] = []
    for owner, nodes in groups:
        _check_names(nodes, "feature", findings)
        for node in nodes:
            feature = draft_feature(node, owner, spaces, quantities, findings)
            if feature is not None:
                found.append(feature)
    return sorted(found, key=lambda feature: feature.node._tx_position)


def _draft_openings(
    nodes: Sequence[Node], spaces: dict[str, Draft], quantities: Quantities, findings: Findings
) -> list[OpeningDraft]:
    _check_names(nodes, "opening", findings)
    found = []
    for node in nodes:
        location = read_location(node, node.kind.lower(), quantities, findings)
        opening = draft_opening(node, location, spaces, quantities, findings)
        if opening is not None:
            found.append(opening)
    return found


def _build(
    name: str,
    drafts: list[Draft],
    features: list[FeatureDraft],
    openings: list[OpeningDraft],
    findings: Findings,
) -> FloorPlan:
    world = place_all(drafts)
    spaces = tuple(build_space(draft, world[draft.name], findings) for draft in drafts)
    walls = {(wall.space, wall.index): wall for space in spaces for wall in space.walls}
    names = Counter(feature.node.name for feature in features)
    plan = FloorPlan(
        name,
        spaces,
        tuple(build_feature(f, world, names[f.node.name] == 1, findings) for f in features),
        tuple(build_opening(o, tuple(walls[key] for key in o.walls), findings) for o in openings),
    )
    check_geometry(plan, drafts, findings)
    return FloorPlan(
        plan.name, plan.spaces, plan.features, plan.openings, in_source_order(findings.warnings)
    )
