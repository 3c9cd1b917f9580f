"""The boundary between passing and failing, a margin of zero, over one or two ranges.

The space is divided into equal cells with results at their corners. Cells with passing and failing
corners contain the boundary and are halved, the largest first; then those with corners near zero,
which may contain it. The result is a mesh that is fine along the boundary.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final, TypeAlias

from daemon.model.search import Point
from daemon.search.space import SearchSpace

MOST_PARAMETERS: Final = 2
_CELL: Final = 2**16
"""Side of a cell of the first mesh, in steps: it can be halved 16 times."""
_FEWEST, _MOST = 3, 15
"""Least and greatest number of results along a side of the first mesh."""

_Corner: TypeAlias = tuple[int, ...]
"""A place of the mesh, in steps along every axis."""
_Cell: TypeAlias = tuple[_Corner, int]
"""The corner of a cell with the lowest coordinates, and its side, in steps."""
_Values: TypeAlias = Mapping[Point, float | None]
"""The values of points with a result, ``None`` for a result without a value."""


class BoundaryMesh:
    """Points of a coarse mesh, for half of the ``runs``, then points that halve cells."""

    def __init__(self, runs: int, space: SearchSpace) -> None:
        self._space: Final = space
        side = round((runs / 2.0) ** (1.0 / space.dimensions))
        side = min(max(side, _FEWEST), _MOST)
        self._across: Final = (side - 1) * _CELL
        # Half of a value's share: smaller cells contain no new values.
        levels = max(axis.levels for axis in space.axes)
        self._finest: Final = max(self._across / (2.0 * levels), 2.0)
        places = range(0, side * _CELL, _CELL)
        self._first: Final = list(itertools.product(places, repeat=space.dimensions))
        self._points: Final[dict[_Corner, Point]] = {}
        self._ready: Final[list[tuple[tuple[float, ...], _Cell]]] = []
        self._waiting: list[_Cell] = [
            (low, _CELL) for low in self._first if max(low) < self._across
        ]

    def choose(self, values: _Values, is_new: Callable[[Point], bool]) -> tuple[Point, bool] | None:
        """Return the next point and whether it halves a cell; ``None`` if no cell is ready yet.

        ``values`` are those of all points with a result.
        """

        def new(corners: Iterable[_Corner]) -> Point | None:
            return next(filter(is_new, map(self._point, corners)), None)

        point = new(self._first)
        if point is not None:
            return point, False
        self._sort(values)
        while self._ready:
            cell = self._ready[0][1]
            point = new(_halving(cell))
            if point is not None:
                return point, True
            del self._ready[0]
            self._waiting += _halves(cell)
            self._sort(values)
        return None

    def _point(self, corner: _Corner) -> Point:
        if corner not in self._points:
            self._points[corner] = self._space.at([steps / self._across for steps in corner])
        return self._points[corner]

    def _sort(self, values: _Values) -> None:
        """Sort cells with known corners by their need to be halved."""
        waiting, self._waiting = self._waiting, []
        for cell in waiting:
            corners = [self._point(corner) for corner in _corners(cell)]
            results = [values[point] for point in corners if point in values]
            # A forbidden corner never has a result, so the others decide.
            if len(results) < sum(map(self._space.allowed, corners)):
                self._waiting.append(cell)
                continue
            margins = [value for value in results if value is not None]
            if margins and cell[1] >= self._finest:
                bisect.insort(self._ready, (_need(margins, cell[1]), cell))


def _need(margins: Sequence[float], side: int) -> tuple[float, ...]:
    """Return the rank of a cell: lower ones are halved first."""
    nearest, spread = min(map(abs, margins)), max(margins) - min(margins)
    if min(margins) < 0.0 <= max(margins):
        return (0.0, -side, nearest)
    # The distance to zero is relative to the spread of margins in the cell.
    return (1.0, nearest / spread if spread > 0.0 else math.inf, -side)


def _corners(cell: _Cell) -> list[_Corner]:
    return _offset(cell, (0, cell[1]))


def _halving(cell: _Cell) -> list[_Corner]:
    """Return the corners of the halves of a cell, the middle first."""
    return _offset(cell, (cell[1] // 2, 0, cell[1]))


def _halves(cell: _Cell) -> list[_Cell]:
    half = cell[1] // 2
    return [(low, half) for low in _offset(cell, (0, half))]


def _offset(cell: _Cell, steps: tuple[int, ...]) -> list[_Corner]:
    """Return the lowest corner of a cell, moved by each of ``steps`` along each axis."""
    low, _ = cell
    offsets = itertools.product(steps, repeat=len(low))
    return [tuple(a + b for a, b in zip(low, offset, strict=True)) for offset in offsets]
