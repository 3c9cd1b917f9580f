"""Texts on a map of cells: each has one place, on one line, over free cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grammars.model.geometry import Floats
from scenario_tui.dashboard.widgets.block_cells import Mask, fill_areas, ring_edges

Place = tuple[int, int]
"""Row and column of a cell."""
Box = tuple[int, int, int, int]
"""First column and row, last column and row of some cells."""


@dataclass(frozen=True, slots=True)
class MapLabel:
    """A text that starts in the cell at ``row`` and ``column``."""

    row: int
    column: int
    text: str
    layer: int

    @property
    def cells(self) -> tuple[int, slice]:
        """Index of its cells."""
        return self.row, slice(self.column, self.column + len(self.text))

    def take_place(self, free: Mask) -> None:
        """Mark its cells, and one on either side, as not ``free`` (rows, columns)."""
        free[self.row, max(self.column - 1, 0) : self.column + len(self.text) + 1] = False


def place_inside(text: str, layer: int, rings: Sequence[Floats], free: Mask) -> MapLabel | None:
    """Return a text within an area, as near to its middle as possible.

    ``rings`` (n, 2), in cells from the upper left corner, are an outline and holes in it. The text
    takes ``free`` cells (rows, columns), which are marked as taken.
    """
    rows, columns = free.shape
    outline, *holes = (fill_areas(ring_edges([ring]), columns, rows) for ring in rings)
    inside = outline & ~np.logical_or.reduce(holes, axis=0)
    # With a cell on either side, because letters that touch a wall are hard to read.
    width = len(text) + 2
    if not inside.any() or columns < width:
        return None
    sums = np.pad(np.cumsum(inside & free, axis=1), ((0, 0), (1, 0)))
    at = np.argwhere(sums[:, width:] - sums[:, :-width] == width)
    if len(at) == 0:
        return None
    row, column = (float(where.mean()) for where in np.nonzero(inside))
    # A cell is twice as high as wide.
    far = np.abs(2.0 * (at[:, 0] - row)) + np.abs(at[:, 1] + (width - 1) / 2 - column)
    best, first = at[far.argmin()].tolist()
    return _placed(MapLabel(best, first + 1, text, layer), free)


def place_beside(
    text: str, layer: int, box: Box, free: Mask, *, walls: Mask | None = None, gap: int = 1
) -> MapLabel | None:
    """Return a text beside a ``box``: to the right, to the left, at most two rows above or below.

    The ``gap`` cells on either side are ``free``, too. It covers ``walls`` (both rows, columns)
    only if there is no other place. Its cells are marked as taken.
    """
    rows, columns = free.shape
    first, top, last, bottom = box
    if last < 0 or bottom < 0 or first >= columns or top >= rows:
        return None
    width = len(text)
    after, before = last + 1 + gap, first - width - gap
    middle, centre = (top + bottom) // 2, (first + last) // 2 - (width - 1) // 2
    spots = [(middle, after), (middle, before)]
    for row in (top - 1, bottom + 1, top - 2, bottom + 2):
        spots += [(row, column) for column in (centre, after, before, after + 2)]
    spots = [(row, at) for row, at in spots if 0 <= row < rows and 0 <= at <= columns - width]
    for room in (free,) if walls is None else (free & ~walls, free):
        for row, column in spots:
            if room[row, max(column - gap, 0) : column + width + gap].all():
                return _placed(MapLabel(row, column, text, layer), free)
    return None


def _placed(label: MapLabel, free: Mask) -> MapLabel:
    label.take_place(free)
    return label
