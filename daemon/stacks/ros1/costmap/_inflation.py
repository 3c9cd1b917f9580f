"""What an obstacle costs at a distance, and kernels that write it around lethal cells.

Costs follow costmap_2d's ``inflation_layer``: by the Euclidean distance between cell centres from
the nearest lethal cell. The original finds that cell by passing sources on to the four neighbours,
which beside slanted walls yields the second nearest in places: on the published maps of building
C in one inflated cell of 72 to 248, depending on the parameters, whose cost is then up to nine
units lower. Here it is always the nearest; the original's order, which takes much longer to
follow, is in ``_inflation_queue.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import INSCRIBED, LETHAL, NO_INFORMATION
from daemon.stacks.ros1.costmap._obstacle_layer import Cells, cell_value

MAX_RADIUS = 250
"""Greatest inflation radius in cells: distances are kept in bytes."""


@dataclass(frozen=True, slots=True, eq=False)
class InflationTable:
    """``costs`` by squared distance [cells^2] out to ``radius`` [cells], which is inclusive.

    ``widths`` is the half width of the disc in each row off its centre; costs from ``least`` on
    are written over unknown cells.
    """

    radius: int
    costs: Cells
    widths: Integers
    least: int


def inflation_table(
    radius: float, scaling: float, inscribed: float, resolution: float, *, over_unknown: bool
) -> InflationTable:
    """Tabulate costs for an inflation ``radius`` [m] about a robot's ``inscribed`` radius [m].

    254 at the obstacle, 253 up to the inscribed radius, then 252 exp(-scaling (d - inscribed)),
    truncated. Raises ``ValueError`` for a radius of more than 250 cells.
    """
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
    return InflationTable(cells, costs, widths, 1 if over_unknown else INSCRIBED)


def _cost(distance: float, scaling: float, inscribed: float, resolution: float) -> int:
    if distance == 0.0:
        return LETHAL
    away = distance * resolution
    if away <= inscribed:
        return INSCRIBED
    return int((INSCRIBED - 1) * math.exp(-scaling * (away - inscribed)))


# Unknown is the largest value and no cost: over it go all costs with inflate_unknown, otherwise
# those of the inscribed radius and nearer (costmap_2d ``InflationLayer::updateCosts``).
@kernel
def combine_costs(old: int, cost: int, least: int) -> int:
    """Return a cell's value after an obstacle's ``cost`` reached it."""
    if old == NO_INFORMATION:
        return cost if cost >= least else old
    return max(old, cost)


@kernel
def grow_window(changed: Integers, x: int, y: int) -> None:
    """Extend the half-open window ``changed`` to hold a cell."""
    changed[0], changed[1] = min(changed[0], x), min(changed[1], y)
    changed[2], changed[3] = max(changed[2], x + 1), max(changed[3], y + 1)


@kernel
def stamp_costs(
    master: Cells,
    shape: tuple[int, int],
    x: int,
    y: int,
    costs: Cells,
    widths: Integers,
    least: int,
    changed: Integers,
) -> None:
    """Write the costs around one lethal cell."""
    rows, columns = shape
    radius = widths.shape[0] - 1
    for r in range(max(0, y - radius), min(rows, y + radius + 1)):
        up2 = (r - y) * (r - y)
        width = widths[abs(r - y)]
        for c in range(max(0, x - width), min(columns, x + width + 1)):
            cell = r * columns + c
            old = cell_value(master, cell)
            new = combine_costs(old, cell_value(costs, up2 + (c - x) * (c - x)), least)
            if new != old:
                master[cell] = new
                grow_window(changed, c, r)


@kernel
def inflate(
    master: Cells,
    shape: tuple[int, int],
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    costs: Cells,
    widths: Integers,
    least: int,
    changed: Integers,
) -> None:
    """Write costs around the lethal cells of the half-open window (x0, y0, x1, y1) and beyond it.

    A lethal cell between four others is nobody's nearest and is passed over.
    """
    columns = shape[1]
    if widths.shape[0] < 2:
        return
    for r in range(y0, y1):
        for c in range(x0, x1):
            cell = r * columns + c
            if master[cell] != LETHAL:
                continue
            inner = r > y0 and r + 1 < y1 and c > x0 and c + 1 < x1
            if (
                inner
                and master[cell - 1] == LETHAL
                and master[cell + 1] == LETHAL
                and master[cell - columns] == LETHAL
                and master[cell + columns] == LETHAL
            ):
                continue
            stamp_costs(master, shape, c, r, costs, widths, least, changed)


@kernel
def column_gaps(master: Cells, shape: tuple[int, int], radius: int, gaps: Cells) -> None:
    """Write each cell's distance to the nearest lethal cell of its column, at most radius + 1."""
    rows, columns = shape
    far = radius + 1
    for c in range(columns):
        gaps[c] = 0 if master[c] == LETHAL else far
    for cell in range(columns, rows * columns):
        gaps[cell] = 0 if master[cell] == LETHAL else min(far, cell_value(gaps, cell - columns) + 1)
    for cell in range((rows - 1) * columns - 1, -1, -1):
        gaps[cell] = min(cell_value(gaps, cell), cell_value(gaps, cell + columns) + 1)


@kernel
def close_gaps(gaps: Cells, shape: tuple[int, int], x: int, y: int, radius: int) -> None:
    """Keep the column distances true when the cell becomes lethal."""
    rows, columns = shape
    for r in range(max(0, y - radius), min(rows, y + radius + 1)):
        cell = r * columns + x
        gaps[cell] = min(cell_value(gaps, cell), abs(r - y))


@kernel
def open_gaps(gaps: Cells, shape: tuple[int, int], x: int, y: int, radius: int) -> None:
    """Keep the column distances true when the cell stops being lethal."""
    rows, columns = shape
    below, above = y - 1, y + 1
    lowest, highest = max(-1, y - 2 * radius - 1), min(rows, y + 2 * radius + 1)
    while below > lowest and gaps[below * columns + x] != 0:
        below -= 1
    while above < highest and gaps[above * columns + x] != 0:
        above += 1
    # Cells up to one radius away lose this one as their nearest, and to them the next one matters
    # up to one radius further.
    # Where the search ended without a lethal cell, none is near enough to matter.
    under, over = below > lowest, above < highest
    for r in range(max(below + 1, y - radius), min(above, y + radius + 1)):
        gap = radius + 1
        if under:
            gap = min(gap, r - below)
        if over:
            gap = min(gap, above - r)
        gaps[r * columns + x] = gap


@kernel
def cost_at(gaps: Cells, shape: tuple[int, int], x: int, y: int, costs: Cells, radius: int) -> int:
    """Return the cost of the nearest lethal cell, 0 beyond the inflation radius."""
    columns = shape[1]
    row = y * columns
    none = radius * radius + 1
    gap = cell_value(gaps, row + x)
    best = min(none, gap * gap)
    for k in range(1, radius + 1):
        aside2 = k * k
        if aside2 >= best:
            break
        if x >= k:
            gap = cell_value(gaps, row + x - k)
            best = min(best, aside2 + gap * gap)
        if x + k < columns:
            gap = cell_value(gaps, row + x + k)
            best = min(best, aside2 + gap * gap)
    return cell_value(costs, best) if best < none else 0
