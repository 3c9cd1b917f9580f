"""Connected groups of cells, and a map tidied before its borders are drawn.

The rules, in this order:

- at least 65 of 100 is occupied, at most 25 free (the thresholds of nav2's map_saver), all else
  unknown;
- free cells are kept where at least ``least_room`` hang together, side by side, and in any case the
  largest such group; others become unknown;
- occupied cells are dropped where fewer than ``specks`` hang together (also across corners) and
  none of them lies beside a free cell that is kept: no laser that is inside sees them;
- unknown cells of which fewer than ``specks`` hang together become what most cells beside them are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from grammars.maps._borders import FREE_CELL, OCCUPIED_CELL, UNKNOWN_CELL, Labels

Cells = npt.NDArray[np.bool_]

_OCCUPIED_FROM: Final = 65
_FREE_TO: Final = 25
_AROUND: Final = np.ones((3, 3), dtype=np.bool_)
"""A cell and the eight around it."""


def connected(
    cells: Cells, *, diagonally: bool = False
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Return the group number of every cell, and the sizes of the groups [cells].

    Cells of one group lie side by side, or also corner to corner. Groups are numbered from 1 on;
    group 0, of size 0, is what belongs to none.
    """
    numbers, _ = ndimage.label(cells, _AROUND if diagonally else None)
    sizes = np.bincount(numbers.ravel())
    sizes[0] = 0
    return numbers, sizes


@dataclass(frozen=True, slots=True, eq=False)
class TidyMap:
    """The kinds of cells that are drawn, and how many cells were changed."""

    labels: Labels
    dropped_free: int
    dropped_occupied: int
    filled: int


def tidied(values: npt.NDArray[np.int8], *, least_room: int, specks: int) -> TidyMap:
    """Return the kinds of cells of a map of ``values`` (0 to 100, -1 unknown), tidied."""
    labels: Labels = np.full(values.shape, UNKNOWN_CELL, dtype=np.int8)
    labels[(values >= 0) & (values <= _FREE_TO)] = FREE_CELL
    labels[values >= _OCCUPIED_FROM] = OCCUPIED_CELL

    numbers, sizes = connected(labels == FREE_CELL)
    pockets = (sizes < min(least_room, int(sizes.max())))[numbers] & (numbers > 0)
    labels[pockets] = UNKNOWN_CELL

    numbers, sizes = connected(labels == OCCUPIED_CELL, diagonally=True)
    near = np.zeros(len(sizes), dtype=np.bool_)
    near[numbers[ndimage.binary_dilation(labels == FREE_CELL, _AROUND)]] = True
    noise = ((sizes < specks) & ~near)[numbers] & (numbers > 0)
    labels[noise] = UNKNOWN_CELL

    filled = _fill(labels, specks)
    return TidyMap(labels, int(pockets.sum()), int(noise.sum()), filled)


def _fill(labels: Labels, specks: int) -> int:
    """Give specks of unknown cells the kind of most cells beside them; return how many cells."""
    numbers, sizes = connected(labels == UNKNOWN_CELL)
    around = np.pad(labels, 1, constant_values=UNKNOWN_CELL)
    sides = (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:])
    free, occupied = (
        sum(np.bincount(numbers[side == label], minlength=len(sizes)) for side in sides)
        for label in (FREE_CELL, OCCUPIED_CELL)
    )
    kinds = np.where(free > occupied, FREE_CELL, OCCUPIED_CELL)
    filled = ((sizes < specks) & (free + occupied > 0))[numbers] & (numbers > 0)
    labels[filled] = kinds[numbers[filled]]
    return int(filled.sum())
