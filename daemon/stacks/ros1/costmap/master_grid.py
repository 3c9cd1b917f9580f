"""Kernels that bring a master grid up to date: in full inside its bounds, or only what changed.

Both leave the same cells. What an update of costmap_2d does to a cell inside the bounds depends
on the layers and on the lethal cells within the inflation radius of it; outside, costs only
rise.

The inflated map, from which every run starts, is worked out once per process for equal maps
and parameters.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import FREE_SPACE
from daemon.stacks.ros1.costmap._inflation import (
    InflationTable,
    close_gaps,
    column_gaps,
    combine_costs,
    cost_at,
    grow_window,
    inflate,
    open_gaps,
    stamp_costs,
)
from daemon.stacks.ros1.costmap._obstacle_layer import (
    LETHAL,
    LISTED,
    LOW,
    STALE,
    UNKNOWN,
    Cells,
    cell_value,
)
from grammars.model.geometry import Floats
from grammars.model.grid import OCCUPIED
from grammars.model.grid import UNKNOWN as UNKNOWN_IN_MAP

EVERYWHERE = float(np.finfo(np.float32).max)
"""Bounds of a map that is to be redone as a whole [m] (costmap_2d uses the same number)."""


@kernel
def bounds_to_window(
    bounds: Floats, shape: tuple[int, int], frame: Floats, window: Integers
) -> None:
    """Write the half-open window of cells that metric bounds touch, clipped to the grid.

    Empty bounds (lower above upper) make an empty window.
    """
    rows, columns = shape
    for k in range(4):
        size = columns if k % 2 == 0 else rows
        away = bounds[k] - frame[k % 2]
        if away < 0.0:
            cell = 0
        elif bounds[k] >= frame[2] * size + frame[k % 2]:
            cell = size - 1
        else:
            cell = int(away / frame[2])
        window[k] = cell if k < 2 else min(size, cell + 1)


@kernel
def cycle_window(
    bounds: Floats,
    last: Floats,
    radius: float,
    inflating: bool,
    everything: bool,
    shape: tuple[int, int],
    frame: Floats,
    window: Integers,
) -> None:
    """Let the inflation layer extend ``bounds`` [m] and write the window of cells to redo.

    It unites them with those of the ``last`` cycle and adds ``radius`` [m] on all sides; on
    ``everything`` it asks for the whole grid.
    """
    for k in range(4):
        if not inflating:
            break
        own = bounds[k]
        if everything:
            bounds[k] = -EVERYWHERE if k < 2 else EVERYWHERE
        elif k < 2:
            bounds[k] = min(last[k], own) - radius
        else:
            bounds[k] = max(last[k], own) + radius
        last[k] = own
    bounds_to_window(bounds, shape, frame, window)


@kernel
def _merge_layers(static: int, obstacle: int) -> int:
    """Return the layers' maximum, of which unknown is the least."""
    if obstacle == UNKNOWN:
        return static
    return obstacle if static == UNKNOWN else max(static, obstacle)


@kernel
def update_whole_window(
    master: Cells,
    static: Cells,
    layer: Cells,
    shape: tuple[int, int],
    window: Integers,
    costs: Cells,
    widths: Integers,
    least: int,
    changed: Integers,
) -> None:
    """Reset the window, merge the layers there and inflate around it, as costmap_2d does.

    ``static`` is what is there before the obstacle layer: the map, or the master's default.
    ``changed`` grows to the window and what was written around it.
    """
    rows, columns = shape
    x0, y0, x1, y1 = window[0], window[1], window[2], window[3]
    if x0 >= x1 or y0 >= y1:
        return
    for r in range(y0, y1):
        for cell in range(r * columns + x0, r * columns + x1):
            master[cell] = _merge_layers(cell_value(static, cell), cell_value(layer, cell))
    grow_window(changed, x0, y0)
    grow_window(changed, x1 - 1, y1 - 1)
    radius = widths.shape[0] - 1
    left, low = max(0, x0 - radius), max(0, y0 - radius)
    right, high = min(columns, x1 + radius), min(rows, y1 + radius)
    inflate(master, shape, left, low, right, high, costs, widths, least, changed)


