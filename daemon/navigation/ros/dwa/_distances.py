"""Grid distances of base_local_planner's ``MapGrid``, breadth first, a row of cells at a time.

A front of the search is one bit per cell, so that a step to all four sides is a few operations per
64 cells. Values are those of the original's queue, because every step costs the same.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.navigation.kernels import Integers, kernel
from daemon.navigation.ros.dwa._plan import Bits, Cells
from daemon.navigation.ros.grids import INSCRIBED

_ONE: Final = np.uint64(1)
_NONE: Final = np.uint64(0)
_TOP: Final = np.uint64(63)
_SHIFT: Final = np.uint64(58)
_DE_BRUIJN: Final = np.uint64(0x03F79D71B4CB0A89)


def _positions() -> npt.NDArray[np.int64]:
    """Return the table from a de Bruijn product to the position of the single bit."""
    table = np.zeros(64, dtype=np.int64)
    for k in range(64):
        table[(((1 << k) * int(_DE_BRUIJN)) & (2**64 - 1)) >> 58] = k
    return table


_POSITIONS: Final = _positions()


@kernel
def open_cells(cells: Cells, out: Bits) -> None:
    """Set the bit of every cell that the search may pass: known and below inscribed."""
    out[:] = _NONE
    for row in range(cells.shape[0]):
        for column in range(cells.shape[1]):
            if cells[row, column] < INSCRIBED:
                out[row, column >> 6] |= _ONE << np.uint64(column & 63)


@kernel
def _record(
    bits: np.uint64, row: int, word: int, value: int, window: Integers, distances: Integers
) -> int:
    """Write ``value`` to the cells of ``bits`` inside ``window`` and return how many these are."""
    count = 0
    while bits != _NONE:
        lowest = bits & (~bits + _ONE)
        bits ^= lowest
        column = (word << 6) + _POSITIONS[(lowest * _DE_BRUIJN) >> _SHIFT]
        if window[0] <= column < window[2]:
            distances[row, column] = value
            count += 1
    return count


@kernel
def _beside(front: Bits, row: int, word: int) -> np.uint64:
    """Return the four neighbours of the front within one word."""
    here = front[row, word]
    bits = (here << _ONE) | (here >> _ONE)
    if word > 0:
        bits |= front[row, word - 1] >> _TOP
    if word + 1 < front.shape[1]:
        bits |= front[row, word + 1] << _TOP
    if row > 0:
        bits |= front[row - 1, word]
    if row + 1 < front.shape[0]:
        bits |= front[row + 1, word]
    return bits


@kernel
def spread_out(
    seeds: Bits, passable: Bits, window: Integers, distances: Integers, buffers: Bits
) -> None:
    """Write the steps from the nearest seed to ``distances`` within the half-open ``window``.

    ``window`` is first column, first row, end column, end row; other cells are not written. Cells
    that cannot be passed get rows * columns when reached, cells not reached get one more. Seeds
    are 0 and spread even from cells that cannot be passed. ``buffers`` has shape (3, rows, words).
    """
    rows, words = seeds.shape
    blocked = distances.size
    first, second, seen = buffers[0], buffers[1], buffers[2]
    missing = (window[2] - window[0]) * (window[3] - window[1])
    for row in range(window[1], window[3]):
        for column in range(window[0], window[2]):
            distances[row, column] = blocked + 1
    low, high = rows, -1
    for row in range(rows):
        for word in range(words):
            bits = seeds[row, word]
            first[row, word], seen[row, word], second[row, word] = bits, bits, _NONE
            if bits != _NONE:
                low, high = min(low, row), row
                if window[1] <= row < window[3]:
                    missing -= _record(bits, row, word, 0, window, distances)
    level = 0
    while low <= high and missing > 0:
        level += 1
        next_low, next_high = rows, -1
        for row in range(max(low - 1, 0), min(high + 2, rows)):
            for word in range(words):
                bits = _beside(first, row, word) & ~seen[row, word]
                if bits == _NONE:
                    continue
                seen[row, word] |= bits
                fresh = bits & passable[row, word]
                second[row, word] = fresh
                if fresh != _NONE:
                    next_low, next_high = min(next_low, row), row
                if window[1] <= row < window[3]:
                    missing -= _record(fresh, row, word, level, window, distances)
                    missing -= _record(bits ^ fresh, row, word, blocked, window, distances)
        for row in range(low, high + 1):
            for word in range(words):
                first[row, word] = _NONE
        first, second = second, first
        low, high = next_low, next_high
