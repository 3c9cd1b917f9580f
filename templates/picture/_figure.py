"""What a picture is made of: shapes, discs and texts on a page, in the order they are painted.

Page units are pixels of the SVG, x to the right, y down. Colours are ``#rrggbb``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from grammars.values import Point2


@dataclass(frozen=True, slots=True)
class Shape:
    """Lines and areas: ``rings`` are closed (even-odd filled) or, when ``open``, lines."""

    rings: tuple[tuple[Point2, ...], ...]
    fill: str = ""
    line: str = ""
    width: float = 1.0
    opacity: float = 1.0
    dash: tuple[float, float] | None = None
    open: bool = False


@dataclass(frozen=True, slots=True)
class Disc:
    """A filled circle with an outline."""

    centre: Point2
    radius: float
    fill: str
    line: str = ""
    width: float = 1.0


@dataclass(frozen=True, slots=True)
class Words:
    """A text around or beside ``at``; ``turn`` is counter-clockwise on the page [degrees].

    ``centred`` texts have their middle at ``at``, others their base line. With a ``halo`` colour
    a text stays readable on whatever lies below.
    """

    at: Point2
    text: str
    size: float
    colour: str
    anchor: Literal["start", "middle", "end"] = "middle"
    turn: float = 0.0
    bold: bool = False
    halo: str = ""
    centred: bool = False


Item: TypeAlias = Shape | Disc | Words


@dataclass(frozen=True, slots=True)
class Group:
    """Items that belong together, by name."""

    name: str
    items: tuple[Item, ...]


@dataclass(slots=True)
class Figure:
    """A page of ``width`` by ``height``; ``title`` is read out where pictures are not seen."""

    width: float
    height: float
    background: str
    title: str
    about: str
    groups: list[Group] = field(default_factory=list)

    def add(self, name: str, items: list[Item]) -> None:
        """Paint ``items`` over what is already there."""
        if items:
            self.groups.append(Group(name, tuple(items)))
