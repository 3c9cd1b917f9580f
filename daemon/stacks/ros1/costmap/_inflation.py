"""Costs of an obstacle by distance, and kernels that write them around lethal cells.

Costs follow costmap_2d's ``inflation_layer``: they depend on the Euclidean distance between cell
centres to the nearest lethal cell. The original passes sources on to the four neighbours, which
beside slanted walls sometimes yields the second nearest. On the published maps of building C that
is one inflated cell of 72 to 248, depending on the parameters, and its cost is up to nine units
lower. Here the nearest cell always counts. The slower order of the original is in
``_inflation_queue.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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
