"""Doorways on a map: gaps in a line of walls that lead from room to room.

A gap lies along a main direction of the building between the ends of two walls, at most as deep as
a wall. At least one of the walls goes on in that line. The free floor before and behind the gap is
wider than the gap.

A gap is a doorway if it separates two rooms once all gaps are shut. Neither of them may be smaller
than the least room. Things near a wall therefore make no doorway, and two doors between the same
rooms are both found.

Lengths are in cells, points as in :mod:`grammars.maps._borders`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from grammars.maps._borders import FREE_CELL, OCCUPIED_CELL, Labels, Points
from grammars.maps._cells import Cells, connected

_SHIFT: Final = 2
"""Largest shift of the end of a wall from one row of cells to the next."""
_FREE_SHARE: Final = 0.8
"""Least share of free cells in a gap; cells behind jambs are unknown."""
_IN_THE_WALL: Final = 2.0
"""Distance by which a gap is shut beyond its jambs, which are ragged on measured maps."""
_OFF_THE_FACE: Final = 3
"""Rows of cells from a gap to where the floor must be wider, beyond ragged edges."""
_SUBSAMPLES: Final = (np.array([0.25, 0.75]), np.array([0.25, 0.75]))


@dataclass(frozen=True, slots=True)
class DoorwaySizes:
    """Limits for a gap that may be a doorway [cells]; ``room`` is an area."""

    least: float
    most: float
    deepest: float
    wall: float
    clear: float
    wider: float
    room: int


@dataclass(frozen=True, slots=True)
class MapGap:
    """Gap with its middle, the heading of its line of walls [rad], and its sizes.

    ``walls`` is the length of the longer wall that goes on in that line.
    """

    x: float
    y: float
    heading: float
    width: float
    depth: float
    walls: float

    def along(self) -> npt.NDArray[np.float64]:
        """Return the unit vector along its line of walls."""
        return np.array([math.cos(self.heading), math.sin(self.heading)])

    def corners(self, beyond: float = 0.0, thicker: float = 0.0) -> Points:
        """Return its rectangle, ``beyond`` longer at both ends, ``thicker`` on both sides."""
        along = self.along() * (self.width / 2 + beyond)
        across = np.array([-along[1], along[0]]) / np.hypot(*along)
        across = across * (self.depth / 2 + thicker)
        middle = np.array([self.x, self.y])
        offsets = [-along - across, along - across, along + across, across - along]
        corners: Points = middle + np.array(offsets)
        return corners


def find_doorways(
    labels: Labels, directions: Sequence[float], sizes: DoorwaySizes
) -> tuple[MapGap, ...]:
    """Return the doorways of a map with walls along ``directions`` [rad] and across them."""
    gaps = [gap for direction in directions for gap in _gaps_along(labels, direction, sizes)]
    gaps.sort(key=lambda gap: (-gap.walls, gap.y, gap.x, gap.heading))
    apart: list[MapGap] = []
    for gap in gaps:
        near = (math.hypot(gap.x - other.x, gap.y - other.y) for other in apart)
        if all(distance > sizes.least for distance in near):
            apart.append(gap)
    return tuple(_parting(labels, apart, sizes.room))


def _gaps_along(labels: Labels, direction: float, sizes: DoorwaySizes) -> Iterator[MapGap]:
    walls, free, origin = _turned(labels, direction)
    cos, sin = math.cos(direction), math.sin(direction)
    for upright in (False, True):
        heading = direction + (math.pi / 2 if upright else 0.0)
        grids = (walls.T, free.T) if upright else (walls, free)
        for along, across, width, depth, reach in _gaps_in_rows(*grids, sizes):
            x, y = (across, along) if upright else (along, across)
            x, y = x + origin[0], y + origin[1]
            yield MapGap(x * cos - y * sin, x * sin + y * cos, heading, width, depth, reach)


def _turned(labels: Labels, direction: float) -> tuple[Cells, Cells, Points]:
    """Return grids of wall and free cells, turned so that ``direction`` runs along the rows.

    The third value is the lower left corner of these grids, along the direction and across it.
    """
    walls, free = labels == OCCUPIED_CELL, labels == FREE_CELL
    if direction == 0.0:
        return walls, free, np.zeros(2)
    cos, sin = math.cos(direction), math.sin(direction)
    # Points half a cell apart: at any angle, every covered cell contains at least one.
    dx, dy = (part.ravel() for part in np.meshgrid(*_SUBSAMPLES))
    placed: list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]] = []
    for cells in (walls, free):
        row, column = np.nonzero(cells)
        x, y = (column[:, None] + dx).ravel(), (row[:, None] + dy).ravel()
        placed.append((x * cos + y * sin, y * cos - x * sin))
    low = np.array([min(float(part[k].min(initial=0)) for part in placed) for k in (0, 1)])
    low = np.floor(low) - 1
    high = np.array([max(float(part[k].max(initial=0)) for part in placed) for k in (0, 1)])
    columns, rows = (np.floor(high - low).astype(int) + 2).tolist()
    grids = np.zeros((2, rows, columns), dtype=np.bool_)
    for grid, (along, across) in zip(grids, placed, strict=True):
        grid[(across - low[1]).astype(int), (along - low[0]).astype(int)] = True
    return grids[0], grids[1] & ~grids[0], low


def _gaps_in_rows(
    walls: Cells, free: Cells, sizes: DoorwaySizes
) -> Iterator[tuple[float, float, float, float, float]]:
    """Yield gaps along the rows: middle along and across, width, depth, length of the wall."""
    columns = walls.shape[1]
    wide = np.pad(walls, ((1, 1), (0, 0)))
    # Add a row of cells to either side: slightly slanted walls end in different rows.
    thick = wide[:-2] | wide[1:-1] | wide[2:]
    change = np.diff(thick.astype(np.int8), axis=1)
    row, start = np.nonzero(change == -1)
    row_after, end = np.nonzero(change == 1)
    # The next start of a wall in the same row ends the gap.
    following = np.searchsorted(row_after * columns + end, row * columns + start, side="right")
    inside = following < len(end)
    row, start, following = row[inside], start[inside] + 1, following[inside]
    same = row_after[following] == row
    row, start, end = row[same], start[same], end[following[same]] + 1
    fits = (end - start >= sizes.least) & (end - start <= sizes.most)
    row, start, end = row[fits], start[fits], end[fits]
    sums = np.cumsum(np.pad(free, ((0, 0), (1, 0))), axis=1)
    clear = sums[row, end] - sums[row, start] >= _FREE_SHARE * (end - start)
    runs = zip(row[clear].tolist(), start[clear].tolist(), end[clear].tolist(), strict=True)
    for chain in _chains(runs):
        gap = _gap_of(chain, thick, free, sizes)
        if gap is not None:
            yield gap


def _chains(runs: Iterable[tuple[int, int, int]]) -> list[list[tuple[int, int, int]]]:
    """Return chains of runs (row, start, end) that continue from row to row."""
    chains: list[list[tuple[int, int, int]]] = []
    open_chains: list[list[tuple[int, int, int]]] = []
    for row, start, end in runs:
        open_chains = [chain for chain in open_chains if chain[-1][0] >= row - 1]
        for chain in open_chains:
            last_row, last_start, last_end = chain[-1]
            shift = max(abs(start - last_start), abs(end - last_end))
            if last_row == row - 1 and shift <= _SHIFT:
                chain.append((row, start, end))
                break
        else:
            open_chains.append([(row, start, end)])
            chains.append(open_chains[-1])
    return chains


def _gap_of(
    chain: list[tuple[int, int, int]], thick: Cells, free: Cells, sizes: DoorwaySizes
) -> tuple[float, float, float, float, float] | None:
    runs = np.array(chain)
    depth = max(len(runs) - 2, 1)
    if depth > sizes.deepest:
        return None
    core = runs[1:-1] if len(runs) > 2 else runs
    start, end = (float(np.median(core[:, k])) for k in (1, 2))
    first, last = int(runs[0, 0]), int(runs[-1, 0])
    reach, quarter = round(sizes.clear), (end - start) / 4
    low, high = max(first - reach, 0), last + reach + 1
    before = free[low:high, round(start + quarter) : round(end - quarter)]
    if high - low != before.shape[0] or before.mean() < 0.9:
        return None
    centre = round((start + end) / 2)
    for beyond in (max(first - _OFF_THE_FACE, 0), min(last + _OFF_THE_FACE, len(thick) - 1)):
        row = thick[beyond]
        open_here = _length(~row[:centre][::-1]) + _length(~row[centre:])
        if open_here < end - start + sizes.wider:
            return None
    middle = core[len(core) // 2]
    beside = thick[int(middle[0])]
    wall = max(_length(beside[: int(middle[1])][::-1]), _length(beside[int(middle[2]) :]))
    if wall < sizes.wall:
        return None
    across = (float(core[0, 0]) + float(core[-1, 0]) + 1) / 2
    return (start + end) / 2, across, end - start, float(depth), float(wall)


def _length(wall: npt.NDArray[np.bool_]) -> int:
    """Return the number of wall cells at the beginning."""
    gaps = np.flatnonzero(~wall)
    return int(gaps[0]) if len(gaps) else len(wall)


def _parting(labels: Labels, gaps: Sequence[MapGap], room: int) -> Iterator[MapGap]:
    """Yield the gaps that separate rooms of at least ``room`` cells."""
    free = labels == FREE_CELL
    for gap in gaps:
        # The extra thickness leaves no way through cells at an angle.
        corners = gap.corners(_IN_THE_WALL, 1.0 - min(gap.depth, 1.0) / 2)
        free[_cells_in(corners, free.shape)] = False
    numbers, sizes = connected(free)
    parents = list(range(len(sizes)))

    def root(number: int) -> int:
        while parents[number] != number:
            number = parents[number]
        return number

    doors = [(gap, *sides) for gap in gaps if (sides := _sides(gap, numbers))]
    while True:
        doors = [door for door in doors if root(door[1]) != root(door[2])]
        ends = [(int(sizes[root(n)]), k) for k, door in enumerate(doors) for n in door[1:]]
        smallest, k = min(ends, default=(room, 0))
        if smallest >= room:
            break
        one, other = root(doors[k][1]), root(doors[k][2])
        parents[other] = one
        sizes[one] += sizes[other]
    for gap, _, _ in doors:
        yield gap


def _cells_in(corners: Points, shape: tuple[int, ...]) -> tuple[Points, Points]:
    """Return the rows and columns of the cells whose centres lie in a rectangle."""
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int), np.array(shape)[::-1])
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    inside = shapely.intersects_xy(shapely.Polygon(corners), x + 0.5, y + 0.5)
    return y[inside], x[inside]


def _sides(gap: MapGap, numbers: npt.NDArray[np.int32]) -> tuple[int, int] | None:
    """Return the numbers of the rooms before and behind a gap, if both exist."""
    along = gap.along()
    across = np.array([-along[1], along[0]])
    rooms: list[int] = []
    for side in (-1.0, 1.0):
        for step in np.arange(gap.depth / 2 + 1.0, gap.depth / 2 + 6.0, 0.5):
            x, y = np.floor(np.array([gap.x, gap.y]) + side * step * across).astype(int)
            if not (0 <= y < numbers.shape[0] and 0 <= x < numbers.shape[1]):
                break
            if numbers[y, x] > 0:
                rooms.append(int(numbers[y, x]))
                break
    return (rooms[0], rooms[1]) if len(rooms) == 2 else None
