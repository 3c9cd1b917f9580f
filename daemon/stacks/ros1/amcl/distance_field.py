"""Distance of each cell of the map from an obstacle, for AMCL's likelihood field.

The original spreads distances outwards from all occupied cells at once, cell by cell (amcl
``map_update_cspace``). A cell keeps the first source that reaches it, even if another one is
nearer. The first one depends on the order of equal distances in a binary heap
(``std::priority_queue`` of libstdc++), so this module repeats that heap move by move. On the
published maps of building C 52 and 53 % of the distances up to 1.9 m are longer than the exact
ones. The differences are at most 25 and 32 cm, on average 1.7 and 1.9 cm. Without the quirk
``amcl_brushfire_distances`` distances are exact.

A field is made once per map; a process keeps those of the last few maps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, distance_transform
from grammars.model.geometry import Floats
from grammars.model.grid import OCCUPIED, OccupancyGrid

_KEPT_FIELDS = 2
"""Fields kept per process, as a campaign runs on one map after the other."""

SquaredCells: TypeAlias = npt.NDArray[np.uint16] | Integers
_MOST_SHORT = int(np.iinfo(np.uint16).max)

_UNREACHED = -1
_CELL_BITS = 32
_CELL_MASK = (1 << _CELL_BITS) - 1


@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Squared distances in cells, shape (rows + 2, columns + 2), read-only.

    The type is uint16, or int32 if ``far`` is too large: 5.9 MB instead of 11.8 for the published
    building. ``far`` is the value of cells farther than ``radius`` cells from any obstacle. A ring
    of ``far`` frames the map, so that points off the map need no special case. ``resolution`` is
    the side [m] of a cell in distances.
    """

    squared: SquaredCells
    radius: int
    resolution: float

    @property
    def far(self) -> int:
        """Value of cells farther than ``radius`` from any obstacle."""
        return self.radius * self.radius + 1

    def distances(self, cap: float) -> Floats:
        """Return the distance [m] for each value of the field, ``cap`` for ``far``."""
        result = np.sqrt(np.arange(self.far + 1)) * self.resolution
        result[self.far] = cap
        return result


def distance_field(grid: OccupancyGrid, cap: float, *, brushfire: bool) -> DistanceField:
    """Return the distances of a map, capped at ``cap`` [m]; equal maps share them.

    With ``brushfire`` they spread as in the original, otherwise they are exact.
    """
    if brushfire:
        # Messages carry the resolution in single precision, in which a cell of 5 cm is a little
        # larger: within 2 m there are 39 whole cells, not 40 (``CachedDistanceMap``).
        resolution = float(np.float32(grid.resolution))
        radius = int(cap / resolution)
    else:
        # Rounding must not lose a whole cell.
        resolution = grid.resolution
        radius = int(cap / resolution + 1e-6)
    occupied = np.packbits(grid.cells == OCCUPIED).tobytes()
    return _distance_field(occupied, grid.cells.shape, radius, resolution, brushfire)


@lru_cache(maxsize=_KEPT_FIELDS)
def _distance_field(
    bits: bytes, shape: tuple[int, ...], radius: int, resolution: float, brushfire: bool
) -> DistanceField:
    cells = np.unpackbits(np.frombuffer(bits, dtype=np.uint8), count=math.prod(shape))
    occupied = cells.reshape(shape)
    if brushfire:
        squared = spread_distances(occupied, radius)
    else:
        squared = _framed(occupied, radius)
        distances = distance_transform(occupied)
        near = distances <= radius
        rounded = (distances[near] ** 2 + np.float32(0.5)).astype(np.int32)
        squared[1:-1, 1:-1][near] = rounded
    # The type decides which machine code is needed, so it follows from the radius alone.
    short = radius * radius + 1 <= _MOST_SHORT
    result: SquaredCells = squared.astype(np.uint16) if short else squared
    result.setflags(write=False)
    return DistanceField(result, radius, resolution)


def _framed(occupied: npt.NDArray[np.uint8], radius: int) -> Integers:
    """Return a framed map that is ``far`` everywhere."""
    rows, columns = occupied.shape
    return np.full((rows + 2, columns + 2), radius * radius + 1, dtype=np.int32)


@kernel
def _rise(heap: npt.NDArray[np.int64], place: int, entry: int) -> None:
    """Let ``entry`` rise from ``place`` past all entries that are farther (``__push_heap``)."""
    distance = entry >> _CELL_BITS
    while place > 0:
        parent = (place - 1) >> 1
        above = heap[parent]
        if above >> _CELL_BITS <= distance:
            break
        heap[place] = above
        place = parent
    heap[place] = entry


@kernel
def _drop_first(heap: npt.NDArray[np.int64], size: int) -> None:
    """Remove the first of ``size`` entries (``__adjust_heap``).

    The gap moves down to the bottom by the nearer of two children, by the second of equal ones.
    The last entry fills it and rises.
    """
    last = size - 1
    entry = heap[last]
    place, child = 0, 2
    while child < last:
        if heap[child] >> _CELL_BITS > heap[child - 1] >> _CELL_BITS:
            child -= 1
        heap[place] = heap[child]
        place = child
        child = 2 * place + 2
    if child == last:
        heap[place] = heap[child - 1]
        place = child - 1
    if last > 0:
        _rise(heap, place, entry)


def spread_distances(occupied: npt.NDArray[np.uint8], radius: int) -> Integers:
    """Return framed squared distances [cells^2] from the source that reaches each cell first.

    ``occupied`` (rows, columns) is non-zero at sources. The frame, and cells without a source
    within ``radius`` [cells], have ``radius^2 + 1``.
    """
    framed = _framed(occupied, radius)
    far, width = radius * radius + 1, framed.shape[1]
    framed[1:-1, 1:-1] = np.where(occupied, 0, _UNREACHED)
    # Column by column, as in the original. All have distance 0, so they keep this order.
    columns, rows = np.nonzero(occupied.T)
    # An entry is the squared distance, in the upper half, and the cell. A cell enters only once.
    heap = np.empty(occupied.size, dtype=np.int64)
    heap[: rows.size] = (rows + 1) * width + columns + 1
    squared, from_source = framed.reshape(-1), np.zeros((2, framed.size), dtype=np.int32)
    _spread(squared, from_source, heap, rows.size, width, far)
    squared[squared == _UNREACHED] = far
    return framed


@kernel
def _spread(
    squared: Integers,
    from_source: Integers,
    heap: npt.NDArray[np.int64],
    size: int,
    width: int,
    far: int,
) -> None:
    """Spread the distances of the first ``size`` cells of ``heap`` over unreached cells.

    ``from_source`` (2, n) receives the offset of a cell from its source: columns and rows.
    """
    while size > 0:
        cell = heap[0] & _CELL_MASK
        x, y = from_source[0, cell], from_source[1, cell]
        for turn in range(4):
            if turn == 0:
                neighbour, u, v = cell - 1, x - 1, y
            elif turn == 1:
                neighbour, u, v = cell - width, x, y - 1
            elif turn == 2:
                neighbour, u, v = cell + 1, x + 1, y
            else:
                neighbour, u, v = cell + width, x, y + 1
            if squared[neighbour] != _UNREACHED:
                continue
            away2 = u * u + v * v
            if away2 < far:
                squared[neighbour] = away2
                from_source[0, neighbour], from_source[1, neighbour] = u, v
                _rise(heap, size, (away2 << _CELL_BITS) | neighbour)
                size += 1
        # This removes the entry that is first by now. If a neighbour is nearer than the current
        # cell, it goes instead without passing its source on, and the cell is processed again.
        _drop_first(heap, size)
        size -= 1
