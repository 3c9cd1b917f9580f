"""Walls layers, ``NAME.walls.yaml``: a building as it is, and not as somebody designed it.

Free areas, what stands between them, and the gaps in which doors may hang, all as polygons in the
frame of one map [m]. They become a :class:`FloorPlan` of spaces without walls of their own, walls
as features, and entryways that cut nothing.
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
    OpeningPrism,
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
"""Greatest coordinate [m], as in floor plans."""
_NARROWEST: Final = 1e-3
_WIDEST: Final = 50.0
"""Widths and depths an entryway may have [m]: the gates of hangars are no wider."""
_SMALLEST: Final = 1e-6
"""Area of the smallest outline [m²]."""
_SWALLOWED: Final = 0.9
"""Share of a space that walls may stand on."""
_JAMB: Final = 0.25
"""How far a jamb may be from the nearest wall [m]: walls of maps end a few cells too early."""
_BESIDE: Final = 0.2
"""Steps off the faces of an entryway to see whether there is floor [m]."""
_NAME: Final = r"^[A-Za-z_][A-Za-z0-9_]*$"
"""Names that sentences about objects can hold."""

Metres = Annotated[float, QuantityField("length", plain=True), Field(ge=-_LARGEST, le=_LARGEST)]
Corner = tuple[Metres, Metres]
Name = Annotated[str, Field(pattern=_NAME, max_length=100)]
Outline = Annotated[tuple[Corner, ...], Field(min_length=3)]
_IN_METRES: Final = PlainSerializer(lambda size: f"{round(size, 3):g} m")
_Size = Annotated[Length, Field(gt=0, le=_LARGEST), _IN_METRES]


class AreaText(StrictModel):
    """An area of the floor."""

    outline: Outline
    """Its corners in order, each as [x, y], in metres of the frame of the map."""
    holes: list[Outline] = Field(default_factory=list)
    """Outlines inside of it that do not belong to it."""


class StandingText(AreaText):
    """Something that stands on the floor and never moves."""

    name: Name | None = None
    """How messages call it; wall_1, wall_2, … in the order of the file when left out."""
    height: _Size | None = None
    """Of it; the height of the walls when left out."""


class EntrywayText(StrictModel):
    """A gap between walls, in which a door may hang."""

    start: Corner = Field(alias="from")
    """One jamb as [x, y], in the middle of the thickness of the wall."""
    end: Corner = Field(alias="to")
    """The other jamb. Seen along the way from the one to the other, inwards is to the right and
    outwards to the left."""
    depth: Annotated[Length, Field(ge=_NARROWEST, le=_WIDEST), _IN_METRES]
    """Thickness of the wall it leads through."""
    height: _Size = 2.0
    """Of the passage; it begins at the floor."""


class WallsText(StrictModel):
    """The keys of a walls layer."""

    walls: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100)
    """Name of the building."""
    about: str = ""
    """One line for people."""
    height: _Size = 2.5
    """Of the walls."""
    spaces: dict[Name, AreaText] = Field(min_length=1)
    """The free areas by name."""
    standing: list[StandingText] = Field(default_factory=list)
    """Walls, columns and whatever else never moves."""
    entryways: dict[Name, EntrywayText] = Field(default_factory=dict)
    """Gaps between walls by name."""


def walls_text(building: WallsText) -> str:
    """Return a building as the text of a walls layer; equal buildings, equal texts."""
    keys = building.model_dump(by_alias=True, exclude_unset=True)
    # Innermost lists, which are corners, on one line each.
    text: str = yaml.safe_dump(keys, sort_keys=False, default_flow_style=None)
    return text


def load_walls(path: str | Path) -> FloorPlan:
    """Read a walls layer; warnings are in the plan.

    The frame of every space and wall is that of the map; the frame of an entryway stands in the
    middle of its near face, x from one jamb to the other and y through the wall.
    Raises :class:`InputError` with everything that is wrong with the file, each with its place.
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
                message = f'there is {with_article(kinds[name])} "{name}" already'
                hint = "give each space, wall and entryway a name of its own"
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
    prism = OpeningPrism(ring, entryway.depth, height / 2, 0.0)
    near_face = Pose2(0.0, -entryway.depth / 2, 0.0)
    return opening_at("entryway", name, (), middle @ near_face, prism, where)


def _check_area(
    outline: Ring,
    holes: Sequence[Ring],
    where: Where,
    holes_at: Sequence[Where],
    findings: Findings,
) -> None:
    """Report an outline or hole that crosses itself, and holes that are not inside."""
    rings = [Polygon(outline), *map(Polygon, holes)]
    sound = [
        _check_ring(ring, "hole" if k else "outline", place, findings)
        for k, (ring, place) in enumerate(zip(rings, (where, *holes_at), strict=True))
    ]
    if not all(sound) or Polygon(outline, holes).is_valid:
        return
    outer, *inner = rings
    shapely.prepare(outer)
    outside = [place for hole, place in zip(inner, holes_at, strict=True) if not outer.covers(hole)]
    for place in outside:
        findings.error(place, "this hole is not inside of its outline")
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
    """Report swallowed spaces and blocked entryways; warn of what is placed suspiciously.

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
            "leave the gap in the outlines of the walls: an entryway here cuts nothing",
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
    # On one side may be the outside.
    probes = [Point(at(0.0, y)) for y in (-_BESIDE, opening.depth + _BESIDE)]
    if not any(floor.covers(probe) for floor in floors for probe in probes):
        findings.warning(opening.where, f"{label} leads to no space")
