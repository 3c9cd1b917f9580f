"""Cells of a grid that a polygon covers, by three rules; corners are in cells.

Cell (0, 0) reaches from (0, 0) to (1, 1). Every function returns runs of cells (:data:`Spans`),
which :func:`painted` turns into a grid. Cells outside the grid are cut off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Floats

# Corners are rounded to nanometres; a cell measures some centimetres.
NOISE: Final = 1e-6
"""Part of a cell up to which an overlap is a rounding error."""

Spans: TypeAlias = npt.NDArray[np.intp]
"""Runs of cells, shape (n, 3): row, first column, last column."""

CellsOf: TypeAlias = Callable[[Floats], Spans]
"""Function from a polygon with corners in cells, shape (n, 2), to its cells."""


def cells_overlapped(ring: Floats) -> Spans:
    """Return the cells that a convex polygon overlaps; ``ring`` has shape (n, 2).

    A row of cells cuts a convex polygon to a convex piece. Its cells lie between the ends of the
    edges clipped to the row.
    """
    low, high = _rows(ring[:, 1])
    row = np.arange(low, high + 1)[:, None]
    start, end = ring, np.roll(ring, -1, axis=0)
    bottom = np.minimum(start[:, 1], end[:, 1])
    top = np.maximum(start[:, 1], end[:, 1])
    slanted = top > bottom
    slope = np.zeros(len(ring))
    np.divide(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1], out=slope, where=slanted)
    in_row = slanted & (bottom < row + 1) & (top > row)
    lower = start[:, 0] + slope * (np.clip(row, bottom, top) - start[:, 1])
    upper = start[:, 0] + slope * (np.clip(row + 1, bottom, top) - start[:, 1])
    left = np.where(in_row, np.minimum(lower, upper), np.inf).min(axis=1)
    right = np.where(in_row, np.maximum(lower, upper), -np.inf).max(axis=1)
    hit = right >= left
    return _spans(row[hit, 0], np.floor(left[hit] + NOISE), np.ceil(right[hit] - NOISE) - 1)


def centres_inside(ring: Floats) -> Spans:
    """Return the cells whose centre lies in or on a simple polygon; ``ring`` has shape (n, 2).

    Every row is scanned slightly below and above its centre line, so that polygons with a common
    edge leave no gap.
    """
    low, high = _rows(ring[:, 1])
    row = np.arange(low, high + 1)
    centre = row.astype(np.float64) + 0.5
    scans = [_scan(ring, centre + nudge) for nudge in (-NOISE, NOISE)]
    return np.concatenate(
        [
            _spans(row[at], np.ceil(left - 0.5 - NOISE), np.floor(right - 0.5 + NOISE))
            for at, left, right in scans
        ]
    )


def _scan(ring: Floats, y: Floats) -> tuple[npt.NDArray[np.intp], Floats, Floats]:
    """Return the pieces of the lines ``y`` inside (even-odd rule): line, left and right end."""
    start, end = ring, np.roll(ring, -1, axis=0)
    line = y[:, None]
    crossed = (start[:, 1] <= line) != (end[:, 1] <= line)
    at_line, edge = np.nonzero(crossed)
    a, b = start[edge], end[edge]
    x = a[:, 0] + (y[at_line] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    order = np.lexsort((x, at_line))
    x, at_line = x[order], at_line[order]
    return at_line[0::2], x[0::2], x[1::2]


def outline_filled(ring: Floats) -> Spans:
    """Return the cells in or on the outline of a simple polygon with corners rounded to cells.

    Every corner moves to the middle of its cell; on a border of cells it takes the upper one, as
    such corners differ only by rounding errors. The polygon through these middles is filled. In
    each row, the fill starts at the cell nearest to the crossing of an edge.
    """
    corners = _corner_cells(ring)
    start, end = corners, np.roll(corners, -1, axis=0)
    level = start[:, 1] == end[:, 1]
    spans = [_spans(start[level, 1], *np.sort([start[level, 0], end[level, 0]], axis=0))]
    low, high = corners[:, 1].min(), corners[:, 1].max()
    row = np.arange(low, high + 1).astype(np.float64)
    # A row through corners belongs to the parts below and above it.
    for flipped in (1.0, -1.0):
        at, left, right = _scan(corners * (1.0, flipped), row * flipped)
        spans.append(_spans(row[at], *_nearest(left, right)))
    return np.concatenate(spans)


def outline_of_convex(ring: Floats) -> Spans:
    """Return the cells of :func:`outline_filled` for a convex polygon, without breaks.

    Slivers may have rows without a cell, or rows that do not touch the next one. Additional cells
    connect such rows, as in a drawn line.
    """
    corners = _corner_cells(ring)
    start, end = corners, np.roll(corners, -1, axis=0)
    row = np.arange(corners[:, 1].min(), corners[:, 1].max() + 1)[:, None]
    bottom = np.minimum(start[:, 1], end[:, 1])
    top = np.maximum(start[:, 1], end[:, 1])
    hit = (bottom <= row) & (row <= top)
    rise = np.where(top > bottom, end[:, 1] - start[:, 1], 1.0)
    x = start[:, 0] + (row - start[:, 1]) * (end[:, 0] - start[:, 0]) / rise
    # Level edges have two ends in the row; other edges cross it in one point.
    other = np.where(top > bottom, x, end[:, 0])
    left = np.where(hit, np.minimum(x, other), np.inf).min(axis=1)
    right = np.where(hit, np.maximum(x, other), -np.inf).max(axis=1)
    first, last = _nearest(left, right)
    last = np.maximum(first, last)
    onwards, back = first[1:] > last[:-1] + 1, last[1:] < first[:-1] - 1
    rightwards = np.floor((last[:-1] + first[1:]) / 2)
    leftwards = np.floor((first[:-1] + last[1:]) / 2)
    last[:-1] = np.where(onwards, rightwards, last[:-1])
    first[1:] = np.where(onwards, rightwards + 1, first[1:])
    first[:-1] = np.where(back, leftwards + 1, first[:-1])
    last[1:] = np.where(back, leftwards, last[1:])
    return _spans(row[:, 0], first, last)


def _corner_cells(ring: Floats) -> Floats:
    cells: Floats = np.floor(ring + NOISE)
    return cells


def _nearest(left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Return the cells nearest to both ends; an end halfway between two cells takes the inner."""
    return np.floor(left + 0.5), np.ceil(right - 0.5)


