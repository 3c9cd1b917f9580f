"""The borders between free, occupied and unknown cells, as arcs that both sides share.

Coordinates are in cells: (0, 0) is the lower left corner of cell (0, 0), x along columns, y along
rows. An arc runs between two points where three kinds of cells meet, or is closed; since the pieces
of floor on both of its sides are put together from the same arcs, they still fit when an arc has
been made simpler.

Where four cells meet in a chequered corner, occupied cells hold together across it (a thin wall
drawn slantwise is one wall), then unknown ones, then free ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

Labels = npt.NDArray[np.int8]
"""Kinds of cells, shape (rows, columns): :data:`UNKNOWN_CELL` and its like."""
Points = npt.NDArray[np.float64]
"""Points in cells, shape (n, 2)."""

FREE_CELL: Final = 0
UNKNOWN_CELL: Final = 1
OCCUPIED_CELL: Final = 2

_NONE: Final = -1


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """A border between two kinds of cells.

    ``corners`` are the corners of cells it passes, one after another; a closed arc ends with its
    first one. ``chequered`` says in which of them four cells meet in a chequered corner. ``left``
    and ``right`` are the kinds of the cells beside it.
    """

    corners: npt.NDArray[np.int32]
    chequered: npt.NDArray[np.bool_]
    left: int
    right: int

    @property
    def closed(self) -> bool:
        """Whether it ends where it begins without a point where three kinds meet."""
        return bool((self.corners[0] == self.corners[-1]).all())


@dataclass(frozen=True, slots=True)
class Loop:
    """A way along arcs that has one region of cells on its left: (index of an arc, forwards)."""

    arcs: tuple[tuple[int, bool], ...]
    label: int


@dataclass(frozen=True, slots=True)
class Patch:
    """A connected region of one kind of cells: the loop around it and those of its holes."""

    label: int
    outline: Loop
    holes: tuple[Loop, ...]


def trace_borders(labels: Labels) -> list[Arc]:
    """Return all borders of ``labels``, what lies beyond its edges being unknown."""
    cells = np.pad(labels, 1, constant_values=UNKNOWN_CELL)
    upright = np.argwhere(cells[:, 1:] != cells[:, :-1])
    level = np.argwhere(cells[1:] != cells[:-1])
    # Edge (row, column) of the upright ones goes up from vertex (row, column + 1) of the padded
    # cells, of the level ones to the right from vertex (row + 1, column).
    starts: npt.NDArray[np.int64] = np.vstack([np.add(upright, (0, 1)), np.add(level, (1, 0))])
    ends = starts.copy()
    ends[: len(upright), 0] += 1
    ends[len(upright) :, 1] += 1
    partner, chequered = _joined_ends(cells, starts, len(upright))
    return _followed(cells, starts, ends, len(upright), partner, chequered)


def _joined_ends(
    cells: Labels, starts: npt.NDArray[np.int64], uprights: int
) -> tuple[list[int], list[bool]]:
    """Return which end of an edge goes on with which, by 2 * edge + (0 start, 1 end).

    Also whether that end lies in a chequered corner.
    """
    rows, columns = cells.shape
    shape = (rows + 1, columns + 1)
    around = np.full((4, *shape), _NONE, dtype=np.int32)  # east, north, west, south of a vertex
    row, column = starts.T
    edge = np.arange(len(starts), dtype=np.int32)
    up, right = edge[:uprights], edge[uprights:]
    around[1, row[:uprights], column[:uprights]] = 2 * up
    around[3, row[:uprights] + 1, column[:uprights]] = 2 * up + 1
    around[0, row[uprights:], column[uprights:]] = 2 * right
    around[2, row[uprights:], column[uprights:] + 1] = 2 * right + 1
    met = (around != _NONE).sum(axis=0)
    partner = np.full(2 * len(starts), _NONE, dtype=np.int64)

    def join(first: npt.NDArray[np.int32], second: npt.NDArray[np.int32]) -> None:
        partner[first], partner[second] = second, first

    through = around[:, met == 2]
    # Two of the four are there: sorting puts them last.
    join(*np.sort(through, axis=0)[2:])
    at = np.argwhere(met == 4)
    south_west, south_east = cells[at[:, 0] - 1, at[:, 1] - 1], cells[at[:, 0] - 1, at[:, 1]]
    north_west, north_east = cells[at[:, 0], at[:, 1] - 1], cells[at[:, 0], at[:, 1]]
    rising = np.where(south_west == north_east, south_west, _NONE)
    falling = np.where(north_west == south_east, north_west, _NONE)
    east, north, west, south = around[:, met == 4]
    for chosen, pairs in (
        (rising > falling, ((west, north), (east, south))),
        (rising <= falling, ((north, east), (south, west))),
    ):
        for first, second in pairs:
            join(first[chosen], second[chosen])
    chequered = np.zeros(2 * len(starts), dtype=np.bool_)
    chequered[around[:, met == 4].ravel()] = True
    return partner.tolist(), chequered.tolist()


def _followed(
    cells: Labels,
    starts: npt.NDArray[np.int64],
    ends: npt.NDArray[np.int64],
    uprights: int,
    partner: Sequence[int],
    chequered: Sequence[bool],
) -> list[Arc]:
    """Return the arcs: those between nodes first, each from its lowest end on."""
    vertex = np.stack([starts, ends], axis=1).reshape(-1, 2)
    seen = bytearray(len(starts))
    arcs: list[Arc] = []
    nodes = [end for end, other in enumerate(partner) if other == _NONE]
    for begin in (*nodes, *range(0, len(partner), 2)):
        if seen[begin >> 1]:
            continue
        way: list[int] = []
        end = begin
        while end != _NONE and not seen[end >> 1]:
            seen[end >> 1] = 1
            way.append(end)
            end = partner[end ^ 1]
        passed = [*way, way[-1] ^ 1]
        corners = vertex[passed][:, ::-1].astype(np.int32) - 1
        crossed = np.array([chequered[end] for end in passed])
        arcs.append(Arc(corners, crossed, *_beside(cells, vertex, begin, begin >> 1 < uprights)))
    return arcs


def _beside(
    cells: Labels, vertex: npt.NDArray[np.int64], end: int, upright: bool
) -> tuple[int, int]:
    """Return the kinds of cells on the left and on the right of an edge left by one of its ends."""
    row, column = vertex[end & ~1]
    here = int(cells[row, column])
    # Up: the cell at its start lies on the right; to the right: on the left.
    other = int(cells[row, column - 1] if upright else cells[row - 1, column])
    left, right = (other, here) if upright else (here, other)
    return (left, right) if end & 1 == 0 else (right, left)


def patches(arcs: Sequence[Arc], rings: Sequence[Points]) -> list[Patch]:
    """Put the borders together to regions of free and of occupied cells.

    ``rings`` are the points of each arc in which no two arcs cross or touch but at their ends.
    The order is that of the arcs.
    """
    found = list(_loops(arcs))
    polygons = [shapely.Polygon(loop_points(loop, rings)) for loop in found]
    inside_left = [not shapely.is_ccw(polygon.exterior) for polygon in polygons]
    shells = [i for i, hole in enumerate(inside_left) if not hole]
    tree = shapely.STRtree([polygons[i] for i in shells])
    holes: dict[int, list[Loop]] = {i: [] for i in shells}
    for i, hole in enumerate(inside_left):
        if not hole:
            continue
        around = [
            shells[k]
            for k in tree.query(polygons[i], predicate="within").tolist()
            if found[shells[k]].label == found[i].label
        ]
        if around:
            holes[min(around, key=lambda k: (polygons[k].area, k))].append(found[i])
    return [Patch(found[i].label, found[i], tuple(holes[i])) for i in shells]


def _loops(arcs: Sequence[Arc]) -> list[Loop]:
    """Return the ways around all regions of free and of occupied cells, these on the left."""
    leaving: dict[tuple[int, int, int], tuple[int, bool]] = {}
    for index, arc in enumerate(arcs):
        for forwards in (True, False):
            label = arc.left if forwards else arc.right
            start = arc.corners[0 if forwards else -1].tolist()
            if not arc.closed:
                leaving[(*start, label)] = (index, forwards)
    loops: list[Loop] = []
    seen: set[tuple[int, bool]] = set()
    for index, arc in enumerate(arcs):
        for forwards in (True, False):
            label = arc.left if forwards else arc.right
            if label == UNKNOWN_CELL or (index, forwards) in seen:
                continue
            way = [(index, forwards)]
            seen.add(way[0])
            while not arc.closed:
                last, ahead = way[-1]
                end = arcs[last].corners[-1 if ahead else 0].tolist()
                following = leaving[(*end, label)]
                if following == way[0]:
                    break
                way.append(following)
                seen.add(following)
            loops.append(Loop(tuple(way), label))
    return loops


def loop_points(loop: Loop, lines: Sequence[Points]) -> Points:
    """Return the points of a loop, the first not repeated, taken from those of its arcs."""
    parts = [lines[i] if forwards else lines[i][::-1] for i, forwards in loop.arcs]
    return np.vstack([part[:-1] for part in parts])
