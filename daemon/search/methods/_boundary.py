"""The boundary between passing and failing, over one or two ranges: where the margin is zero.

The space is divided into equal cells with results at their corners. Cells where some corners pass
and others fail have the boundary in them and are halved, the largest first; then those whose
corners are so near to zero that it may be inside. What comes out is a mesh that is fine along the
boundary.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, TypeAlias

from daemon.model.search import Point
from daemon.search.methods._history import SearchHistory
from daemon.search.methods._stages import Choice

MOST_PARAMETERS: Final = 2
_CELL: Final = 2**16
"""Of a cell of the first mesh, in steps: it can be halved so often."""
_FEWEST, _MOST = 3, 15
"""Results along a side of the first mesh."""

_Corner: TypeAlias = tuple[int, ...]
"""A place of the mesh, in steps along every axis."""
_Cell: TypeAlias = tuple[_Corner, int]
"""The corner of a cell with the lowest coordinates, and its side, in steps."""
_Values: TypeAlias = Mapping[Point, float | None]
"""What is known of points: their values, ``None`` for those that will never have one."""


class BoundaryStage:
    """Points of a coarse mesh, for half of the runs, then those that halve cells at the boundary.

    Args:
        runs: proposals of the search, by which the first mesh is sized.
        dimensions: ranges, one or two.
    """

    name: Final = "boundary"

    def __init__(self, runs: int, dimensions: int) -> None:
        side = round((runs / 2.0) ** (1.0 / dimensions))
        self._side: Final = min(max(side, _FEWEST), _MOST)
        places = [k * _CELL for k in range(self._side)]
        self._first: Final = list(itertools.product(places, repeat=dimensions))
        self._points: Final[dict[_Corner, Point]] = {}
        self._ready: Final[list[tuple[tuple[float, ...], _Cell]]] = []
        last = places[-1]
        self._waiting: list[_Cell] = [(low, _CELL) for low in self._first if max(low) < last]

    def choose(self, number: int, history: SearchHistory) -> Choice | None:
        """Return the next point of the mesh; an even one where no cell can be halved now."""
        point = self._new(self._first, history)
        if point is not None:
            return point, False
        self._sort(history.outcomes(number), history)
        while self._ready:
            cell = self._ready[0][1]
            point = self._new(_halving(cell), history)
            if point is not None:
                return point, True
            del self._ready[0]
            self._waiting += _halves(cell)
            self._sort(history.outcomes(number), history)
        point = history.next_even()
        return None if point is None else (point, False)

    def _new(self, corners: Sequence[_Corner], history: SearchHistory) -> Point | None:
        points = (self._point(corner, history) for corner in corners)
        return next(filter(history.is_new, points), None)

    def _point(self, corner: _Corner, history: SearchHistory) -> Point:
        if corner not in self._points:
            across = (self._side - 1) * _CELL
            self._points[corner] = history.space.at([steps / across for steps in corner])
        return self._points[corner]

    def _finest(self, history: SearchHistory) -> float:
        """Return the side of the smallest cells that are halved: half of a value's share."""
        levels = max(axis.levels or math.inf for axis in history.space.axes)
        return max(float(self._side - 1) * _CELL / (2.0 * levels), 2.0)

    def _sort(self, values: _Values, history: SearchHistory) -> None:
        """Sort cells in by how much they need to be halved, once their corners are known."""
        waiting, self._waiting = self._waiting, []
        finest = self._finest(history)
        for cell in waiting:
            corners = [self._point(corner, history) for corner in _corners(cell)]
            known = [values[point] for point in corners if point in values]
            # A corner that is not allowed never has a result: the others decide.
            if len(known) < sum(map(history.space.allowed, corners)):
                self._waiting.append(cell)
                continue
            margins = [value for value in known if value is not None]
            if margins and cell[1] >= finest:
                bisect.insort(self._ready, (_need(margins, cell[1]), cell))


def _need(margins: Sequence[float], side: int) -> tuple[float, ...]:
    """Return by what cells are sorted: lower is halved first."""
    nearest, spread = min(map(abs, margins)), max(margins) - min(margins)
    if min(margins) < 0.0 <= max(margins):
        return (0.0, -side, nearest)
    # Zero is the nearer the less the margins would have to change beyond what they do change here.
    return (1.0, nearest / spread if spread > 0.0 else math.inf, -side)


def _corners(cell: _Cell) -> Iterator[_Corner]:
    low, side = cell
    for offset in itertools.product((0, side), repeat=len(low)):
        yield tuple(a + b for a, b in zip(low, offset, strict=True))


def _halving(cell: _Cell) -> list[_Corner]:
    """Return the corners of the halves of a cell, its middle first."""
    low, side = cell
    half = side // 2
    offsets = itertools.product((half, 0, side), repeat=len(low))
    return [tuple(a + b for a, b in zip(low, offset, strict=True)) for offset in offsets]


def _halves(cell: _Cell) -> list[_Cell]:
    low, side = cell
    half = side // 2
    offsets = itertools.product((0, half), repeat=len(low))
    return [(tuple(a + b for a, b in zip(low, o, strict=True)), half) for o in offsets]
