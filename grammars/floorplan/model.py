"""Compiled floor plan: world-frame geometry of spaces, walls, features and openings.

Frames follow the FloorPlan language: a wall's frame is at the middle of its inner edge, x along
the edge, y through the thickness (outwards for clockwise rooms), z up. Frames have published
identifiers: ``<space>-frame``, ``<space>-wall-<i>-frame``, ``<kind>-<id>-frame`` of features and
openings. The frame of an opening lies on the floor. Units are metres and radians.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

from grammars.model.geometry import Point2, Pose2, Ring
from grammars.text.diagnostics import Finding, Where

Point3: TypeAlias = tuple[float, float, float]
NOWHERE = Where("<unknown>")
WALLS_ENDING: Final = ".walls.yaml"
"""Ending of the file name of every walls layer (:mod:`grammars.maps`)."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Placement of an element: its outline in its own frame, and that frame against another.

    ``of`` and ``wrt`` are published frame identifiers. ``of`` is a frame of the element itself; a
    space may be placed by one of its walls. ``offset`` is the transform ``of`` -> ``wrt``, its yaw
    not wrapped. ``outline`` lies on the floor (z = 0); the outline of an opening is its near ring
    before it is lifted and tilted.
    """

    of: str
    wrt: str
    offset: Pose2
    outline: tuple[Point3, ...]


@dataclass(frozen=True, slots=True)
class Wall:
    """One thickened edge of a space's outline; openings do not cut its ``footprint``.

    Corners of ``footprint``: outer start, outer end, inner end, inner start.
    """

    space: str
    index: int
    frame: Pose2
    length: float
    thickness: float
    height: float
    footprint: Ring

    @property
    def id(self) -> str:
        """Published identifier, ``<space>-wall-<index>``."""
        return f"{self.space}-wall-{self.index}"


@dataclass(frozen=True, slots=True)
class Space:
    """Room, corridor or hall with its walls; ``outline`` is the clear floor area.

    A space of a walls layer has no walls of its own. It may have ``holes``: rings inside the
    outline that are not floor.
    """

    name: str
    frame: Pose2
    outline: Ring
    walls: tuple[Wall, ...]
    where: Where = field(default=NOWHERE, compare=False)
    placement: Placement | None = field(default=None, compare=False)
    holes: tuple[Ring, ...] = ()


@dataclass(frozen=True, slots=True)
class Feature:
    """Column or divider on the floor; ``space`` is empty for a top-level feature.

    ``id`` is unique in the plan: the name if it is unique, otherwise ``<space>-<name>``. In a walls
    layer walls are features too (kind ``wall``, ``footprint`` as drawn), and features may have
    ``holes``.
    """

    kind: Literal["column", "divider", "wall"]
    id: str
    name: str
    space: str
    frame: Pose2
    footprint: Ring
    height: float
    where: Where = field(default=NOWHERE, compare=False)
    placement: Placement | None = field(default=None, compare=False)
    holes: tuple[Ring, ...] = ()


@dataclass(frozen=True, slots=True)
class Opening:
    """Entryway or window: a prism cut through one or two walls.

    In a walls layer an entryway is a gap between walls and lists no walls.

    ``frame`` is the opening's frame projected on the floor (x along the first wall, y through
    it), ``z`` its height above the floor and ``tilt`` its rotation about y. ``near`` and ``far``
    are the world-frame rings of the prism; ``footprint`` is its outline from above.
    """

    kind: Literal["entryway", "window"]
    id: str
    name: str
    walls: tuple[str, ...]
    frame: Pose2
    z: float
    tilt: float
    depth: float
    near: tuple[Point3, ...]
    far: tuple[Point3, ...]
    footprint: Ring
    where: Where = field(default=NOWHERE, compare=False)
    placement: Placement | None = field(default=None, compare=False)

    @property
    def z_min(self) -> float:
        """Lowest point of the opening above the floor [m]."""
        return min(p[2] for p in self.near)

    @property
    def z_max(self) -> float:
        """Highest point of the opening above the floor [m]."""
        return max(p[2] for p in self.near)

    @property
    def width(self) -> float:
        """Extent along the wall [m]."""
        local = [self.frame.inverse().apply((p[0], p[1]))[0] for p in self.near]
        return max(local) - min(local)

    @property
    def centre(self) -> Point2:
        """Centre of the footprint in the world frame."""
        n = len(self.footprint)
        return (sum(p[0] for p in self.footprint) / n, sum(p[1] for p in self.footprint) / n)


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Whole plan in one world frame, with its elements in source order."""

    name: str
    spaces: tuple[Space, ...]
    features: tuple[Feature, ...]
    openings: tuple[Opening, ...]
    warnings: tuple[Finding, ...] = field(default=(), compare=False)

    @property
    def walls(self) -> tuple[Wall, ...]:
        """Every wall of every space, in source order."""
        return tuple(wall for space in self.spaces for wall in space.walls)


WORLD_FRAME = "world-frame"
"""Published identifier of the world frame."""
