"""From the lines of a drawing to a building: walls, openings, rooms, and what was left out."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from grammars.maps._drawing_doors import cut_for, gap_of
from grammars.maps._drawing_lines import (
    LINES,
    MOST_ENTITIES,
    DoorBlock,
    DrawnLines,
    LineReader,
    TooManyEntitiesError,
    is_named_like,
)
from grammars.maps._drawing_settings import UNITS, WINDOW_BLOCKS, DrawingSettings
from grammars.maps._drawing_walls import (
    WallGap,
    enclosed,
    gaps_in,
    loose_ends,
    polygons_in,
    wall_area,
)
from grammars.maps.model import Area, DrawnBuilding, DrawnEntryway, DrawnSpace, DrawnWall
from grammars.model.geometry import Point2
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where

_SIZES: Final = (1.0, 2000.0)
"""Extents that a building may have [m]."""
_FAR: Final = 1000.0
"""A building farther from the origin [m] is moved there: it has coordinates of a country."""
_LAP: Final = 0.01
"""How far openings go into the walls beside them [m], so that no slit is left."""
_SHOWN: Final = 6
"""So many layers or kinds of entities are listed in one message."""


@dataclass(slots=True)
class DrawingReader:
    """One drawing on its way to a building: what is chosen, and what is to be said about it."""

    where: Where
    settings: DrawingSettings
    unit: str
    warnings: list[Diagnostic] = field(default_factory=list)

    def building(self, document: Any, name: str) -> DrawnBuilding:
        """Return the building in the model space of an ezdxf document; raises ``InputError``."""
        chosen, lines = self.settings, self._lines(document)
        self._check_size(lines.walls)
        self._move(lines)
        walls = wall_area(lines.walls, chosen.thickness)
        walls, doorways = self._openings(walls, lines.doors)
        rooms = enclosed(shapely.union_all([walls, *(gap.area(along=_LAP) for gap in doorways)]))
        if not rooms:
            raise self._nothing_enclosed(lines.walls)
        self._say_ignored(lines.ignored)
        return DrawnBuilding(
            name,
            tuple(DrawnSpace(f"room_{n}", area_of(room)) for n, room in enumerate(rooms, 1)),
            tuple(DrawnWall(area_of(part), chosen.height) for part in polygons_in(walls)),
            tuple(
                DrawnEntryway(f"doorway_{n}", gap.start, gap.end, gap.depth, chosen.door_height)
                for n, gap in enumerate(doorways, 1)
            ),
            f"Made from {Path(self.where.file).name}, drawn in {self.unit}: "
            f"rooms: {len(rooms)}, doorways: {len(doorways)}.",
            tuple(self.warnings),
        )

    def _lines(self, document: Any) -> DrawnLines:
        chosen, scale = self.settings, UNITS[self.unit]
        blocks = (*chosen.doors, *WINDOW_BLOCKS)
        from ezdxf.lldxf.const import DXFError

        reader = LineReader(chosen.layers, blocks, scale, chosen.tolerance)
        try:
            reader.read(document.modelspace())
        except TooManyEntitiesError as error:
            message = f"holds more than {MOST_ENTITIES:,} entities, blocks in blocks counted"
            raise InputError.at(self.where, message, "save the plan of one storey alone") from error
        except DXFError as error:
            message = "holds entities that cannot be read: the file is damaged"
            raise InputError.at(self.where, message, "save it again as DXF") from error
        if not reader.lines.walls:
            raise self._without_walls(reader.lines.ignored)
        return reader.lines

    def _openings(
        self, walls: BaseGeometry, blocks: Sequence[DoorBlock]
    ) -> tuple[BaseGeometry, list[WallGap]]:
        """Return the walls with doors cut and windows closed, and the doorways."""
        gaps = gaps_in(walls)
        doorways: list[WallGap] = []
        for block in blocks:
            is_door = is_named_like(block.block, self.settings.doors)
            gap = gap_of(block, [gap for gap in gaps if not _is_taken(gap, doorways)])
            if gap is not None and not is_door:
                walls = walls.union(gap.area(along=_LAP))
            elif gap is None and is_door:
                gap = cut_for(block, walls)
                if gap is not None:
                    walls = walls.difference(gap.area(across=_LAP))
            if gap is not None and is_door:
                doorways.append(gap)
            elif is_door:
                x, y = block.at
                self._warn(
                    f'the block "{block.block}" at [{x:.2f}, {y:.2f}] lies in no wall',
                    "it becomes no doorway",
                )
        return walls, doorways

    def _check_size(self, walls: Sequence[Sequence[Point2]]) -> None:
        x0, y0, x1, y1 = _bounds(walls)
        largest = max(x1 - x0, y1 - y0)
        if not _SIZES[0] <= largest <= _SIZES[1]:
            said = "--unit says" if self.settings.unit else "the file says"
            raise InputError.at(
                self.where,
                f"the walls measure {x1 - x0:,.3g} m by {y1 - y0:,.3g} m, which is no building",
                f"{said} that it is drawn in {self.unit}; give the true unit with --unit",
            )

    def _move(self, lines: DrawnLines) -> None:
        """Move a building with coordinates of a country to the origin."""
        x, y, *_ = (float(math.floor(value)) for value in _bounds(lines.walls))
        if math.hypot(x, y) <= _FAR:
            return
        lines.walls = [tuple((px - x, py - y) for px, py in line) for line in lines.walls]
        lines.doors = [door.moved(-x, -y) for door in lines.doors]
        self._warn(f"the building was moved by ({-x:g} m, {-y:g} m), near to the origin")

    def _say_ignored(self, ignored: Counter[tuple[str, str]]) -> None:
        """Say what was left out: on the layers of walls by kind, elsewhere by layer."""
        layers = self.settings.layers
        kinds: Counter[str] = Counter()
        others: Counter[str] = Counter()
        for (kind, layer), count in ignored.items():
            if is_named_like(layer, layers):
                kinds[f"{kind} on {layer}"] += count
            else:
                others[layer] += count
        if kinds:
            self._warn(
                f"ignored on layers of walls: {_counted(kinds)}",
                f"walls are read from {', '.join(LINES)}",
            )
        if others:
            self._warn(f"ignored on layers without walls: {_counted(others)}")

    def _warn(self, message: str, hint: str = "") -> None:
        self.warnings.append(Diagnostic(self.where, message, hint, Severity.WARNING))

    def _without_walls(self, ignored: Counter[tuple[str, str]]) -> InputError:
        names = ", ".join(self.settings.layers)
        fitting: Counter[str] = Counter()
        lines: Counter[str] = Counter()
        for (kind, layer), count in ignored.items():
            if is_named_like(layer, self.settings.layers):
                fitting[f"{kind} on {layer}"] += count
            if kind in LINES:
                lines[layer] += count
        if fitting:
            message = f"no lines on layers named like {names}, but {_counted(fitting)}"
            hint = f"walls are read from {', '.join(LINES)}: explode the rest in your CAD"
        else:
            message = f"no layer with lines is named like {names}"
            hint = f"choose one with --layer: {_counted(lines)}" if lines else "it holds no lines"
        return InputError.at(self.where, message, hint)

    def _nothing_enclosed(self, walls: Sequence[Sequence[Point2]]) -> InputError:
        ends = loose_ends(walls)
        if not ends:
            return InputError.at(self.where, "the walls enclose no room")
        shown = ", ".join(f"[{x:.2f}, {y:.2f}]" for x, y in ends[:_SHOWN])
        loose = f"{len(ends)} lines end where no other begins, as at {shown}"
        return InputError.at(
            self.where,
            f"the walls enclose no room: {loose}",
            "close the gaps in the drawing, name the blocks of doors with --doors, or add the "
            "layer that closes them (of windows?) with --layer",
        )


def area_of(polygon: Polygon) -> Area:
    """Return a polygon as an area of a building, always beginning with the same corner."""
    polygon = shapely.normalize(polygon)
    outline, *holes = (
        tuple((float(x), float(y)) for x, y in ring.coords[:-1])
        for ring in (polygon.exterior, *polygon.interiors)
    )
    return Area(outline, tuple(holes))


def _is_taken(gap: WallGap, doorways: Sequence[WallGap]) -> bool:
    return any(gap.area().intersection(other.area()).area > 1e-3 for other in doorways)


def _bounds(lines: Sequence[Sequence[Point2]]) -> tuple[float, float, float, float]:
    xs = [x for line in lines for x, _ in line]
    ys = [y for line in lines for _, y in line]
    return min(xs), min(ys), max(xs), max(ys)


def _counted(found: Counter[str]) -> str:
    """Return the most frequent ones, each with how often it is there."""
    shown = [f"{name} ({count:,})" for name, count in found.most_common(_SHOWN)]
    return ", ".join(shown) + (", …" if len(found) > _SHOWN else "")
