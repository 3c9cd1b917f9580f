"""Walls layers, ``NAME.walls.yaml``: an existing building instead of its design.

A layer holds free areas, the walls between them, and the gaps for doors, as polygons in the frame
of one map [m]. They become a :class:`FloorPlan` of spaces without own walls, walls as features, and
entryways that cut no walls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

import shapely
import yaml
from pydantic import Field, PlainSerializer
from shapely.geometry import LineString, Point, Polygon

from grammars.floorplan import (
    Feature,
    FloorPlan,
    Opening,
    Space,
    opening_at,
    overlaps,
    warn_of,
)
from grammars.model.geometry import Pose2, Ring
from grammars.text.diagnostics import Findings, Where, with_article
from grammars.text.documents import (
    KeyPath,
    StrictModel,
    load_yaml,
    read_model,
)
from grammars.text.quantity import Length, QuantityField

_LARGEST: Final = 1e6
"""Largest coordinate [m], as in floor plans."""
_NARROWEST: Final = 1e-3
_WIDEST: Final = 50.0
"""Limits of widths and depths of entryways [m]: gates of hangars are at most that wide."""
_SMALLEST: Final = 1e-6
"""Area of the smallest outline [m²]."""
_SWALLOWED: Final = 0.9
"""Largest share of a space that walls may cover."""
_JAMB: Final = 0.25
"""Largest distance of a jamb from the nearest wall [m]: on maps, walls end a few cells early."""
_BESIDE: Final = 0.2
"""Distance from the faces of an entryway at which there must be floor [m]."""
_NAME: Final = r"^[A-Za-z_][A-Za-z0-9_]*$"
"""Names that sentences about objects can contain."""

Metres = Annotated[float, QuantityField("length", plain=True), Field(ge=-_LARGEST, le=_LARGEST)]
Corner = tuple[Metres, Metres]
Name = Annotated[str, Field(pattern=_NAME, max_length=100)]
Outline = Annotated[tuple[Corner, ...], Field(min_length=3)]
_IN_METRES: Final = PlainSerializer(lambda size: f"{round(size, 3):g} m")
_Size = Annotated[Length, Field(gt=0, le=_LARGEST), _IN_METRES]


class AreaText(StrictModel):
    """An area of the floor."""

    outline: Outline
    """Corners in order, each as [x, y] in the frame of the map [m]."""
    holes: list[Outline] = Field(default_factory=list)
    """Outlines inside of the area that do not belong to it."""


class StandingText(AreaText):
    """A wall, column or other thing that never moves."""

    name: Name | None = None
    """Name in messages; by default wall_1, wall_2, … in the order of the file."""
    height: _Size | None = None
    """Height of the thing; by default that of the walls."""


class EntrywayText(StrictModel):
    """A gap between walls, in which a door may hang."""

    start: Corner = Field(alias="from")
    """One jamb as [x, y], in the middle of the thickness of the wall."""
    end: Corner = Field(alias="to")
    """The other jamb. Along the way from "from" to "to", inwards is to the right and outwards to
    the left."""
    depth: Annotated[Length, Field(ge=_NARROWEST, le=_WIDEST), _IN_METRES]
    """Thickness of the wall at the gap."""
    height: _Size = 2.0
    """Height of the passage, which begins at the floor."""


class WallsText(StrictModel):
    """The keys of a walls layer."""

    walls: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100)
    """Name of the building."""
    about: str = ""
    """Description in one line."""
    height: _Size = 2.5
    """Height of the walls."""
    spaces: dict[Name, AreaText] = Field(min_length=1)
    """Free areas by name."""
    standing: list[StandingText] = Field(default_factory=list)
    """Walls, columns and other things that never move."""
    entryways: dict[Name, EntrywayText] = Field(default_factory=dict)
    """Gaps between walls by name."""


def walls_text(building: WallsText) -> str:
    """Return a building as the text of a walls layer; equal buildings give equal texts."""
    keys = building.model_dump(by_alias=True, exclude_unset=True)
    # Each innermost list, which is a corner, takes one line.
    text: str = yaml.safe_dump(keys, sort_keys=False, default_flow_style=None)
    return text


def load_walls(path: str | Path) -> FloorPlan:
    """Read a walls layer; warnings are in the plan.

    The frame of every space and wall is that of the map. The frame of an entryway is in the middle
    of its near face, x from one jamb to the other and y through the wall. Raises
    :class:`InputError` with all errors.
    """
    document = load_yaml(path)
    text = read_model(document, WallsText)
    findings, at = Findings(), document.where
    spaces: list[tuple[str, KeyPath, AreaText]] = [
        (name, ("spaces", name), area) for name, area in text.spaces.items()
    ]
    standing: list[tuple[str, KeyPath, StandingText]] = [
        (item.name or f"wall_{k + 1}", ("standing", k), item)
        for k, item in enumerate(text.standing)
    ]
    entryways: list[tuple[str, KeyPath, EntrywayText]] = [
        (name, ("entryways", name), item) for name, item in text.entryways.items()
    ]
    kinds: dict[str, str] = {}
    for kind, elements in (("space", spaces), ("wall", standing), ("entryway", entryways)):
        for name, key, _ in elements:
            if name in kinds:
                message = f'there is already {with_article(kinds[name])} "{name}"'
                hint = "give each space, wall and entryway its own name"
                findings.error(at(key), message, hint)
            elif name == "world":
                findings.error(at(key), '"world" is the frame of the map', "rename it")
            kinds.setdefault(name, kind)
    for _, key, area in (*spaces, *standing):
        holes_at = [at((*key, "holes", k)) for k in range(len(area.holes))]
        _check_area(area.outline, area.holes, at((*key, "outline")), holes_at, findings)
    for name, key, item in entryways:
        width = math.dist(item.start, item.end)
        if not _NARROWEST <= width <= _WIDEST:
            size = "not wide at all" if width < _NARROWEST else f"{width:,.0f} m wide"
            findings.error(at(key), f'entryway "{name}" is {size}')
    # Areas with errors cannot be measured.
    findings.raise_errors()
    plan = FloorPlan(
        text.walls,
        tuple(
            Space(name, Pose2(), area.outline, (), at(key), holes=tuple(area.holes))
            for name, key, area in spaces
        ),
        tuple(_feature(name, item, text.height, at(key)) for name, key, item in standing),
        tuple(_opening(name, item, at(key)) for name, key, item in entryways),
    )
    _check_plan(plan, findings)
    findings.raise_errors()
    return replace(plan, warnings=findings.warnings)


def _feature(name: str, item: StandingText, height: float, where: Where) -> Feature:
    height, holes = item.height or height, tuple(item.holes)
    return Feature("wall", name, name, "", Pose2(), item.outline, height, where, holes=holes)


def _opening(name: str, entryway: EntrywayText, where: Where) -> Opening:
    """Return the entryway between two jambs."""
    (x0, y0), (x1, y1) = entryway.start, entryway.end
    width, height = math.dist(entryway.start, entryway.end), entryway.height
    middle = Pose2((x0 + x1) / 2, (y0 + y1) / 2, math.atan2(y1 - y0, x1 - x0))
    ring = tuple(
        (x, 0.0, z)
        for x, z in (
            (-width / 2, -height / 2),
            (-width / 2, height / 2),
            (width / 2, height / 2),
            (width / 2, -height / 2),
        )
    )
    frame, depth = middle @ Pose2(0.0, -entryway.depth / 2, 0.0), entryway.depth
    return opening_at("entryway", name, (), frame, where, ring=ring, depth=depth, z=height / 2)


def _check_area(
    outline: Ring,
    holes: Sequence[Ring],
    where: Where,
    holes_at: Sequence[Where],
    findings: Findings,
) -> None:
    """Report an outline or hole that crosses itself, and holes that are not inside."""
    rings = [Polygon(outline), *map(Polygon, holes)]
    are_sound = [
        _check_ring(ring, "hole" if k else "outline", place, findings)
        for k, (ring, place) in enumerate(zip(rings, (where, *holes_at), strict=True))
    ]
    if not all(are_sound) or Polygon(outline, holes).is_valid:
        return
    outer, *inner = rings
    shapely.prepare(outer)
    outside = [place for hole, place in zip(inner, holes_at, strict=True) if not outer.covers(hole)]
    for place in outside:
        findings.error(place, "this hole is not inside its outline")
    if not outside:
        findings.error(where, "the holes of this outline overlap or cut it in two")


def _check_ring(ring: Polygon, kind: str, where: Where, findings: Findings) -> bool:
    if not ring.is_valid:
        reason, _, place = shapely.is_valid_reason(ring).partition("[")
        x, _, y = place.rstrip("]").partition(" ")
        near = f" near [{x}, {y}]" if y and "Self" in reason else ""
        hint = "list the corners in order around the area"
        findings.error(where, f"this {kind} crosses itself{near}", hint)
        return False
    if ring.area < _SMALLEST:
        findings.error(where, f"this {kind} has no area", "it needs three corners or more")
        return False
    return True


def _check_plan(plan: FloorPlan, findings: Findings) -> None:
    """Report covered spaces and blocked entryways; warn of suspicious places.

    All areas of ``plan`` must be valid.
    """
    walls = [Polygon(item.footprint, item.holes) for item in plan.features]
    tree = shapely.STRtree(walls)
    floors = [Polygon(space.outline, space.holes) for space in plan.spaces]
    for space, floor in zip(plan.spaces, floors, strict=True):
        standing = shapely.union_all([walls[k] for k in tree.query(floor, "intersects")])
        if floor.intersection(standing).area > _SWALLOWED * floor.area:
            findings.error(
                space.where,
                f'walls cover the floor of "{space.name}"',
                "the outline of a wall that encloses a space needs a hole for it",
            )
    warn_of(overlaps(plan), findings)
    for opening in plan.openings:
        _check_entryway(opening, tree, floors, findings)


def _check_entryway(
    opening: Opening, tree: shapely.STRtree, floors: Sequence[Polygon], findings: Findings
) -> None:
    half, middle = opening.width / 2, opening.depth / 2
    label = f'entryway "{opening.name}"'

    def at(x: float, y: float) -> tuple[float, float]:
        return (opening.frame @ Pose2(x, y)).apply((0.0, 0.0))

    line = LineString([at(-half, middle), at(half, middle)])
    walls = tree.geometries
    crossed = shapely.union_all(walls[tree.query(line, "intersects")])
    if line.intersection(crossed).length > line.length / 2:
        findings.error(
            opening.where,
            f"{label} leads through a wall",
            "leave the gap in the outlines of the walls: an entryway here cuts no walls",
        )
        return
    for name, jamb in (("from", at(-half, middle)), ("to", at(half, middle))):
        if len(tree.query(Point(jamb), predicate="dwithin", distance=_JAMB)) == 0:
            x, y = jamb
            findings.warning(
                opening.where,
                f'{label}: no wall stands at "{name}" [{x:g}, {y:g}]',
                "an entryway leads from the end of one wall to that of another",
            )
    # One side may be outside of the building.
    probes = [Point(at(0.0, y)) for y in (-_BESIDE, opening.depth + _BESIDE)]
    if not any(floor.covers(probe) for floor in floors for probe in probes):
        findings.warning(opening.where, f"{label} leads to no space")