@kernel
def _list_cell(flags: Cells, cell: int, flag: int, queue: Integers, queued: int) -> int:
    """Put a cell on the list unless it is there."""
    old = flags[cell]
    flags[cell] = old | flag | LISTED
    if old & LISTED:
        return queued
    queue[queued] = cell
    return queued + 1


@kernel
def _list_around(
    master: Cells,
    shape: tuple[int, int],
    x: int,
    y: int,
    costs: Cells,
    widths: Integers,
    flags: Cells,
    queue: Integers,
    queued: int,
    left: int,
) -> tuple[int, int]:
    """List the cells whose cost may come from a lethal cell that is gone.

    Returns how many are listed and how many flagged cells are not.
    """
    rows, columns = shape
    radius = widths.shape[0] - 1
    for r in range(max(0, y - radius), min(rows, y + radius + 1)):
        up2 = (r - y) * (r - y)
        width = widths[abs(r - y)]
        for c in range(max(0, x - width), min(columns, x + width + 1)):
            cell = r * columns + c
            cost = costs[up2 + (c - x) * (c - x)]
            if cost > 0 and master[cell] == cost:
                if flags[cell] != 0 and not flags[cell] & LISTED:
                    left -= 1
                queued = _list_cell(flags, cell, STALE, queue, queued)
    return queued, left


@kernel
def _cost_from(
    gaps: Cells,
    shape: tuple[int, int],
    x: int,
    y: int,
    box: tuple[int, int, int, int],
    costs: Cells,
    widths: Integers,
) -> int:
    """Return the greatest cost that lethal cells of ``box`` put on a cell."""
    radius = widths.shape[0] - 1
    most = 0
    for r in range(max(box[1], y - radius), min(box[3], y + radius + 1)):
        up2 = (r - y) * (r - y)
        width = widths[abs(r - y)]
        for c in range(max(box[0], x - width), min(box[2], x + width + 1)):
            if gaps[r * shape[1] + c] == 0:
                most = max(most, cell_value(costs, up2 + (c - x) * (c - x)))
    return most


@kernel
def update_changed_cells(
    master: Cells,
    static: Cells,
    layer: Cells,
    gaps: Cells,
    shape: tuple[int, int],
    window: Integers,
    disturbed: Integers,
    costs: Cells,
    widths: Integers,
    least: int,
    flags: Cells,
    queue: Integers,
    queued: int,
    left: int,
    changed: Integers,
) -> int:
    """Do what :func:`update_whole_window` does, in the time that changes take.

    ``queue[:queued]`` lists the cells whose layer value changed, ``disturbed`` is the window in
    which others wrote the master, ``gaps`` are the column distances to the master's lethal cells.
    ``left`` cells keep a flag from earlier updates because they lay outside the bounds; returns
    how many do now. ``changed`` grows tightly around cells whose cost changed.
    """
    rows, columns = shape
    radius = widths.shape[0] - 1
    x0, y0, x1, y1 = window[0], window[1], window[2], window[3]
    left_edge, right_edge = max(0, x0 - radius), min(columns, x1 + radius)
    low_edge, high_edge = max(0, y0 - radius), min(rows, y1 + radius)
    if x0 >= x1 or y0 >= y1:
        right_edge, high_edge = left_edge, low_edge
    box = (left_edge, low_edge, right_edge, high_edge)
    for y in range(disturbed[1], disturbed[3]):
        for x in range(disturbed[0], disturbed[2]):
            cell = y * columns + x
            if flags[cell] != 0 and not flags[cell] & LISTED:
                left -= 1
            queued = _list_cell(flags, cell, LOW | STALE, queue, queued)
            if gaps[cell] == 0 and master[cell] != LETHAL:
                open_gaps(gaps, shape, x, y, radius)
                queued, left = _list_around(
                    master, shape, x, y, costs, widths, flags, queue, queued, left
                )
    if left > 0:
        for y in range(max(0, box[1] - radius), min(rows, box[3] + radius)):
            for x in range(max(0, box[0] - radius), min(columns, box[2] + radius)):
                cell = y * columns + x
                if flags[cell] != 0 and not flags[cell] & LISTED:
                    left -= 1
                    queued = _list_cell(flags, cell, 0, queue, queued)
    done = 0
    while done < queued:
        cell = queue[done]
        done += 1
        y, x = cell // columns, cell % columns
        if x < x0 or x >= x1 or y < y0 or y >= y1:
            continue
        lethal = _merge_layers(cell_value(static, cell), cell_value(layer, cell)) == LETHAL
        if lethal and gaps[cell] != 0:
            close_gaps(gaps, shape, x, y, radius)
            stamp_costs(master, shape, x, y, costs, widths, least, changed)
        elif not lethal and gaps[cell] == 0:
            open_gaps(gaps, shape, x, y, radius)
            queued, left = _list_around(
                master, shape, x, y, costs, widths, flags, queue, queued, left
            )
    for k in range(queued):
        cell = queue[k]
        y, x = cell // columns, cell % columns
        old = cell_value(master, cell)
        if x0 <= x < x1 and y0 <= y < y1:
            flags[cell] = 0
            new = _merge_layers(cell_value(static, cell), cell_value(layer, cell))
            new = combine_costs(new, cost_at(gaps, shape, x, y, costs, radius), least)
        else:
            flags[cell] = flags[cell] & ~np.uint8(LISTED)
            left += 1
            new = old
            if flags[cell] & LOW:
                new = combine_costs(old, _cost_from(gaps, shape, x, y, box, costs, widths), least)
        if new != old:
            master[cell] = new
            grow_window(changed, x, y)
    return left


