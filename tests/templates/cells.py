"""Where a point lies in a map, and what can be reached from there."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Point2
from grammars.model.grid import OCCUPIED, OccupancyGrid


def cell(grid: OccupancyGrid, point: Point2) -> tuple[int, int]:
    return (
        math.floor((point[1] - grid.y) / grid.resolution),
        math.floor((point[0] - grid.x) / grid.resolution),
    )


def flooded(grid: OccupancyGrid, start: Point2) -> npt.NDArray[np.bool_]:
    """Return the cells connected to ``start`` (by their sides) that are not occupied."""
    passable = grid.cells != OCCUPIED
    reached = np.zeros_like(passable)
    front = [cell(grid, start)]
    while front:
        row, column = front.pop()
        inside = 0 <= row < passable.shape[0] and 0 <= column < passable.shape[1]
        if inside and passable[row, column] and not reached[row, column]:
            reached[row, column] = True
            front += [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
    return reached
