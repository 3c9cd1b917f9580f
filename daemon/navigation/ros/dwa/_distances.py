"""Grid distances of base_local_planner's ``MapGrid``, breadth first, all cells of a row at once.

Every step costs the same, so the original's queue finds a cell in the round that is its distance.
Here a round is a few operations per 64 cells, one bit per cell, and the number of the round is
kept as bits as well: only the few cells that trajectories end in are ever read.

A set of cells has shape (words + 2, rows + 2): 64 columns per word, with an empty rim. Distances
are a stack of sets: reached; reached and fit to stand in; then the binary digits of the distance.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.grids import INSCRIBED

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


def everywhere_fit(shape: tuple[int, ...]) -> Bits:
    """Return distances for a grid of ``shape`` that reject nothing, whatever they are."""
    cells = empty_set(shape)
    digits = int(shape[0] * shape[1]).bit_length()
    out = np.zeros((DIGITS + digits, *cells.shape), dtype=np.uint64)
    out[FIT] = ~_NONE
    return out


@kernel
def add(cells: Bits, row: int, column: int) -> None:
    """Add one cell to a set."""
    cells[(column >> 6) + 1, row + 1] |= _ONE << np.uint64(column & 63)


@kernel
def contains(cells: Bits, row: int, column: int) -> bool:
    """Whether a set contains a cell."""
    return bool(((cells[(column >> 6) + 1, row + 1] >> np.uint64(column & 63)) & _ONE) != _NONE)


@kernel
def passable_cells(cells: Cells, out: Bits) -> None:
    """Write the set of cells that distances spread through: known and below inscribed."""
    out[:] = _NONE
    for row in range(cells.shape[0]):
        for column in range(cells.shape[1]):
            if cells[row, column] < INSCRIBED:
                add(out, row, column)


@kernel
def box(low: int, high: int, first: int, end: int, out: Bits) -> None:
    """Write the set of cells in columns [low, high) and rows [first, end) to ``out``."""
    out[:] = _NONE
    if first >= end:
        return
    for column in range(low, high):
        add(out, first, column)
    for word in range(out.shape[0]):
        for row in range(first + 1, end):
            out[word, row + 1] = out[word, first + 1]


@kernel
def only(row: int, column: int, out: Bits) -> None:
    """Write the set of a single cell to ``out``."""
    out[:] = _NONE
    add(out, row, column)


@kernel
def spread_out(seeds: Bits, passable: Bits, wanted: Bits, out: Bits, front: Bits) -> int:
    """Write the distances [steps] from the nearest seed to ``out``, until all ``wanted`` have one.

    A cell that is not passable is reached but spreads no further and is not fit to stand in,
    unless it is a seed. ``front`` (2, ...) is room for two sets. Returns how many digits are used.
    """
    words, rows = seeds.shape
    out[:] = _NONE
    old, new = 0, 1
    front[:] = _NONE
    for word in range(1, words - 1):
        for row in range(1, rows - 1):
            front[0, word, row] = seeds[word, row]
            out[REACHED, word, row] = seeds[word, row]
            out[FIT, word, row] = seeds[word, row]
    level, digit = 0, DIGITS
    while True:
        level += 1
        fresh_any, missing = _NONE, _NONE
        for word in range(1, words - 1):
            for row in range(1, rows - 1):
                here = front[old, word, row]
                bits = (here << _ONE) | (here >> _ONE)
                bits |= (front[old, word - 1, row] >> _TOP) | (front[old, word + 1, row] << _TOP)
                bits |= front[old, word, row - 1] | front[old, word, row + 1]
                bits &= ~out[REACHED, word, row]
                reached = out[REACHED, word, row] | bits
                fresh = bits & passable[word, row]
                out[REACHED, word, row] = reached
                out[FIT, word, row] |= fresh
                front[new, word, row] = fresh
                fresh_any |= fresh
                missing |= wanted[word, row] & ~reached
        digit, rest = DIGITS, level
        while rest:
            if rest & 1:
                for word in range(1, words - 1):
                    for row in range(1, rows - 1):
                        out[digit, word, row] |= front[new, word, row]
            rest >>= 1
            digit += 1
        if fresh_any == _NONE or missing == _NONE:
            return digit - DIGITS
        old, new = new, old


@kernel
def steps_at(distances: Bits, row: int, column: int, size: int, digits: int) -> int:
    """Return the distance of a cell: ``size`` when not fit, one more when not reached.

    ``digits`` is how many of them are used, or more.
    """
    word, at, shift = (column >> 6) + 1, row + 1, np.uint64(column & 63)
    if (distances[FIT, word, at] >> shift) & _ONE == _NONE:
        return size + int((distances[REACHED, word, at] >> shift) & _ONE == _NONE)
    steps = 0
    for digit in range(digits):
        steps |= int((distances[DIGITS + digit, word, at] >> shift) & _ONE) << digit
    return steps


@kernel
def is_fit(distances: Bits, row: int, column: int) -> bool:
    """Whether a cell is reached and fit to stand in."""
    return contains(distances[FIT], row, column)
