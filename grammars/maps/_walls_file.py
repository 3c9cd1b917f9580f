"""Walls layers, ``NAME.walls.yaml``: a building as it was found, and not as it was designed.

Free areas, what stands between them, and the gaps in which doors may hang, all as polygons in the
frame of one map [m]. Read into the :class:`FloorPlan` that the rest of the house knows: spaces
without walls of their own, walls as features, entryways that cut nothing.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from grammars.floorplan import Feature, FloorPlan, Opening, OpeningPrism, Space, opening_at
from grammars.maps._walls_checks import WallsChecker
from grammars.model.geometry import Pose2, Ring
from grammars.text.diagnostics import Where
from grammars.text.documents import (
    KeyPath,
    Length,
    QuantityField,
    StrictModel,
    YamlDocument,
    load_yaml,
    read_model,
)

_LARGEST: Final = 1e6
"""Greatest coordinate [m], as in floor plans."""
_NARROWEST: Final = 1e-3
_WIDEST: Final = 50.0
"""Widths and depths an entryway may have [m]: the gates of hangars are no wider."""
_NAME: Final = r"^[A-Za-z_][A-Za-z0-9_]*$"
"""Names that sentences about objects can hold."""

Metres = Annotated[float, QuantityField("length", plain=True), Field(ge=-_LARGEST, le=_LARGEST)]
Corner = tuple[Metres, Metres]
Name = Annotated[str, Field(pattern=_NAME, max_length=100)]
_Size = Annotated[Length, Field(gt=0, le=_LARGEST)]


class AreaText(StrictModel):
    """An area of the floor."""

    outline: list[Corner] = Field(min_length=3)
    """Its corners in order, each as [x, y], in metres of the frame of the map."""
    holes: list[Annotated[list[Corner], Field(min_length=3)]] = Field(default_factory=list)
    """Outlines inside of it that do not belong to it."""

    def rings(self) -> tuple[Ring, tuple[Ring, ...]]:
        """Return the outline and the holes."""
        return tuple(self.outline), tuple(tuple(hole) for hole in self.holes)


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
    depth: Length = Field(ge=_NARROWEST, le=_WIDEST)
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


def load_walls(path: str | Path) -> FloorPlan:
    """Read a walls layer; warnings are in the plan.

    The frame of every space and wall is that of the map; the frame of an entryway stands in the
    middle of its near face, x from one jamb to the other and y through the wall.
    Raises :class:`InputError` with everything that is wrong with the file, each with its place.
    """
    document = load_yaml(path)
    text = read_model(document, WallsText)
    reader = _Reader(document, text)
    plan = FloorPlan(text.walls, reader.spaces(), reader.standing(), reader.entryways())
    reader.check(plan)
    return replace(plan, warnings=reader.findings.warnings)


class _Reader:
    """Turns the checked text into elements of a plan, noting what has no meaning."""

    def __init__(self, document: YamlDocument, text: WallsText) -> None:
        self._document = document
        self._text = text
        self._named: dict[str, str] = {}
        self.findings = WallsChecker()

    def spaces(self) -> tuple[Space, ...]:
        """Return the spaces, in the order of the file."""
        found = []
        for name, area in self._text.spaces.items():
            path: KeyPath = ("spaces", name)
            self._take_name(name, "space", path)
            outline, holes = self._rings(area, path)
            found.append(Space(name, Pose2(), outline, (), self._at(path), holes=holes))
        return tuple(found)

    def standing(self) -> tuple[Feature, ...]:
        """Return what stands, in the order of the file."""
        found = []
        for number, item in enumerate(self._text.standing):
            path: KeyPath = ("standing", number)
            name = item.name or f"wall_{number + 1}"
            self._take_name(name, "wall", path)
            footprint, holes = self._rings(item, path)
            height = item.height or self._text.height
            where = self._at(path)
            found.append(
                Feature("wall", name, name, "", Pose2(), footprint, height, where, holes=holes)
            )
        return tuple(found)

    def entryways(self) -> tuple[Opening, ...]:
        """Return the entryways, in the order of the file."""
        found = []
        for name, item in self._text.entryways.items():
            path: KeyPath = ("entryways", name)
            self._take_name(name, "entryway", path)
            width = math.dist(item.start, item.end)
            if not _NARROWEST <= width <= _WIDEST:
                how = "not wide at all" if width < _NARROWEST else f"{width:,.0f} m wide"
                self.findings.error(self._at(path), f'entryway "{name}" is {how}')
                continue
            found.append(entryway_between(name, item, self._at(path)))
        return tuple(found)

    def check(self, plan: FloorPlan) -> None:
        """Raise for geometry without a meaning, if any; warn of what is placed suspiciously."""
        # Areas that are none can be measured against nothing.
        self.findings.raise_errors()
        self.findings.check_plan(plan)
        self.findings.raise_errors()

    def _rings(self, area: AreaText, path: KeyPath) -> tuple[Ring, tuple[Ring, ...]]:
        outline, holes = area.rings()
        places = [self._at((*path, "holes", k)) for k in range(len(holes))]
        self.findings.check_area(outline, holes, self._at((*path, "outline")), places)
        return outline, holes

    def _take_name(self, name: str, kind: str, path: KeyPath) -> None:
        if name in self._named:
            message = f"there is {'an' if self._named[name][0] in 'ae' else 'a'} "
            self.findings.error(
                self._at(path),
                f'{message}{self._named[name]} "{name}" already',
                "give each space, wall and entryway a name of its own",
            )
        elif name == "world":
            self.findings.error(self._at(path), '"world" is the frame of the map', "rename it")
        self._named.setdefault(name, kind)

    def _at(self, path: KeyPath) -> Where:
        return self._document.where(path)


def entryway_between(name: str, written: EntrywayText, where: Where) -> Opening:
    """Return the entryway between two jambs."""
    (x0, y0), (x1, y1) = written.start, written.end
    width, height = math.dist(written.start, written.end), written.height
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
    prism = OpeningPrism(ring, written.depth, height / 2, 0.0)
    near_face = Pose2(0.0, -written.depth / 2, 0.0)
    return opening_at("entryway", name, (), middle @ near_face, prism, where)