def painted(parts: Iterable[Spans], shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return a grid of ``shape`` (rows, columns), true for cells in any span."""
    rows, columns = shape
    inside = np.zeros(rows * columns, dtype=np.bool_)
    inside[cells_in(np.concatenate([np.zeros((0, 3), dtype=np.intp), *parts]), shape)] = True
    return inside.reshape(shape)


def cells_in(spans: Spans, shape: tuple[int, int]) -> npt.NDArray[np.intp]:
    """Return the indices of the cells of all spans in a grid of ``shape``, counted row by row.

    A cell of several spans occurs several times.
    """
    row, first, last = _inside(spans, shape).T
    length = last - first + 1
    # Number all cells in order, then shift each run to its place in the grid.
    previous = np.cumsum(length) - length
    cells: npt.NDArray[np.intp] = np.arange(length.sum()) + np.repeat(
        row * shape[1] + first - previous, length
    )
    return cells


def grown(spans: Spans, shape: tuple[int, int], steps: int) -> Spans:
    """Return the cells at most ``steps`` away from ``spans`` in a grid, also diagonally."""
    row, first, last = _inside(spans, shape).T
    steps_up = range(-steps, steps + 1)
    return np.concatenate(
        [np.stack([row + k, first - steps, last + steps], axis=1) for k in steps_up]
    )


def _inside(spans: Spans, shape: tuple[int, int]) -> Spans:
    """Return the part of spans in a grid of ``shape`` (rows, columns)."""
    rows, columns = shape
    row, first, last = spans.T
    first, last = np.maximum(first, 0), np.minimum(last, columns - 1)
    hit = (row >= 0) & (row < rows) & (first <= last)
    inside: Spans = np.stack([row[hit], first[hit], last[hit]], axis=1)
    return inside


def _rows(y: Floats) -> tuple[int, int]:
    return math.floor(y.min() + NOISE), math.ceil(y.max() - NOISE) - 1


def _spans(row: npt.NDArray[np.generic], first: Floats, last: Floats) -> Spans:
    filled = last >= first
    columns = (row[filled], first[filled], last[filled])
    return np.stack(columns, axis=1).astype(np.intp)
