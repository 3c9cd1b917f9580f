"""Kernels that bring a master grid up to date: in full inside its bounds, or only what changed.

Both leave the same cells. Layers are merged cell by cell, in their order; what an update of
costmap_2d does to a cell inside the bounds then depends on the merged value and on the lethal cells
within the inflation radius of it; outside, costs only rise. Only what changed can be followed where
nothing is merged after the inflation and the nearest lethal cell decides, whoever came first.

The inflated map, from which every run starts, is worked out once per process for equal maps
and parameters.
"""

from __future__ import annotations

import hashlib
import zlib
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import LETHAL, NO_INFORMATION
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
from daemon.stacks.ros1.costmap._inflation_queue import inflate_in_order
from daemon.stacks.ros1.costmap._obstacle_layer import LISTED, LOW, STALE, Cells, cell_value
from grammars.model.geometry import Floats

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
def extend_for_inflation(bounds: Floats, last: Floats, radius: float, everything: bool) -> None:
    """Let an inflation layer extend ``bounds`` [m].

    It unites them with those of the ``last`` cycle and adds ``radius`` [m] on all sides; on
    ``everything`` it asks for the whole grid.
    """
    for k in range(4):
        own = bounds[k]
        if everything:
            bounds[k] = -EVERYWHERE if k < 2 else EVERYWHERE
        elif k < 2:
            bounds[k] = min(last[k], own) - radius
        else:
            bounds[k] = max(last[k], own) + radius
        last[k] = own


# What a layer does to the cells below it; numbers as in ``combination_method``.
OVERWRITE, MAXIMUM, NOTHING, REPLACE = 0, 1, 2, 3


@kernel
def merge_cell(below: int, own: int, method: int) -> int:
    """Return a cell's value after a layer with the value ``own`` was merged over it.

    Unknown is the least value of a maximum, and writes over nothing; what replaces does so even
    where it is unknown (``CostmapLayer::updateWithMax``, ``updateWithOverwrite``,
    ``updateWithTrueOverwrite``).
    """
    if method == REPLACE:
        return own
    if own == NO_INFORMATION or method == NOTHING:
        return below
    if method == OVERWRITE or below == NO_INFORMATION:
        return own
    return max(below, own)


@kernel
def merged_value(layers: Cells, methods: Integers, default: int, cell: int) -> int:
    """Return what all ``layers`` (n, cells), the lowest first, make of one cell."""
    value = default
    for n in range(methods.shape[0]):
        value = merge_cell(value, int(np.int64(layers[n, cell])), methods[n])
    return value


@kernel
def merge_window(
    cells: Cells,
    layers: Cells,
    methods: Integers,
    begin: int,
    end: int,
    default: int,
    anew: bool,
    columns: int,
    window: Integers,
) -> None:
    """Merge ``layers[begin:end]`` over a window of ``cells``, or ``anew`` over the default."""
    for r in range(window[1], window[3]):
        for cell in range(r * columns + window[0], r * columns + window[2]):
            value = default if anew else cell_value(cells, cell)
            for n in range(begin, end):
                value = merge_cell(value, int(np.int64(layers[n, cell])), methods[n])
            cells[cell] = value


