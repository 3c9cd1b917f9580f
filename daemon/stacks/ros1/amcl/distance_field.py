"""Distance of each cell of the map from an obstacle, as AMCL's likelihood models take it.

The original spreads distances outwards from all occupied cells at once, cell by cell (amcl
``map_update_cspace``): a cell keeps the first source that reaches it, also when another one is
nearer. Which one comes first depends on the order of equal distances in its queue, a binary heap
(``std::priority_queue`` of libstdc++), so that heap is kept here move by move. On the published
maps of building C 52 and 53 % of the distances up to 1.9 m are longer than the exact ones, by 25
and 32 cm at most, by 1.7 and 1.9 cm on average. Without the quirk ``amcl_brushfire_distances`` they
are exact.

A field is made once per map; a process keeps those of the few maps used last.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import blake2b
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, distance_transform
from grammars.model.geometry import Floats
from grammars.model.grid import OCCUPIED, OccupancyGrid

_KEPT_FIELDS = 2
"""Fields kept per process: those of the maps a campaign runs on, one after the other."""

SquaredCells: TypeAlias = npt.NDArray[np.uint16] | Integers
_MOST_SHORT = int(np.iinfo(np.uint16).max)

_UNREACHED = -1
_CELL_BITS = 32
_CELL_MASK = (1 << _CELL_BITS) - 1


@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Squared distances in cells, shape (rows + 2, columns + 2), read-only.

    They are uint16 unless ``far`` is too large for it, then int32: of the published building they
    take 5.9 MB instead of 11.8. The map is framed by a ring of ``far``, the value of whatever lies
    farther than ``radius`` cells from any obstacle, so that points off the map need no special
    case. ``resolution`` is the side [m] of a cell as distances are reckoned with it.
    """

    squared: SquaredCells
    radius: int
    resolution: float

    @property
    def far(self) -> int:
        """The value of cells farther than ``radius`` from any obstacle."""
        return self.radius * self.radius + 1

    def distances(self, cap: float) -> Floats:
        """Return the distance [m] each value of the field stands for, ``cap`` for ``far``."""
        result = np.sqrt(np.arange(self.far + 1)) * self.resolution
        result[self.far] = cap
        return result


@dataclass(frozen=True, slots=True)
class _MapKey:
    """Equal for equal maps, whoever read them."""

    digest: bytes
    shape: tuple[int, ...]
    radius: int
    resolution: float
    brushfire: bool
    cells: npt.NDArray[np.int8] = field(compare=False)


def distance_field(grid: OccupancyGrid, cap: float, *, brushfire: bool) -> DistanceField:
    """Return the distances of a map, capped at ``cap`` [m]; equal maps share them.

    ``brushfire`` spreads them as the original does, otherwise they are exact.
    """
    cells = np.ascontiguousarray(grid.cells)
    if brushfire:
        # Messages carry the resolution in single precision, in which a cell of 5 cm is a little
        # larger: within 2 m there are 39 whole cells, not 40 (``CachedDistanceMap``).
        resolution = float(np.float32(grid.resolution))
        radius = int(cap / resolution)
    else:
        # A whole number of cells must not be lost to rounding.
        resolution = grid.resolution
        radius = int(cap / resolution + 1e-6)
    digest = blake2b(cells.data).digest()
    return _distance_field(_MapKey(digest, cells.shape, radius, resolution, brushfire, cells))


@lru_cache(maxsize=_KEPT_FIELDS)
def _distance_field(key: _MapKey) -> DistanceField:
    occupied = (key.cells == OCCUPIED).view(np.uint8)
    if key.brushfire:
        squared = spread_distances(occupied, key.radius)
    else:
        squared = _framed(occupied, key.radius)
        distances = distance_transform(occupied)
        near = distances <= key.radius
        rounded = (distances[near] ** 2 + np.float32(0.5)).astype(np.int32)
        squared[1:-1, 1:-1][near] = rounded
    # By the radius and not by what occurs: the type decides which machine code is needed.
    short = key.radius * key.radius + 1 <= _MOST_SHORT
    kept: SquaredCells = squared.astype(np.uint16) if short else squared
    kept.setflags(write=False)
    return DistanceField(kept, key.radius, key.resolution)


def _framed(occupied: npt.NDArray[np.uint8], radius: int) -> Integers:
    """Return a framed map of cells farther than ``radius`` cells from any obstacle."""
    rows, columns = occupied.shape
    return np.full((rows + 2, columns + 2), radius * radius + 1, dtype=np.int32)


@kernel
def _rise(heap: npt.NDArray[np.int64], place: int, entry: int) -> None:
    """Put ``entry`` at ``place`` or above, below all that are not farther (``__push_heap``)."""
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
    """Take the first of ``size`` entries off (``__adjust_heap``).

    The gap goes down to the bottom by the nearer of two children, of equal ones the second; there
    the last entry is put and rises.
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

    ``occupied`` (rows, columns) is non-zero at sources; the frame and cells that none reaches
    within ``radius`` [cells] have ``radius^2 + 1``.
    """
    framed = _framed(occupied, radius)
    far, width = radius * radius + 1, framed.shape[1]
    framed[1:-1, 1:-1] = np.where(occupied, 0, _UNREACHED)
    # Column by column, as the original takes them. All at distance 0, they stay in that order.
    columns, rows = np.nonzero(occupied.T)
    # An entry is the squared distance, in the upper half, and the cell: no cell enters twice.
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
    """Spread the distances of the first ``size`` cells of ``heap`` over cells that have none.

    ``from_source`` (2, n) takes where a cell lies from its source, by column and by row.
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
        # What goes is what is first by now: a neighbour nearer than the cell just done goes in its
        # stead without passing its source on, and the cell is done once more.
        _drop_first(heap, size)
        size -= 1
