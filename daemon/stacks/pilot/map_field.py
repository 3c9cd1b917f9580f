"""The map as distance fields: what localisation matches against and the planner steers by."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daemon.stacks.kernels import Singles, distance_transform
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid

_BORDER = 2
"""Unknown cells kept around the known part of the map."""


@dataclass(frozen=True, slots=True, eq=False)
class MapField:
    """Distance fields over the known part of a map, (rows, columns), float32, in metres.

    The lower-left corner of cell (0, 0) lies at (``x``, ``y``). ``surface`` is the signed
    distance of a cell centre to the painted surface of the walls: positive outside occupied
    cells, negative inside, zero on the edge between the last free and the first occupied cell,
    which is where a laser sees the wall. ``clearance`` is the distance to the nearest cell that
    is not free, 0 in such cells.
    """

    resolution: float
    x: float
    y: float
    surface: Singles
    clearance: Singles

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return the (row, column) that holds a point; may lie outside the field."""
        row = math.floor((y - self.y) / self.resolution)
        return row, math.floor((x - self.x) / self.resolution)

    def inside(self, row: int, column: int) -> bool:
        """Tell whether a cell belongs to the field."""
        rows, columns = self.clearance.shape
        return bool(0 <= row < rows and 0 <= column < columns)


def map_field(grid: OccupancyGrid) -> MapField:
    """Prepare the distance fields of ``grid``; raises ``ValueError`` for a map without free cells.

    Distances run between cell centres, so the surface lies half a cell before the first centre on
    the other side.
    """
    rows, columns = _known_part(grid)
    cells = grid.cells[rows, columns]
    half = np.float32(0.5)
    to_occupied = distance_transform((cells == OCCUPIED).astype(np.uint8))
    to_free = distance_transform((cells == FREE).astype(np.uint8))
    to_blocked = distance_transform((cells != FREE).astype(np.uint8))
    surface = np.where(cells == OCCUPIED, half - to_free, to_occupied - half)
    clearance = np.maximum(to_blocked - half, np.float32(0.0))
    scale = np.float32(grid.resolution)
    return MapField(
        resolution=grid.resolution,
        x=grid.x + columns.start * grid.resolution,
        y=grid.y + rows.start * grid.resolution,
        surface=(surface * scale).astype(np.float32),
        clearance=(clearance * scale).astype(np.float32),
    )


def _known_part(grid: OccupancyGrid) -> tuple[slice, slice]:
    """Return the rows and columns that hold all free cells and the walls around them."""
    free = grid.cells == FREE
    if not free.any():
        raise ValueError("the map has no free cell: nothing can be planned on it")
    known = (grid.cells == OCCUPIED) | free
    return _extent(known.any(axis=1)), _extent(known.any(axis=0))


def _extent(used: np.ndarray) -> slice:
    indices = np.flatnonzero(used)
    return slice(max(0, int(indices[0]) - _BORDER), int(indices[-1]) + 1 + _BORDER)