_KEPT_MAPS: Final = 4
_CACHE: OrderedDict[bytes, InflatedMap] = OrderedDict()


@dataclass(frozen=True, slots=True, eq=False)
class InflatedMap:
    """Flat, read-only: the ``static`` layer, the ``master`` it makes alone, its column ``gaps``."""

    static: Cells
    master: Cells
    gaps: Cells


def static_layer(cells: np.ndarray, unknown: int) -> Cells:
    """Return flat costs of map cells: occupied is lethal, unknown ``unknown``, the rest free."""
    costs = np.zeros(cells.shape, dtype=np.uint8)
    costs[cells == OCCUPIED] = LETHAL
    costs[cells == UNKNOWN_IN_MAP] = unknown
    return costs.ravel()


def inflated_map(
    static: Cells, shape: tuple[int, int], default: int, table: InflationTable
) -> InflatedMap:
    """Return what the master shows while the obstacle layer is full of ``default``."""
    digest = hashlib.blake2b(static.tobytes(), digest_size=16)
    digest.update(repr((shape, default, table.radius, table.least)).encode())
    digest.update(table.costs.tobytes())
    key = digest.digest()
    if key not in _CACHE:
        _CACHE[key] = _inflate_map(static, shape, default, table)
        if len(_CACHE) > _KEPT_MAPS:
            _CACHE.popitem(last=False)
    _CACHE.move_to_end(key)
    return _CACHE[key]


def _inflate_map(
    static: Cells, shape: tuple[int, int], default: int, table: InflationTable
) -> InflatedMap:
    master, gaps = np.zeros(static.size, np.uint8), np.empty(static.size, np.uint8)
    layer = np.full(static.size, default, dtype=np.uint8)
    whole = np.array([0, 0, shape[1], shape[0]], dtype=np.int32)
    changed = whole.copy()
    update_whole_window(
        master, static, layer, shape, whole, table.costs, table.widths, table.least, changed
    )
    column_gaps(master, shape, table.radius, gaps)
    for array in (master, gaps):
        array.flags.writeable = False
    return InflatedMap(static, master, gaps)


def unknown_value(tracked: bool | None) -> int:
    """Return what unknown cells of the map cost: the static layer tracks them unless told not."""
    return FREE_SPACE if tracked is False else UNKNOWN
