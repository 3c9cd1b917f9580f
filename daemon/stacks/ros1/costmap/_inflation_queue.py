"""Inflation in the order of costmap_2d's queue: the first obstacle decides the cost of a cell.

``InflationLayer::updateCosts`` passes obstacles on from a cell to its four neighbours. It begins
with the lethal cells row by row and takes cells by increasing distance, cells of equal distance in
the order of their arrival. A cell keeps the obstacle it has at its turn, which beside slanted walls
is sometimes the second nearest.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import LETHAL, Window
from daemon.stacks.ros1.costmap._grids import (
    Grid,
    Numbers,
    cell_value,
    grow_window,
    reach_of,
)
from daemon.stacks.ros1.costmap._inflation import InflationTable, combine_costs

# The offset of a cell from its obstacle, columns and rows, is stored in one number.
_ZERO: Final = 512
_COLUMN_BITS, _ROW_MASK = 16, 0xFFFF
_UNREACHED: Final = -1
_OFF_GRID: Final = -2
_AT_OBSTACLE: Final = (_ZERO << _COLUMN_BITS) | _ZERO


@kernel
def _offset(u: int, v: int) -> int:
    """Return the number for a cell ``u`` columns and ``v`` rows from its obstacle."""
    return ((u + _ZERO) << _COLUMN_BITS) | (v + _ZERO)


@kernel
def _columns(offset: int) -> int:
    return (offset >> _COLUMN_BITS) - _ZERO


@kernel
def _rows(offset: int) -> int:
    return (offset & _ROW_MASK) - _ZERO


@kernel
def _squared(offset: int) -> int:
    u, v = _columns(offset), _rows(offset)
    return u * u + v * v


@kernel
def _wait(bins: Integers, links: Integers, squared: int, cell: int) -> None:
    """Append a cell to the bin of a squared distance.

    ``bins`` (2, n) holds the first and the last cell of each bin, ``links`` (2, cells) the next
    and the previous cell of each waiting cell, or -1.
    """
    last = bins[1, squared]
    links[0, cell], links[1, cell] = -1, last
    if last < 0:
        bins[0, squared] = cell
    else:
        links[0, last] = cell
    bins[1, squared] = cell


@kernel
def _leave(bins: Integers, links: Integers, squared: int, cell: int) -> None:
    """Remove a waiting cell from its bin."""
    following, previous = links[0, cell], links[1, cell]
    if previous < 0:
        bins[0, squared] = following
    else:
        links[0, previous] = following
    if following < 0:
        bins[1, squared] = previous
    else:
        links[1, following] = previous


@kernel
def inflate_in_order(master: Grid, table: InflationTable, window: Window, changed: Numbers) -> None:
    """Write costs in a window and around it, as :func:`._inflation.inflate` does."""
    rows, columns, radius = master.frame.rows, master.frame.columns, table.radius
    x0, y0, x1, y1 = reach_of(window, radius, master.frame)
    left, low = max(0, x0 - radius), max(0, y0 - radius)
    right, high = min(columns, x1 + radius), min(rows, y1 + radius)
    width = right - left + 2
    size = (high - low + 2) * width
    # A frame of one cell around the reach of the window saves checks for its edges.
    offsets = np.empty(size, dtype=np.int32)
    offsets[:] = _OFF_GRID
    links = np.empty((2, size), dtype=np.int32)
    farthest = radius * radius
    bins = np.empty((2, farthest + 1), dtype=np.int32)
    bins[:] = -1
    for r in range(low, high):
        place, cell = r * columns + left, (r - low + 1) * width + 1
        for c in range(left, right):
            if master.cells[place] == LETHAL and x0 <= c < x1 and y0 <= r < y1:
                offsets[cell] = _AT_OBSTACLE
                _wait(bins, links, int(np.int64(0)), cell)
            else:
                offsets[cell] = _UNREACHED
            place += 1
            cell += 1
    for squared in range(farthest + 1):
        cell = bins[0, squared]
        while cell >= 0:
            r, c = cell // width - 1 + low, cell % width - 1 + left
            place = r * columns + c
            old = cell_value(master.cells, place)
            new = combine_costs(old, cell_value(table.costs, squared), table.least)
            if new != old:
                master.cells[place] = new
                grow_window(changed, c, r)
            x, y = _columns(offsets[cell]), _rows(offsets[cell])
            for turn in range(4):
                if turn == 0:
                    neighbour, u, v = cell - 1, x - 1, y
                elif turn == 1:
                    neighbour, u, v = cell - width, x, y - 1
                elif turn == 2:
                    neighbour, u, v = cell + 1, x + 1, y
                else:
                    neighbour, u, v = cell + width, x, y + 1
                away2 = u * u + v * v
                other = offsets[neighbour]
                # A finished bin takes no more cells.
                if away2 <= squared or away2 > farthest or other == _OFF_GRID:
                    continue
                # In the original a cell may wait several times, and the nearest bin counts.
                if other != _UNREACHED:
                    other2 = _squared(other)
                    if other2 <= away2:
                        continue
                    _leave(bins, links, other2, neighbour)
                offsets[neighbour] = _offset(u, v)
                _wait(bins, links, away2, neighbour)
            cell = links[0, cell]
