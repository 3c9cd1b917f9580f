"""Distances from the plan on the grid (base_local_planner ``MapGrid``).

Distances are breadth first, all cells of a row at once. Every step costs the same, so the
original's queue finds a cell in the round that equals its distance. Here a round is a few
operations per 64 cells, one bit per cell. The number of the round is stored as bits as well,
because only the few cells at the ends of trajectories are ever read. It is in Gray code, where one
digit changes per round: every unreached cell flips that digit.

A set of cells has shape (words + 2, rows + 2): 64 columns per word, with an empty rim. Distances
are a stack of sets: reached; reached and fit to stand in; then the digits of the distance.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.ros1.cost_grid import INSCRIBED, NO_INFORMATION
from grammars.model.geometry import Floats

Bits: TypeAlias = npt.NDArray[np.uint64]
Cells: TypeAlias = npt.NDArray[np.uint8]

REACHED: Final = 0
FIT: Final = 1
DIGITS: Final = 2
_ONE: Final = np.uint64(1)
_NONE: Final = np.uint64(0)
_TOP: Final = np.uint64(63)


def empty_set(shape: tuple[int, ...]) -> Bits:
    """Return a set of no cells for a grid of ``shape`` (rows, columns)."""
    return np.zeros(((shape[1] + 63) // 64 + 2, shape[0] + 2), dtype=np.uint64)


def unrestricted_distances(shape: tuple[int, ...]) -> Bits:
    """Return arbitrary distances for a grid of ``shape`` that reject no cell."""
    cells = empty_set(shape)
    digits = int(shape[0] * shape[1]).bit_length()
    out = np.zeros((DIGITS + digits, *cells.shape), dtype=np.uint64)
    out[FIT] = ~_NONE
    return out


@kernel
def add_cell(cells: Bits, row: int, column: int) -> None:
    """Add one cell to a set."""
    cells[(column >> 6) + 1, row + 1] |= _ONE << np.uint64(column & 63)


@kernel
def contains_cell(cells: Bits, row: int, column: int) -> bool:
    """Tell whether a set contains a cell."""
    return bool(((cells[(column >> 6) + 1, row + 1] >> np.uint64(column & 63)) & _ONE) != _NONE)


@kernel
def passable_cells(cells: Cells, out: Bits) -> None:
    """Write the set of cells that distances spread through: known and below inscribed."""
    rows, columns = cells.shape
    for word in range((columns + 63) // 64):
        part = cells[:, 64 * word : min(64 * word + 64, columns)]
        for row in range(rows):
            bits = _NONE
            for k in range(part.shape[1]):
                bits |= np.uint64(part[row, k] < INSCRIBED) << np.uint64(k)
            out[word + 1, row + 1] = bits


@kernel
def write_box(low: int, high: int, first: int, end: int, out: Bits) -> None:
    """Write the set of cells in columns [low, high) and rows [first, end) to ``out``."""
    out[:] = _NONE
    if first >= end:
        return
    for column in range(low, high):
        add_cell(out, first, column)
    for word in range(out.shape[0]):
        for row in range(first + 1, end):
            out[word, row + 1] = out[word, first + 1]


@kernel
def write_reach(
    x: float, y: float, reach: float, frame: Floats, shape: tuple[int, int], out: Bits
) -> None:
    """Write a set to ``out`` with all cells within ``reach`` [m] of a point, and a few more."""
    rows, columns = shape
    # Two more: the point is anywhere in its cell, and rounding may put an end into the next one.
    cells = int(min(reach / frame[2], float(rows + columns))) + 2
    column, row = math.floor((x - frame[0]) / frame[2]), math.floor((y - frame[1]) / frame[2])
    low, high = max(column - cells, 0), min(column + cells + 1, columns)
    write_box(low, high, max(row - cells, 0), min(row + cells + 1, rows), out)


@kernel
def write_single_cell(row: int, column: int, out: Bits) -> None:
    """Write the set of a single cell to ``out``."""
    out[:] = _NONE
    add_cell(out, row, column)


@kernel
def compute_distances(seeds: Bits, passable: Bits, targets: Bits, out: Bits) -> int:
    """Write the distances [steps] from the nearest seed to ``out``, until all ``targets`` have one.

    A cell that is not passable is reached but spreads no further and is not fit to stand in,
    unless it is a seed. Returns the number of digits in use; the others are undefined.
    """
    words, rows = seeds.shape
    front = np.zeros((2, words, rows), dtype=np.uint64)
    # Only rows [low, high) near the front can change.
    low, high = rows - 1, 1
    for word in range(1, words - 1):
        for row in range(1, rows - 1):
            bits = seeds[word, row]
            front[0, word, row] = bits
            out[REACHED, word, row] = bits
            if bits != _NONE:
                low, high = min(low, row), max(high, row + 1)
    low = min(low, high)
    # All targets in the words before this one are reached.
    waiting = 0
    flat_targets, flat_reached = targets.reshape(-1), out[REACHED].reshape(-1)
    old, new, level, used = 0, 1, 0, 0
    while True:
        level += 1
        for row in (low - 1, high):
            if 0 < row < rows - 1:
                _enter_row(row, level - 1, out)
        low, high = max(low - 1, 1), min(high + 1, rows - 1)
        changed = 0
        while not (level >> changed) & 1:
            changed += 1
        if changed == used:
            # Clear a digit at its first use, because most digits are never used.
            for word in range(1, words - 1):
                out[DIGITS + used, word, 1 : rows - 1] = _NONE
            used += 1
        fresh_any = _NONE
        for word in range(1, words - 1):
            # Views from ``low`` on: with indices from 0 several rows are processed at once.
            here, below, above = (
                front[old, word, low:high],
                front[old, word, low - 1 : high - 1],
                front[old, word, low + 1 : high + 1],
            )
            left, right = front[old, word - 1, low:high], front[old, word + 1, low:high]
            reached, there = out[REACHED, word, low:high], front[new, word, low:high]
            free, digit = passable[word, low:high], out[DIGITS + changed, word, low:high]
            for k in range(high - low):
                bits = (here[k] << _ONE) | (here[k] >> _ONE) | below[k] | above[k]
                bits |= (left[k] >> _TOP) | (right[k] << _TOP)
                before = reached[k]
                fresh = bits & ~before & free[k]
                reached[k] = before | bits
                digit[k] ^= ~before
                there[k] = fresh
                fresh_any |= fresh
        while waiting < flat_targets.size:
            if flat_targets[waiting] & ~flat_reached[waiting] != _NONE:
                break
            waiting += 1
        if fresh_any == _NONE or waiting == flat_targets.size:
            break
        old, new = new, old
    for word in range(1, words - 1):
        for row in range(1, rows - 1):
            fit = passable[word, row] | seeds[word, row]
            out[FIT, word, row] = out[REACHED, word, row] & fit
    return used


@kernel
def _enter_row(row: int, level: int, out: Bits) -> None:
    """Set the digits of a row that the front comes near for the first time to ``level``."""
    code, digit = level ^ (level >> 1), DIGITS
    while code >> (digit - DIGITS):
        if (code >> (digit - DIGITS)) & 1:
            for word in range(1, out.shape[1] - 1):
                out[digit, word, row] = ~_NONE
        digit += 1


@kernel
def distance_at(distances: Bits, row: int, column: int, size: int, digits: int) -> int:
    """Return the distance of a cell: ``size`` if unfit, one more if unreached.

    ``digits`` is the number in use, or more if the others were never used.
    """
    word, at, shift = (column >> 6) + 1, row + 1, np.uint64(column & 63)
    if (distances[FIT, word, at] >> shift) & _ONE == _NONE:
        return size + int((distances[REACHED, word, at] >> shift) & _ONE == _NONE)
    steps, odd = 0, 0
    for digit in range(digits - 1, -1, -1):
        odd ^= int((distances[DIGITS + digit, word, at] >> shift) & _ONE)
        steps = steps << 1 | odd
    return steps


@kernel
def place_of(x: float, y: float, frame: Floats, rows: int, columns: int) -> tuple[int, int]:
    """Return row and column of a point, (-1, -1) off the grid (costmap_2d ``worldToMap``).

    ``frame`` is x, y of the lower-left corner and the resolution.
    """
    if x < frame[0] or y < frame[1]:
        return -1, -1
    column, row = int((x - frame[0]) / frame[2]), int((y - frame[1]) / frame[2])
    if column >= columns or row >= rows:
        return -1, -1
    return row, column


@kernel
def cell_of(x: float, y: float, frame: Floats, rows: int, columns: int) -> int:
    """Return row * columns + column of a point, -1 off the grid, as :func:`place_of`."""
    row, column = place_of(x, y, frame, rows, columns)
    return row * columns + column if row >= 0 else -1


@kernel
def _mark_cell(x: float, y: float, cells: Cells, frame: Floats, seeds: Bits) -> int:
    rows, columns = cells.shape
    row, column = place_of(x, y, frame, rows, columns)
    if row < 0 or cells[row, column] == NO_INFORMATION:
        return -1
    add_cell(seeds, row, column)
    return row * int(columns) + column


@kernel
def mark_plan_cells(plan: Floats, end: Floats, cells: Cells, frame: Floats, seeds: Bits) -> int:
    """Mark the known cells of a plan and return the last one, -1 if there is none.

    ``end`` replaces the last point; gaps above the resolution are filled
    (``MapGrid::adjustPlanResolution``). Cells count from the first known one until an unknown one
    (``setTargetCells``, ``setLocalGoal``). ``seeds`` becomes the set of these cells.
    """
    seeds[:] = _NONE
    n, last = plan.shape[0], -1
    before_x, before_y = 0.0, 0.0
    for i in range(n):
        x, y = plan[i, 0], plan[i, 1]
        if i == n - 1:
            x, y = end[0], end[1]
        if i > 0:
            square = (x - before_x) * (x - before_x) + (y - before_y) * (y - before_y)
            if square > frame[2] * frame[2]:
                steps = math.ceil(math.sqrt(square) / frame[2])
                dx, dy = (x - before_x) / steps, (y - before_y) / steps
                for j in range(1, steps):
                    at = _mark_cell(before_x + j * dx, before_y + j * dy, cells, frame, seeds)
                    if at >= 0:
                        last = at
                    elif last >= 0:
                        return last
        at = _mark_cell(x, y, cells, frame, seeds)
        if at >= 0:
            last = at
        elif last >= 0:
            return last
        before_x, before_y = x, y
    return last
