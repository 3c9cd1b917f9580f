"""Connected groups of cells, and the cleaning of a map before its borders are drawn.

Rules of the cleaning, in this order:

- Values of at least 65 are occupied, of at most 25 free, others unknown (as in nav2's map_saver).
- Groups of fewer than ``least_room`` free cells become unknown, except for the largest group.
- Groups of fewer than ``specks`` occupied cells become unknown if no free cell is beside them,
  since no laser inside sees them. Cells of a group may touch at corners.
- Groups of fewer than ``specks`` unknown cells take the kind of most cells beside them.
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

    Cells of one group lie side by side, or also corner to corner. Numbers begin at 1; other cells
    have number 0, with size 0.
    """
    numbers, _ = ndimage.label(cells, _AROUND if diagonally else None)
    sizes = np.bincount(numbers.ravel())
    sizes[0] = 0
    return numbers, sizes


@dataclass(frozen=True, slots=True, eq=False)
class TidyMap:
    """Clean map: the kinds of its cells, and the numbers of changed cells."""

    labels: Labels
    dropped_free: int
    dropped_occupied: int
    filled: int


def tidied(values: npt.NDArray[np.int8], *, least_room: int, specks: int) -> TidyMap:
    """Return the clean kinds of cells of a map of ``values`` (0 to 100, -1 unknown)."""
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
    """Give specks of unknown cells the kind of most cells beside them; return their number."""
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
