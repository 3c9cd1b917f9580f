"""The likelihood field's ground: how far each cell of the map is from the nearest obstacle.

Distances run between cell centres and are capped at ``laser_likelihood_max_dist``. The original
spreads them cell by cell (amcl ``map_cspace``), which rarely misses the nearest obstacle by a
fraction of a cell; here they are exact. They are kept squared, as whole numbers, so that
every sensor model is a table over them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import blake2b

import numpy as np
import numpy.typing as npt

from daemon.navigation.distance import distance_transform
from daemon.navigation.kernels import Integers, Singles, kernel
from grammars.grid import OCCUPIED, OccupancyGrid
from grammars.values import Floats

_KEPT = 2
"""Fields kept per process: those of the maps a campaign runs on, one after the other."""


@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Squared distances in cells, int32, shape (rows + 2, columns + 2), read-only.

    The map is framed by a ring of ``far``, the value of whatever lies farther than ``radius``
    cells from any obstacle, so that points off the map need no special case.
    """

    squared: Integers
    radius: int

    @property
    def far(self) -> int:
        """The value of cells farther than ``radius`` from any obstacle."""
        return self.radius * self.radius + 1

    def distances(self, resolution: float, cap: float) -> Floats:
        """Return the distance [m] each value of the field stands for, ``cap`` for ``far``."""
        result = np.sqrt(np.arange(self.far + 1)) * resolution
        result[self.far] = cap
        return result


@dataclass(frozen=True, slots=True)
class _Key:
    """Equal for equal maps, whoever read them."""

    digest: bytes
    shape: tuple[int, ...]
    radius: int
    cells: npt.NDArray[np.int8] = field(compare=False)


def distance_field(grid: OccupancyGrid, cap: float) -> DistanceField:
    """Return the distances of a map, capped at ``cap`` [m]; equal maps share them."""
    cells = np.ascontiguousarray(grid.cells)
    # A whole number of cells must not be lost to rounding.
    radius = int(cap / grid.resolution + 1e-6)
    return _distance_field(_Key(blake2b(cells.data).digest(), cells.shape, radius, cells))


@lru_cache(maxsize=_KEPT)
def _distance_field(key: _Key) -> DistanceField:
    distances = distance_transform((key.cells == OCCUPIED).view(np.uint8))
    squared = _framed(distances, key.radius)
    squared.setflags(write=False)
    return DistanceField(squared, key.radius)


@kernel
def _framed(distances: Singles, radius: int) -> Integers:
    """Square, cap and frame distances in cells."""
    rows, columns = distances.shape
    far = np.int32(radius * radius + 1)
    squared = np.full((rows + 2, columns + 2), far, dtype=np.int32)
    for r in range(rows):
        for c in range(columns):
            d = distances[r, c]
            if d <= radius:
                squared[r + 1, c + 1] = np.int32(d * d + np.float32(0.5))
    return squared
