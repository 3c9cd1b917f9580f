"""What is drawn on some layers of a DXF file: lines of walls, and doors, in metres.

A door is a block by its name, or an arc as a leaf swings, by the name of its layer.

Blocks that are no doors are looked into, since whole storeys are often one block. What cannot be
read as a line is counted.
"""

from __future__ import annotations

import fnmatch
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from grammars.model.geometry import Point2
from grammars.text.terminal_text import printable

_DEEPEST: Final = 8
"""Blocks in blocks that are looked into."""
MOST_ENTITIES: Final = 1_000_000
"""More is no floor plan; and a file of nested blocks could make any number of them."""
LINES: Final = ("LINE", "LWPOLYLINE", "POLYLINE")
"""Kinds of entities that walls are read from."""
_OF_DOORS: Final = (*LINES, "ARC", "CIRCLE", "ELLIPSE", "SPLINE")
_SWING: Final = (45.0, 120.0)
"""How far a door is drawn to turn [degrees]."""
_WIDTHS: Final = ("WIDTH", "W", "BREITE", "LARGEUR", "ANCHO")


@dataclass(frozen=True, slots=True)
class DoorBlock:
    """A block that stands for a door: its corners and the point it was inserted at [m].

    ``width`` is what an attribute of the block says, 0 when none does [m].
    """

    block: str
    points: tuple[Point2, ...]
    at: Point2
    width: float = 0.0

    def moved(self, x: float, y: float) -> DoorBlock:
        """Return the same block elsewhere, by so many metres."""
        points = tuple((px + x, py + y) for px, py in self.points)
        return DoorBlock(self.block, points, (self.at[0] + x, self.at[1] + y), self.width)


@dataclass(slots=True)
class DrawnLines:
    """The lines of walls and the doors; ``ignored`` counts the rest by entity type and layer."""

    walls: list[tuple[Point2, ...]] = field(default_factory=list)
    doors: list[DoorBlock] = field(default_factory=list)
    ignored: Counter[tuple[str, str]] = field(default_factory=Counter)


class TooManyEntitiesError(ValueError):
    """A drawing holds more than any floor plan does."""


def is_named_like(name: str, patterns: Iterable[str]) -> bool:
    """Return whether a name fits one of the patterns (``*`` and ``?``), whatever its case."""
    return any(fnmatch.fnmatchcase(name.lower(), pattern.lower()) for pattern in patterns)


@dataclass(slots=True)
class LineReader:
    """Reads entities; ``scale`` is the length of a drawing unit, ``tolerance`` of arcs [m]."""

    layers: Sequence[str]
    doors: Sequence[str]
    scale: float
    tolerance: float
    lines: DrawnLines = field(default_factory=DrawnLines)
    _read: int = 0

    def read(self, entities: Iterable[Any], layer: str = "0", depth: int = 0) -> None:
        """Take over entities; those on layer 0 of a block are on the ``layer`` of the block.

        Raises :class:`TooManyEntitiesError`.
        """
        for entity in entities:
            self._read += 1
            if self._read > MOST_ENTITIES:
                raise TooManyEntitiesError
            kind = printable(entity.dxftype())
            # What ezdxf does not know at all has no layer.
            own = printable(entity.dxf.layer) if entity.dxf.is_supported("layer") else "0"
            on = layer if own == "0" and depth else own
            if kind == "INSERT":
                self._block(entity, on, depth)
            elif kind == "ARC" and is_named_like(on, self.doors) and _is_swing(entity):
                self._swing(entity, on)
            elif not is_named_like(on, self.layers) or kind not in LINES:
                self.lines.ignored[kind, on] += 1
            else:
                corners = self._corners(entity)
                if len(corners) < 2:
                    self.lines.ignored[kind, on] += 1
                else:
                    self.lines.walls.append(corners)

    def _block(self, insert: Any, layer: str, depth: int) -> None:
        name = printable(insert.dxf.get("name", ""))
        if is_named_like(name, self.doors):
            self.lines.doors.append(self._door(insert, name))
        elif depth >= _DEEPEST:
            self.lines.ignored["INSERT", layer] += 1
        else:
            for single in _singly(insert):
                self.read(single.virtual_entities(), layer, depth + 1)

    def _swing(self, arc: Any, layer: str) -> None:
        """Take an arc on a layer of doors for a door that is no block: it turns about its hinge."""
        hinge = arc.ocs().to_wcs(arc.dxf.center)
        at = (hinge.x * self.scale, hinge.y * self.scale)
        self.lines.doors.append(DoorBlock(layer, (at, *self._corners(arc)), at))

    def _door(self, insert: Any, name: str) -> DoorBlock:
        points = [
            point
            for entity in _decomposed(insert, _DEEPEST)
            if entity.dxftype() in _OF_DOORS
            for point in self._corners(entity)
        ]
        at = insert.dxf.insert
        x, y = at.x * self.scale, at.y * self.scale
        return DoorBlock(name, tuple(points), (x, y), self._width(insert))

    def _width(self, insert: Any) -> float:
        for attribute in insert.attribs:
            if attribute.dxf.get("tag", "").upper() in _WIDTHS:
                try:
                    width = float(attribute.dxf.get("text", "").replace(",", ".")) * self.scale
                except ValueError:
                    continue
                return width if math.isfinite(width) and width > 0.0 else 0.0
        return 0.0

    def _corners(self, entity: Any) -> tuple[Point2, ...]:
        """Return the corners of an entity, its arcs flattened; none where it has no length."""
        from ezdxf.path import make_path

        try:
            path = make_path(entity)
        except (TypeError, ValueError):
            return ()
        corners: list[Point2] = []
        for point in path.flattening(self.tolerance / self.scale):
            corner = (point.x * self.scale, point.y * self.scale)
            if not all(map(math.isfinite, corner)):
                return ()
            if not corners or corner != corners[-1]:
                corners.append(corner)
        return tuple(corners)


def _is_swing(arc: Any) -> bool:
    turned = (arc.dxf.end_angle - arc.dxf.start_angle) % 360.0
    return bool(_SWING[0] <= turned <= _SWING[1])


def _singly(insert: Any) -> Iterable[Any]:
    """Return the insertions an array of blocks stands for."""
    return insert.multi_insert() if insert.mcount > 1 else (insert,)


def _decomposed(insert: Any, depth: int) -> Iterator[Any]:
    for entity in insert.virtual_entities():
        if entity.dxftype() != "INSERT":
            yield entity
        elif depth > 0:
            yield from _decomposed(entity, depth - 1)
