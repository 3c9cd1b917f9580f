"""Kernels that update a master grid: all cells inside the bounds, or changed cells only.

Both give the same cells. Layers are merged cell by cell, in their order. After an update of
costmap_2d, a cell inside the bounds depends on its merged value and on the lethal cells within the
inflation radius. Outside the bounds costs only rise. Following changes requires that the inflation
is the topmost layer and that the nearest lethal cell decides, in any order.

Before :func:`follow_changes`, :func:`list_disturbed` and :func:`list_overdue` complete the list.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import LETHAL, NO_INFORMATION, Window
from daemon.stacks.ros1.costmap._grids import (
    LISTED,
    LOW,
    OVERDUE,
    QUEUED,
    STALE,
    WRITTEN,
    Cells,
    Changes,
    Grid,
    Numbers,
    cell_value,
    grow_window,
    list_cell,
    reach_of,
)
from daemon.stacks.ros1.costmap._inflation import InflationTable, combine_costs, stamp_costs

# Ways to merge a layer over the cells below it; numbers as in ``combination_method``.
OVERWRITE, MAXIMUM, NOTHING, REPLACE = 0, 1, 2, 3


class Layers(NamedTuple):
    """Cells (n, cells) and methods (n,) of layers, the lowest first, over cells of ``default``."""

    cells: Cells
    methods: Integers
    default: int


class Inflated(NamedTuple):
    """A master grid where the nearest lethal cell decides the cost of each cell.

    ``gaps`` are the distances [cells] to the nearest lethal cell of the column.
    """

    grid: Grid
    table: InflationTable
    gaps: Cells


@kernel
def merge_cell(below: int, own: int, method: int) -> int:
    """Return a cell's value after merging a layer with the value ``own`` over it.

    Unknown is the least value of a maximum and overwrites nothing, except with ``REPLACE``
    (``CostmapLayer::updateWithMax``, ``updateWithOverwrite``, ``updateWithTrueOverwrite``).
    """
    if method == REPLACE:
        return own
    if own == NO_INFORMATION or method == NOTHING:
        return below
    if method == OVERWRITE or below == NO_INFORMATION:
        return own
    return max(below, own)


@kernel
def merge_window(master: Grid, layers: Layers, window: Window) -> None:
    """Merge the layers over a window of the master."""
    columns = master.frame.columns
    for r in range(window[1], window[3]):
        for cell in range(r * columns + window[0], r * columns + window[2]):
            value = cell_value(master.cells, cell)
            for n in range(layers.methods.shape[0]):
                own = int(np.int64(layers.cells[n, cell]))
                value = merge_cell(value, own, layers.methods[n])
            master.cells[cell] = value


@kernel
def _close_gaps(master: Inflated, x: int, y: int) -> None:
    """Update the column distances for a cell that becomes lethal."""
    radius = master.table.radius
    for r in range(max(0, y - radius), min(master.grid.frame.rows, y + radius + 1)):
        cell = r * master.grid.frame.columns + x
        master.gaps[cell] = min(cell_value(master.gaps, cell), abs(r - y))


@kernel
def _open_gaps(master: Inflated, changes: Changes, x: int, y: int) -> None:
    """Update the column distances for a cell that is no longer lethal.

    Lists the cells whose cost may come from it.
    """
    grid, gaps, radius = master.grid, master.gaps, master.table.radius
    rows, columns = grid.frame.rows, grid.frame.columns
    below, above = y - 1, y + 1
    lowest, highest = max(-1, y - 2 * radius - 1), min(rows, y + 2 * radius + 1)
    while below > lowest and gaps[below * columns + x] != 0:
        below -= 1
    while above < highest and gaps[above * columns + x] != 0:
        above += 1
    # Cells up to one radius away lose this one as their nearest; the next one matters to them up to
    # one radius further. If the search ends without a lethal cell, none is near enough to matter.
    under, over = below > lowest, above < highest
    for r in range(max(below + 1, y - radius), min(above, y + radius + 1)):
        gap = radius + 1
        if under:
            gap = min(gap, r - below)
        if over:
            gap = min(gap, above - r)
        gaps[r * columns + x] = gap
    for r in range(max(0, y - radius), min(rows, y + radius + 1)):
        up2 = (r - y) * (r - y)
        width = int(np.int64(master.table.widths[abs(r - y)]))
        for c in range(max(0, x - width), min(columns, x + width + 1)):
            cost = master.table.costs[up2 + (c - x) * (c - x)]
            if cost > 0 and grid.cells[r * columns + c] == cost:
                list_cell(changes, r * columns + c, STALE)


@kernel
def list_disturbed(master: Inflated, changes: Changes, window: Window) -> None:
    """List the cells of a window in which others wrote the master.

    A lethal cell that move_base or navfn freed leaves costs around it, which only this update
    corrects.
    """
    for y in range(window[1], window[3]):
        for x in range(window[0], window[2]):
            cell = y * master.grid.frame.columns + x
            list_cell(changes, cell, WRITTEN)
            if master.gaps[cell] == 0 and master.grid.cells[cell] != LETHAL:
                _open_gaps(master, changes, x, y)


@kernel
def list_overdue(master: Inflated, changes: Changes, window: Window) -> None:
    """List cells within reach that earlier updates flagged outside their windows."""
    frame, radius = master.grid.frame, master.table.radius
    reach = reach_of(window, radius, frame)
    for y in range(max(0, reach[1] - radius), min(frame.rows, reach[3] + radius)):
        for x in range(max(0, reach[0] - radius), min(frame.columns, reach[2] + radius)):
            cell = y * frame.columns + x
            if changes.flags[cell] != 0:
                list_cell(changes, cell, changes.flags[cell])


@kernel
def _cost_at(gaps: Cells, columns: int, x: int, y: int, costs: Cells, radius: int) -> int:
    """Return the cost of the nearest lethal cell, 0 beyond the inflation radius."""
    cell = y * columns + x
    none = radius * radius + 1
    gap = cell_value(gaps, cell)
    best = min(none, gap * gap)
    for k in range(1, radius + 1):
        aside2 = k * k
        if aside2 >= best:
            break
        if x >= k:
            gap = cell_value(gaps, cell - k)
            best = min(best, aside2 + gap * gap)
        if x + k < columns:
            gap = cell_value(gaps, cell + k)
            best = min(best, aside2 + gap * gap)
    return cell_value(costs, best) if best < none else 0


@kernel
def _cost_from(master: Inflated, reach: Window, x: int, y: int) -> int:
    """Return the greatest cost of a cell from the lethal cells of a window."""
    table = master.table
    most = 0
    for r in range(max(reach[1], y - table.radius), min(reach[3], y + table.radius + 1)):
        up2 = (r - y) * (r - y)
        width = int(np.int64(table.widths[abs(r - y)]))
        for c in range(max(reach[0], x - width), min(reach[2], x + width + 1)):
            if master.gaps[r * master.grid.frame.columns + c] == 0:
                most = max(most, cell_value(table.costs, up2 + (c - x) * (c - x)))
    return most


@kernel
def follow_changes(
    master: Inflated,
    layers: Layers,
    changes: Changes,
    window: Window,
    values: Cells,
    changed: Numbers,
) -> None:
    """Merge and inflate the listed cells as for the whole window, and empty the list.

    ``values`` is scratch for their merged values. Cells outside the window keep their flags: there
    costmap_2d only raises costs, by inflation from in and around the window. ``changed`` grows
    tightly around cells whose cost changed.
    """
    grid, table, gaps = master
    flags, columns = changes.flags, grid.frame.columns
    x0, y0, x1, y1 = window
    # The list grows during this loop: column gaps must be right for all lethal cells before the
    # first cost is computed.
    done = 0
    while done < changes.counts[QUEUED]:
        cell = int(np.int64(changes.queue[done]))
        y, x = cell // columns, cell % columns
        if x0 <= x < x1 and y0 <= y < y1:
            value = layers.default
            for n in range(layers.methods.shape[0]):
                value = merge_cell(value, int(np.int64(layers.cells[n, cell])), layers.methods[n])
            values[done] = value
            if value == LETHAL and gaps[cell] != 0:
                _close_gaps(master, x, y)
                stamp_costs(grid, table, x, y, changed)
            elif value != LETHAL and gaps[cell] == 0:
                _open_gaps(master, changes, x, y)
        done += 1
    reach = reach_of(window, table.radius, grid.frame)
    for k in range(done):
        cell = int(np.int64(changes.queue[k]))
        y, x = cell // columns, cell % columns
        old = cell_value(grid.cells, cell)
        new = old
        if x0 <= x < x1 and y0 <= y < y1:
            flags[cell] = 0
            cost = _cost_at(gaps, columns, x, y, table.costs, table.radius)
            new = combine_costs(cell_value(values, k), cost, table.least)
        else:
            flags[cell] = flags[cell] & ~LISTED
            changes.counts[OVERDUE] += 1
            if flags[cell] & LOW:
                new = combine_costs(old, _cost_from(master, reach, x, y), table.least)
        if new != old:
            grid.cells[cell] = new
            grow_window(changed, x, y)
    changes.counts[QUEUED] = 0
