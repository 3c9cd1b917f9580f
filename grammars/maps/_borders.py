"""Borders between free, occupied and unknown cells, as arcs that both sides share.

Coordinates are in cells: (0, 0) is the lower left corner of cell (0, 0), x along columns, y along
rows. An arc is closed or runs between two points where three kinds of cells meet. Regions on both
sides consist of the same arcs, so they still fit after an arc is simplified. The points of a
:class:`CellTrack` lie on a straight line if the cells were drawn from one.

In a chequered corner of four cells, occupied cells connect across it first, then unknown cells,
then free cells. A thin slanted wall is therefore one wall.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

Labels = npt.NDArray[np.int8]
"""Kinds of cells such as :data:`UNKNOWN_CELL`, shape (rows, columns)."""
Points = npt.NDArray[np.float64]
"""Points in cells, shape (n, 2)."""

FREE_CELL: Final = 0
UNKNOWN_CELL: Final = 1
OCCUPIED_CELL: Final = 2

_NONE: Final = -1


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """Border between two kinds of cells.

    ``corners`` are the corners of cells that it passes, in order; a closed arc ends with its first
    one. ``chequered`` marks the chequered corners. ``left`` and ``right`` are the kinds of the
    cells beside it.
    """

    corners: npt.NDArray[np.int32]
    chequered: npt.NDArray[np.bool_]
    left: int
    right: int

    @property
    def closed(self) -> bool:
        """True if the arc ends at its beginning."""
        return bool((self.corners[0] == self.corners[-1]).all())


@dataclass(frozen=True, slots=True)
class Loop:
    """Loop of arcs with one region of cells on its left: (index of an arc, is forwards)."""

    arcs: tuple[tuple[int, bool], ...]
    label: int


@dataclass(frozen=True, slots=True)
class Patch:
    """Connected region of one kind of cells: the loop around it and those of its holes."""

    label: int
    outline: Loop
    holes: tuple[Loop, ...]


def trace_borders(labels: Labels) -> list[Arc]:
    """Return all borders of ``labels``; cells beyond its edges are unknown."""
    cells = np.pad(labels, 1, constant_values=UNKNOWN_CELL)
    upright = np.argwhere(cells[:, 1:] != cells[:, :-1])
    level = np.argwhere(cells[1:] != cells[:-1])
    # An upright edge (row, column) goes up from vertex (row, column + 1) of the padded cells; a
    # level edge goes right from vertex (row + 1, column).
    starts: npt.NDArray[np.int64] = np.vstack([np.add(upright, (0, 1)), np.add(level, (1, 0))])
    ends = starts.copy()
    ends[: len(upright), 0] += 1
    ends[len(upright) :, 1] += 1
    partner, chequered = _joined_ends(cells, starts, len(upright))
    return _followed(cells, starts, ends, len(upright), partner, chequered)


def _joined_ends(
    cells: Labels, starts: npt.NDArray[np.int64], uprights: int
) -> tuple[list[int], list[bool]]:
    """Return the partner of every end of an edge, with index 2 * edge + (0 start, 1 end).

    The second value tells whether that end lies in a chequered corner.
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
    meeting = (around != _NONE).sum(axis=0)
    partner = np.full(2 * len(starts), _NONE, dtype=np.int64)

    def join(first: npt.NDArray[np.int32], second: npt.NDArray[np.int32]) -> None:
        partner[first], partner[second] = second, first

    through = around[:, meeting == 2]
    # Two of the four exist: sorting puts them last.
    join(*np.sort(through, axis=0)[2:])
    at = np.argwhere(meeting == 4)
    south_west, south_east = cells[at[:, 0] - 1, at[:, 1] - 1], cells[at[:, 0] - 1, at[:, 1]]
    north_west, north_east = cells[at[:, 0], at[:, 1] - 1], cells[at[:, 0], at[:, 1]]
    rising = np.where(south_west == north_east, south_west, _NONE)
    falling = np.where(north_west == south_east, north_west, _NONE)
    east, north, west, south = around[:, meeting == 4]
    for at_corner, pairs in (
        (rising > falling, ((west, north), (east, south))),
        (rising <= falling, ((north, east), (south, west))),
    ):
        for first, second in pairs:
            join(first[at_corner], second[at_corner])
    chequered = np.zeros(2 * len(starts), dtype=np.bool_)
    chequered[around[:, meeting == 4].ravel()] = True
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
    visited = bytearray(len(starts))
    arcs: list[Arc] = []
    nodes = [end for end, other in enumerate(partner) if other == _NONE]
    for begin in (*nodes, *range(0, len(partner), 2)):
        if visited[begin >> 1]:
            continue
        way: list[int] = []
        end = begin
        while end != _NONE and not visited[end >> 1]:
            visited[end >> 1] = 1
            way.append(end)
            end = partner[end ^ 1]
        ends_of_way = [*way, way[-1] ^ 1]
        corners = vertex[ends_of_way][:, ::-1].astype(np.int32) - 1
        in_chequers = np.array([chequered[end] for end in ends_of_way])
        kinds = _beside(cells, vertex, begin, begin >> 1 < uprights)
        arcs.append(Arc(corners, in_chequers, *kinds))
    return arcs


def _beside(
    cells: Labels, vertex: npt.NDArray[np.int64], end: int, upright: bool
) -> tuple[int, int]:
    """Return the kinds of cells left and right of an edge, with one of its ends behind."""
    row, column = vertex[end & ~1]
    here = int(cells[row, column])
    # The cell at the start of an upright edge is on its right, that of a level edge on its left.
    other = int(cells[row, column - 1] if upright else cells[row - 1, column])
    sides = (other, here) if upright else (here, other)
    return sides if end & 1 == 0 else sides[::-1]


