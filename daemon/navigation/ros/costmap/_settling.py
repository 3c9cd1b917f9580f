"""Kernels that bring a master grid up to date: in full inside its bounds, or only what changed.

Both leave the same cells. What an update of costmap_2d does to a cell inside the bounds depends on
the layers and on the lethal cells within the inflation radius of it; outside, costs only rise.
"""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import Integers, kernel
from daemon.navigation.ros.costmap._inflation import (
    close_gaps,
    combined,
    cost_at,
    grow,
    inflate,
    open_gaps,
    stamp,
)
from daemon.navigation.ros.costmap._layer import LETHAL, LISTED, LOW, STALE, UNKNOWN, Cells, at
from grammars.values import Floats

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
def _base(static: int, obstacle: int) -> int:
    """Return the layers' maximum, of which unknown is the least."""
    if obstacle == UNKNOWN:
        return static
    return obstacle if static == UNKNOWN else max(static, obstacle)


@kernel
def redo(
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
            master[cell] = _base(at(static, cell), at(layer, cell))
    grow(changed, x0, y0)
    grow(changed, x1 - 1, y1 - 1)
    radius = widths.shape[0] - 1
    left, low = max(0, x0 - radius), max(0, y0 - radius)
    right, high = min(columns, x1 + radius), min(rows, y1 + radius)
    inflate(master, shape, left, low, right, high, costs, widths, least, changed)


@kernel
def _listed(flags: Cells, cell: int, flag: int, queue: Integers, queued: int) -> int:
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
                queued = _listed(flags, cell, STALE, queue, queued)
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
                most = max(most, at(costs, up2 + (c - x) * (c - x)))
    return most


@kernel
def settle(
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
    """Do what :func:`redo` does, in the time that changes take.

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
            queued = _listed(flags, cell, LOW | STALE, queue, queued)
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
                    queued = _listed(flags, cell, 0, queue, queued)
    done = 0
    while done < queued:
        cell = queue[done]
        done += 1
        y, x = cell // columns, cell % columns
        if x < x0 or x >= x1 or y < y0 or y >= y1:
            continue
        lethal = _base(at(static, cell), at(layer, cell)) == LETHAL
        if lethal and gaps[cell] != 0:
            close_gaps(gaps, shape, x, y, radius)
            stamp(master, shape, x, y, costs, widths, least, changed)
        elif not lethal and gaps[cell] == 0:
            open_gaps(gaps, shape, x, y, radius)
            queued, left = _list_around(
                master, shape, x, y, costs, widths, flags, queue, queued, left
            )
    for k in range(queued):
        cell = queue[k]
        y, x = cell // columns, cell % columns
        old = at(master, cell)
        if x0 <= x < x1 and y0 <= y < y1:
            flags[cell] = 0
            new = _base(at(static, cell), at(layer, cell))
            new = combined(new, cost_at(gaps, shape, x, y, costs, radius), least)
        else:
            flags[cell] = flags[cell] & ~np.uint8(LISTED)
            left += 1
            new = old
            if flags[cell] & LOW:
                new = combined(old, _cost_from(gaps, shape, x, y, box, costs, widths), least)
        if new != old:
            master[cell] = new
            grow(changed, x, y)
    return left
