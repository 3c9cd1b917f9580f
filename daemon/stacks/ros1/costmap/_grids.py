"""Records of the kernels of a costmap, and kernels for every layer.

Cells are flat, row by row. A cell that changes in a layer is listed once (:class:`Changes`), so
that the master grid can follow. The layers of a costmap share the list.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import Window
from grammars.model.geometry import Floats

Cells: TypeAlias = npt.NDArray[np.uint8]
Numbers: TypeAlias = npt.NDArray[np.int64]

# Flags are bytes: numba would compile a kernel again for each plain number.
STALE = np.uint8(1)
"""Flag: the master's value may be out of date."""
LOW = np.uint8(2)
"""Flag: the master's value may be too low."""
WRITTEN = STALE | LOW
"""Flags of a cell that others wrote in the master."""
LISTED = np.uint8(128)
"""Flag: on the list of this update."""
QUEUED, OVERDUE = 0, 1
"""Indices of the counts: cells on the list, and cells flagged by earlier updates only."""


class Frame(NamedTuple):
    """Size and place of a grid; the lower left corner of its first cell is (``x``, ``y``) [m]."""

    rows: int
    columns: int
    x: float
    y: float
    resolution: float


class Grid(NamedTuple):
    """Flat ``cells`` in their frame."""

    cells: Cells
    frame: Frame


class Changes(NamedTuple):
    """List of changed cells, ``queue``, with the ``flags`` of every cell.

    ``bounds`` (x0, y0, x1, y1) [m] enclose everything that this cycle looked at.
    """

    flags: Cells
    queue: Integers
    counts: Numbers
    bounds: Floats


@kernel
def cell_value(cells: Cells, cell: int) -> int:
    """Return a cell as a signed integer: numba turns mixed signs into floating point."""
    return int(np.int64(cells[cell]))


@kernel
def cell_at(frame: Frame, x: float, y: float) -> tuple[int, int]:
    """Return column and row of a point [m], both -1 off the grid (``worldToMap``)."""
    if x < frame.x or y < frame.y:
        return -1, -1
    column = int((x - frame.x) / frame.resolution)
    row = int((y - frame.y) / frame.resolution)
    if column >= frame.columns or row >= frame.rows:
        return -1, -1
    return column, row


@kernel
def note_change(changes: Changes, cell: int) -> None:
    """List a cell that changed in a layer, unless it has a flag already."""
    flag = changes.flags[cell]
    changes.flags[cell] = flag | STALE
    if flag == 0:
        changes.flags[cell] = STALE | LISTED
        changes.queue[changes.counts[QUEUED]] = cell
        changes.counts[QUEUED] += 1


@kernel
def list_cell(changes: Changes, cell: int, flag: np.uint8) -> None:
    """Flag a cell and list it once; it is then no longer overdue."""
    old = changes.flags[cell]
    changes.flags[cell] = old | flag | LISTED
    if old & LISTED:
        return
    if old != 0:
        changes.counts[OVERDUE] -= 1
    changes.queue[changes.counts[QUEUED]] = cell
    changes.counts[QUEUED] += 1


@kernel
def grow_bounds(bounds: Floats, x: float, y: float) -> None:
    """Extend ``bounds`` [m] to include a point."""
    bounds[0], bounds[1] = min(bounds[0], x), min(bounds[1], y)
    bounds[2], bounds[3] = max(bounds[2], x), max(bounds[3], y)


@kernel
def grow_window(changed: Numbers, x: int, y: int) -> None:
    """Extend the half-open window ``changed`` to include a cell."""
    changed[0], changed[1] = min(changed[0], x), min(changed[1], y)
    changed[2], changed[3] = max(changed[2], x + 1), max(changed[3], y + 1)


@kernel
def reach_of(window: Window, radius: int, frame: Frame) -> Window:
    """Return the window and a ``radius`` [cells] around it; an empty one stays empty."""
    x0, y0, x1, y1 = window
    u, v = max(0, x0 - radius), max(0, y0 - radius)
    if x0 >= x1 or y0 >= y1:
        return u, v, u, v
    return u, v, min(frame.columns, x1 + radius), min(frame.rows, y1 + radius)
