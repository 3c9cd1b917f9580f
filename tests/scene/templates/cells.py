"""Where a point lies in a map, and what can be reached from there."""

import math

import numpy as np

from grammars.model.grid import OCCUPIED


def cell(grid, point):
    return (
        math.floor((point[1] - grid.y) / grid.resolution),
        math.floor((point[0] - grid.x) / grid.resolution),
    )


def flooded(grid, start):
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
