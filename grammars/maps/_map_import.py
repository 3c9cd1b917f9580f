"""What may be chosen about making a building from a map, and what is said about one made."""

from __future__ import annotations

from dataclasses import dataclass

from grammars.maps.model import DrawnBuilding
from grammars.model.geometry import Point2


@dataclass(frozen=True, slots=True)
class ImportSettings:
    """How a building is made from a map.

    ``tolerance`` is the largest distance between a border of cells and the line drawn for it
    [cells, at least 0.4]; ``specks`` the fewest cells that are more than noise; ``least_room`` the
    smallest piece of floor that is kept [m²]; ``height`` that of the walls and ``door_height`` that
    of the doorways [m], of which a map says nothing. Gaps between walls from ``narrowest`` to
    ``widest`` [m] become doorways if ``doorways`` says so.
    """

    name: str = "building"
    tolerance: float = 1.0
    specks: int = 4
    least_room: float = 1.0
    height: float = 2.5
    doorways: bool = True
    door_height: float = 2.0
    narrowest: float = 0.7
    widest: float = 1.3


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What was found on a map, and how far the building is from it.

    ``largest_error`` is the greatest distance between a corner of the cells and the line drawn for
    it, in cells; ``directions`` are the main directions of the walls [rad]. Areas are in m²:
    ``floor`` of all spaces, ``dropped_floor`` of pockets that were left out. ``dropped_walls`` and
    ``filled_cells`` count cells that were taken for noise. Floor ends without a wall along
    ``open_border`` [m], the longest piece of which has its middle at ``widest_opening`` [m].
    """

    resolution: float
    width: float
    depth: float
    spaces: int
    walls: int
    corners: int
    doorways: int
    floor: float
    largest_error: float
    directions: tuple[float, ...]
    dropped_floor: float
    dropped_walls: int
    filled_cells: int
    open_border: float
    widest_opening: Point2 | None


@dataclass(frozen=True, slots=True)
class ImportedMap:
    """A building made from a map, and how it was made."""

    building: DrawnBuilding
    report: ImportReport


class EmptyMapError(ValueError):
    """A map without a single free cell."""