def patches(arcs: Sequence[Arc], rings: Sequence[Points]) -> list[Patch]:
    """Return the regions of free and of occupied cells, in the order of the arcs.

    ``rings`` are points of the arcs such that arcs meet only at their ends.
    """
    loops = _loops(arcs)
    polygons = [shapely.Polygon(loop_points(loop, rings)) for loop in loops]
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
            if loops[shells[k]].label == loops[i].label
        ]
        if around:
            holes[min(around, key=lambda k: (polygons[k].area, k))].append(loops[i])
    return [Patch(loops[i].label, loops[i], tuple(holes[i])) for i in shells]


def _loops(arcs: Sequence[Arc]) -> list[Loop]:
    """Return the loops around all regions of free and of occupied cells, regions on the left."""
    leaving: dict[tuple[int, int, int], tuple[int, bool]] = {}
    for index, arc in enumerate(arcs):
        for forwards in (True, False):
            label = arc.left if forwards else arc.right
            start = arc.corners[0 if forwards else -1].tolist()
            if not arc.closed:
                leaving[(*start, label)] = (index, forwards)
    loops: list[Loop] = []
    visited: set[tuple[int, bool]] = set()
    for index, arc in enumerate(arcs):
        for forwards in (True, False):
            label = arc.left if forwards else arc.right
            if label == UNKNOWN_CELL or (index, forwards) in visited:
                continue
            way = [(index, forwards)]
            visited.add(way[0])
            while not arc.closed:
                last, ahead = way[-1]
                end = arcs[last].corners[-1 if ahead else 0].tolist()
                following = leaving[(*end, label)]
                if following == way[0]:
                    break
                way.append(following)
                visited.add(following)
            loops.append(Loop(tuple(way), label))
    return loops


def loop_points(loop: Loop, lines: Sequence[Points]) -> Points:
    """Return the points of a loop from those of its arcs, without repeating the first."""
    parts = [lines[i] if forwards else lines[i][::-1] for i, forwards in loop.arcs]
    return np.vstack([part[:-1] for part in parts])


@dataclass(frozen=True, slots=True, eq=False)
class CellTrack:
    """Arc as points that two arcs never share: middles of edges, and true corners.

    ``at`` is the position of each point along the arc, in edges. ``corners`` and ``middles`` are
    those of the arc, repeated for a closed one, so that every piece of it is a slice.
    """

    points: Points
    at: npt.NDArray[np.float64]
    corners: Points
    middles: Points

    def passed(self, first: int, last: int) -> tuple[Points, Points]:
        """Return the corners of cells and the middles of edges between two points."""
        low, high = self.at[first], self.at[last]
        corners = self.corners[math.ceil(low) : math.floor(high) + 1]
        return corners, self.middles[math.ceil(low - 0.5) : math.floor(high - 0.5) + 1]


def track_of(arc: Arc) -> CellTrack:
    """Return the points of an arc."""
    corners = arc.corners.astype(np.float64)
    step = np.diff(corners, axis=0)
    edges = len(step)
    middles = corners[:-1] + step / 2
    true = _true_corners(step, arc)
    at = np.sort(np.concatenate([true, np.arange(edges) + 0.5]))
    if arc.closed:
        corners, middles = np.vstack([corners[:-1]] * 2), np.vstack([middles] * 2)
        points = _points_at(at, corners, middles)
        # Cut it open at the point furthest from the middle, which is a true corner if any exists.
        away = np.hypot(*(points - points.mean(axis=0)).T).round(6)
        first = int(away.argmax())
        at = np.concatenate([at[first:], at[: first + 1] + edges])
    return CellTrack(_points_at(at, corners, middles), at, corners, middles)


def _points_at(at: npt.NDArray[np.float64], corners: Points, middles: Points) -> Points:
    whole = np.floor(at).astype(int)
    half = (at > whole)[:, None]
    points: Points = np.where(half, middles[whole % len(middles)], corners[whole % len(corners)])
    return points


def _true_corners(step: Points, arc: Arc) -> npt.NDArray[np.float64]:
    """Return the corners of cells that are not steps of a slanted line, and ends of open arcs.

    True corners have two edges or more on both sides, or belong to a wall or gap one cell wide.
    """
    edges = len(step)
    before = np.roll(step, 1, axis=0)
    turn = np.sign(before[:, 0] * step[:, 1] - before[:, 1] * step[:, 0])
    if not arc.closed:
        turn[0] = 2.0  # an end, not a turn to either side
    bends = np.flatnonzero(turn)
    if not len(bends):
        return np.array([0.0, float(edges)])
    ahead = (np.roll(bends, -1) - bends) % edges
    ahead[ahead == 0] = edges
    if not arc.closed:
        ahead[-1] = edges  # the last piece is never a step of a slanted line, however short
        ahead[0] = edges
    behind = np.roll(ahead, 1)
    long = (ahead >= 2) & (behind >= 2)
    side = turn[bends]
    about = ((side == np.roll(side, -1)) & (ahead == 1)) | (
        (side == np.roll(side, 1)) & (behind == 1)
    )
    free = ~arc.chequered[bends]
    if arc.closed:
        true: npt.NDArray[np.float64] = bends[(long | about) & free].astype(np.float64)
        return true
    bends = bends[((long | about) & free) | (bends == 0)]
    return np.append(bends, edges).astype(np.float64)
