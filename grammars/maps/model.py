"""A building as a map shows it: free areas, walls, entryways.

Coordinates are metres in the frame of the map. Rings do not repeat their first corner.
"""

from __future__ import annotations

from dataclasses import dataclass

from grammars.model.geometry import Point2, Ring


@dataclass(frozen=True, slots=True)
class Area:
    """A piece of floor: the ring around it and the rings of its holes."""

    outline: Ring
    holes: tuple[Ring, ...] = ()


@dataclass(frozen=True, slots=True)
class DrawnSpace:
    """A named free area."""

    name: str
    area: Area


@dataclass(frozen=True, slots=True)
class DrawnWall:
    """Something that stands on the floor and never moves, ``height`` [m] high."""

    area: Area
    height: float


@dataclass(frozen=True, slots=True)
class DrawnEntryway:
    """A gap between walls in which a door may hang.

    ``start`` and ``end`` are its jambs, each in the middle of the wall's thickness ``depth`` [m];
    the frame's x axis leads from ``start`` to ``end``, y through the wall, to the left of it.
    ``height`` is that of the passage [m]; it stands on the floor.
    """

    name: str
    start: Point2
    end: Point2
    depth: float
    height: float


@dataclass(frozen=True, slots=True)
class DrawnBuilding:
    """A whole floor. ``source`` says in a line what it was made from."""

    name: str
    spaces: tuple[DrawnSpace, ...]
    walls: tuple[DrawnWall, ...]
    entryways: tuple[DrawnEntryway, ...] = ()
    source: str = ""