@kernel
def inflate_window(
    master: Cells,
    shape: tuple[int, int],
    window: Integers,
    costs: Cells,
    widths: Integers,
    least: int,
    in_order: bool,
    changed: Integers,
) -> None:
    """Inflate in a window and around it; ``changed`` grows to the window and what was written.

    ``in_order`` by the first obstacle to reach a cell, otherwise by the nearest.
    """
    rows, columns = shape
    x0, y0, x1, y1 = window[0], window[1], window[2], window[3]
    if x0 >= x1 or y0 >= y1:
        return
    grow_window(changed, x0, y0)
    grow_window(changed, x1 - 1, y1 - 1)
    radius = widths.shape[0] - 1
    left, low = max(0, x0 - radius), max(0, y0 - radius)
    right, high = min(columns, x1 + radius), min(rows, y1 + radius)
    if in_order:
        inflate_in_order(master, shape, left, low, right, high, costs, radius, least, changed)
    else:
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
    layers: Cells,
    methods: Integers,
    default: int,
    gaps: Cells,
    shape: tuple[int, int],
    window: Integers,
    disturbed: Integers,
    costs: Cells,
    widths: Integers,
    least: int,
    flags: Cells,
    queue: Integers,
    values: Cells,
    queued: int,
    left: int,
    changed: Integers,
) -> int:
    """Do what merging and inflating the window does, in the time that changes take.

    ``queue[:queued]`` lists the cells in which a layer changed, ``disturbed`` is the window in
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
    # One loop over flat arrays, in four phases; split, each part would take a dozen of them.
    # First what others wrote over the master: a lethal cell that move_base or navfn set free
    # leaves costs around it that nobody else would look at.
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
    # Then cells left over from updates whose bounds they lay outside of, now within reach.
    if left > 0:
        for y in range(max(0, box[1] - radius), min(rows, box[3] + radius)):
            for x in range(max(0, box[0] - radius), min(columns, box[2] + radius)):
                cell = y * columns + x
                if flags[cell] != 0 and not flags[cell] & LISTED:
                    left -= 1
                    queued = _list_cell(flags, cell, 0, queue, queued)
    # Then the list itself, which grows while it is worked off: column gaps have to be true for
    # all lethal cells before the cost of any cell is asked for.
    done = 0
    while done < queued:
        cell = queue[done]
        done += 1
        y, x = cell // columns, cell % columns
        if x < x0 or x >= x1 or y < y0 or y >= y1:
            continue
        values[done - 1] = merged_value(layers, methods, default, cell)
        lethal = values[done - 1] == LETHAL
        if lethal and gaps[cell] != 0:
            close_gaps(gaps, shape, x, y, radius)
            stamp_costs(master, shape, x, y, costs, widths, least, changed)
        elif not lethal and gaps[cell] == 0:
            open_gaps(gaps, shape, x, y, radius)
            queued, left = _list_around(
                master, shape, x, y, costs, widths, flags, queue, queued, left
            )
    # At last the costs. Outside the window costmap_2d only ever raises them, by inflation.
    for k in range(queued):
        cell = queue[k]
        y, x = cell // columns, cell % columns
        old = cell_value(master, cell)
        if x0 <= x < x1 and y0 <= y < y1:
            flags[cell] = 0
            new = combine_costs(
                cell_value(values, k), cost_at(gaps, shape, x, y, costs, radius), least
            )
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
_PACKED: Final[OrderedDict[bytes, tuple[bytes, bytes]]] = OrderedDict()
"""Compressed, since most runs have a process of their own and never see them again: the two grids
of the published building take 5.9 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class InflatedMap:
    """Flat, its receiver's own: the ``master`` that the cells below the inflation make, its
    ``gaps``."""

    master: Cells
    gaps: Cells


def inflated_map(
    below: Cells, shape: tuple[int, int], table: InflationTable, *, in_order: bool
) -> InflatedMap:
    """Return the inflated master over the merged cells ``below``; ``in_order`` as for a window."""
    digest = hashlib.blake2b(below.data, digest_size=16)
    digest.update(repr((shape, table.radius, table.least, in_order)).encode())
    digest.update(table.costs.tobytes())
    key = digest.digest()
    if key in _PACKED:
        _PACKED.move_to_end(key)
        master, gaps = (_unpack(grid) for grid in _PACKED[key])
        return InflatedMap(master, gaps)
    made = _inflate_map(below, shape, table, in_order=in_order)
    _PACKED[key] = zlib.compress(made.master.data, 1), zlib.compress(made.gaps.data, 1)
    if len(_PACKED) > _KEPT_MAPS:
        _PACKED.popitem(last=False)
    return made


def _unpack(grid: bytes) -> Cells:
    return np.frombuffer(bytearray(zlib.decompress(grid)), dtype=np.uint8)


def _inflate_map(
    below: Cells, shape: tuple[int, int], table: InflationTable, *, in_order: bool
) -> InflatedMap:
    master, gaps = below.copy(), np.empty(below.size, np.uint8)
    whole = np.array([0, 0, shape[1], shape[0]], dtype=np.int32)
    inflate_window(
        master, shape, whole, table.costs, table.widths, table.least, in_order, whole.copy()
    )
    column_gaps(master, shape, table.radius, gaps)
    return InflatedMap(master, gaps)
