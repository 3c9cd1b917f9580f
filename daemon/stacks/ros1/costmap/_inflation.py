"""Costs of an obstacle by distance, and kernels that write them around lethal cells.

Costs follow costmap_2d's ``inflation_layer``: they depend on the Euclidean distance between cell
centres to the nearest lethal cell. The original passes sources on to the four neighbours, which
beside slanted walls sometimes yields the second nearest. On the published maps of building C that
is one inflated cell of 72 to 248, depending on the parameters, and its cost is up to nine units
lower. In :func:`inflate` the nearest cell always counts. The slower :func:`inflate_in_order` keeps
the order of the original: it begins with the lethal cells row by row and takes cells by increasing
distance, cells of equal distance in the order of their arrival. A cell keeps the obstacle it has at
its turn.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import INSCRIBED, LETHAL, NO_INFORMATION, Window
from daemon.stacks.ros1.costmap._grids import (
    Cells,
    Grid,
    Numbers,
    cell_value,
    grow_window,
    reach_of,
)
from daemon.stacks.ros1.costmap.layers import InflationLayer

MAX_RADIUS = 250
"""Greatest inflation radius [cells], because distances are bytes."""


class InflationTable(NamedTuple):
    """``costs`` by squared distance [cells^2] up to and including ``radius`` [cells].

    ``widths`` is the half width of the disc in each row from its centre. Costs from ``least`` on
    overwrite unknown cells.
    """

    radius: int
    costs: Cells
    widths: Integers
    least: int


def inflation_table(layer: InflationLayer, inscribed: float, resolution: float) -> InflationTable:
    """Tabulate costs about obstacles for a robot's ``inscribed`` radius [m].

    254 at the obstacle, 253 up to the inscribed radius, then 252 exp(-scaling (d - inscribed)),
    truncated. Raises ``ValueError`` for a radius of more than 250 cells.
    """
    radius, scaling = layer.inflation_radius, layer.cost_scaling_factor
    cells = int(max(0.0, math.ceil(radius / resolution)))
    if cells > MAX_RADIUS:
        raise ValueError(
            f"inflation_radius {radius:g} m is {cells} cells of {resolution:g} m, at most "
            f"{MAX_RADIUS} are supported"
        )
    costs = np.zeros(cells * cells + 1, dtype=np.uint8)
    for i in range(cells + 1):
        for j in range(cells + 1):
            if i * i + j * j <= cells * cells:
                costs[i * i + j * j] = _cost(math.hypot(i, j), scaling, inscribed, resolution)
    rows = range(cells + 1)
    widths = np.array([math.isqrt(cells * cells - k * k) for k in rows], dtype=np.int32)
    return InflationTable(cells, costs, widths, 1 if layer.inflate_unknown else INSCRIBED)


def _cost(distance: float, scaling: float, inscribed: float, resolution: float) -> int:
    if distance == 0.0:
        return LETHAL
    away = distance * resolution
    if away <= inscribed:
        return INSCRIBED
    return int((INSCRIBED - 1) * math.exp(-scaling * (away - inscribed)))


# Unknown is the largest value and no cost. With inflate_unknown all costs overwrite it, otherwise
# only those within the inscribed radius (costmap_2d ``InflationLayer::updateCosts``).
@kernel
def combine_costs(old: int, cost: int, least: int) -> int:
    """Return a cell's value after an obstacle's ``cost`` reached it."""
    if old == NO_INFORMATION:
        return cost if cost >= least else old
    return max(old, cost)


@kernel
def stamp_costs(master: Grid, table: InflationTable, x: int, y: int, changed: Numbers) -> None:
    """Write the costs around one lethal cell."""
    rows, columns = master.frame.rows, master.frame.columns
    for r in range(max(0, y - table.radius), min(rows, y + table.radius + 1)):
        up2 = (r - y) * (r - y)
        width = int(np.int64(table.widths[abs(r - y)]))
        for c in range(max(0, x - width), min(columns, x + width + 1)):
            cell = r * columns + c
            old = cell_value(master.cells, cell)
            cost = cell_value(table.costs, up2 + (c - x) * (c - x))
            new = combine_costs(old, cost, table.least)
            if new != old:
                master.cells[cell] = new
                grow_window(changed, c, r)


@kernel
def inflate(master: Grid, table: InflationTable, window: Window, changed: Numbers) -> None:
    """Write costs in a window and around it, for the lethal cells that reach into it.

    A lethal cell between four others is never the nearest and is skipped. ``changed`` grows by
    the written cells.
    """
    cells, columns = master.cells, master.frame.columns
    x0, y0, x1, y1 = reach_of(window, table.radius, master.frame)
    for r in range(y0, y1):
        for c in range(x0, x1):
            cell = r * columns + c
            if cells[cell] != LETHAL:
                continue
            inner = r > y0 and r + 1 < y1 and c > x0 and c + 1 < x1
            if (
                inner
                and cells[cell - 1] == LETHAL
                and cells[cell + 1] == LETHAL
                and cells[cell - columns] == LETHAL
                and cells[cell + columns] == LETHAL
            ):
                continue
            stamp_costs(master, table, c, r, changed)


@kernel
def column_gaps(master: Grid, radius: int, gaps: Cells) -> None:
    """Write each cell's distance to the nearest lethal cell of its column, at most radius + 1."""
    cells, rows, columns = master.cells, master.frame.rows, master.frame.columns
    far = radius + 1
    for c in range(columns):
        gaps[c] = 0 if cells[c] == LETHAL else far
    for cell in range(columns, rows * columns):
        gaps[cell] = 0 if cells[cell] == LETHAL else min(far, cell_value(gaps, cell - columns) + 1)
    for cell in range((rows - 1) * columns - 1, -1, -1):
        gaps[cell] = min(cell_value(gaps, cell), cell_value(gaps, cell + columns) + 1)


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
    """Write costs in a window and around it, as :func:`inflate` does."""
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
