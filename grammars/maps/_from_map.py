"""A building from an occupancy map, without loading what that takes before it is wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from grammars.maps._map_import import ImportedMap, ImportSettings

if TYPE_CHECKING:
    from grammars.model.grid import OccupancyGrid


def vectorise(
    grid: OccupancyGrid, settings: ImportSettings | None = None, *, yaw: float = 0.0
) -> ImportedMap:
    """Return the building that a map shows.

    Free floor becomes spaces, occupied cells walls; both have their borders in common, and what is
    unknown is in neither. No corner of a cell on a border lies further from the line drawn for it
    than the tolerance. ``yaw`` [rad] turns the map about its origin. Equal maps, equal buildings.

    Raises :class:`EmptyMapError` for a map that shows no floor.
    """
    # With shapely, which campaigns that only read a layer do without.
    from grammars.maps._vectorise import building_of

    return building_of(grid, settings or ImportSettings(), yaw)
