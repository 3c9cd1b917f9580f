"""Connected groups of cells, and what is tidied on a map before its borders are drawn.

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

from grammars.maps._borders import FREE_CELL, OCCUPIED_CELL, UNKNOWN_CELL, Labels

Cells = npt.NDArray[np.bool_]

_OCCUPIED_FROM: Final = 65
_FREE_TO: Final = 25


@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Groups of connected cells: runs of a row that belong to a group each.

    ``rows``, ``starts`` and ``ends`` are the runs (ends exclusive), ``group`` the number of each
    one's group, in the order of their first cell; ``sizes`` are those of the groups [cells].
    """

    rows: npt.NDArray[np.int64]
    starts: npt.NDArray[np.int64]
    ends: npt.NDArray[np.int64]
    group: npt.NDArray[np.int64]
    sizes: npt.NDArray[np.int64]
    shape: tuple[int, int]

    def cells(self, chosen: npt.NDArray[np.bool_]) -> Cells:
        """Return the cells of the groups that are chosen, by number."""
        runs = chosen[self.group] if len(self.group) else np.zeros(0, dtype=np.bool_)
        change = np.zeros((self.shape[0], self.shape[1] + 1), dtype=np.int8)
        change[self.rows[runs], self.starts[runs]] = 1
        change[self.rows[runs], self.ends[runs]] = -1
        return np.cumsum(change, axis=1, dtype=np.int8)[:, :-1].astype(np.bool_)

    def numbers(self) -> npt.NDArray[np.int32]:
        """Return the number of every cell's group, -1 for cells of none."""
        change = np.zeros((self.shape[0], self.shape[1] + 1), dtype=np.int32)
        change[self.rows, self.starts] += (self.group + 1).astype(np.int32)
        np.subtract.at(change, (self.rows, self.ends), (self.group + 1).astype(np.int32))
        return np.cumsum(change, axis=1, dtype=np.int32)[:, :-1] - 1


def connected(cells: Cells, *, diagonally: bool = False) -> Groups:
    """Return the groups of cells that lie side by side, or also corner to corner."""
    rows, columns = cells.shape
    stride = columns + 2
    change = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, start = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    # In one line of all rows, each with a gap after it: runs beside each other in neighbouring
    # rows are a stride apart.
    flat_start, flat_end = row * stride + start, row * stride + end
    reach = 1 if diagonally else 0
    first = np.searchsorted(flat_end, flat_start + stride - reach, side="right")
    after = np.searchsorted(flat_start, flat_end + stride + reach, side="left")
    count = np.maximum(after - first, 0)
    upper = np.repeat(np.arange(len(row)), count)
    offset = np.arange(len(upper)) - np.repeat(np.cumsum(count) - count, count)
    group = _joined(len(row), upper, np.repeat(first, count) + offset)
    _, group = np.unique(group, return_inverse=True)
    sizes = np.bincount(group, weights=end - start).astype(np.int64)
    return Groups(row, start, end, group, sizes, (rows, columns))


def _joined(
    count: int, one: npt.NDArray[np.int64], other: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """Return the lowest number that each is joined with, over any number of steps."""
    lowest = np.arange(count)
    while True:
        low = np.minimum(lowest[one], lowest[other])
        before = lowest.copy()
        np.minimum.at(lowest, lowest[one], low)
        np.minimum.at(lowest, lowest[other], low)
        while (lowest[lowest] != lowest).any():
            lowest = lowest[lowest]
        if (lowest == before).all():
            return lowest


def grown(cells: Cells, *, diagonally: bool = False) -> Cells:
    """Return the cells and those beside them."""
    wide = np.pad(cells, 1)
    upright = wide[:-2] | wide[1:-1] | wide[2:]
    if diagonally:
        return upright[:, :-2] | upright[:, 1:-1] | upright[:, 2:]
    level = wide[1:-1]
    return upright[:, 1:-1] | level[:, :-2] | level[:, 2:]


@dataclass(frozen=True, slots=True, eq=False)
class TidyMap:
    """The kinds of cells that are drawn, and how many cells were changed."""

    labels: Labels
    dropped_free: int
    dropped_occupied: int
    filled: int


def tidied(values: npt.NDArray[np.int8], *, least_room: int, specks: int) -> TidyMap:
    """Return what is free, occupied and unknown in a map of ``values`` (0 to 100, -1 unknown)."""
    labels: Labels = np.full(values.shape, UNKNOWN_CELL, dtype=np.int8)
    labels[(values >= 0) & (values <= _FREE_TO)] = FREE_CELL
    labels[values >= _OCCUPIED_FROM] = OCCUPIED_CELL

    free = connected(labels == FREE_CELL)
    small = free.sizes < min(least_room, int(free.sizes.max(initial=0)))
    pockets = free.cells(small)
    labels[pockets] = UNKNOWN_CELL

    walls = connected(labels == OCCUPIED_CELL, diagonally=True)
    seen = grown(labels == FREE_CELL, diagonally=True)
    near = np.zeros(len(walls.sizes), dtype=np.bool_)
    numbers = walls.numbers()
    near[numbers[seen & (numbers >= 0)]] = True
    lost = walls.cells((walls.sizes < specks) & ~near)
    labels[lost] = UNKNOWN_CELL

    filled = _fill(labels, specks)
    return TidyMap(labels, int(pockets.sum()), int(lost.sum()), filled)


def _fill(labels: Labels, specks: int) -> int:
    """Give specks of unknown cells the kind of most cells beside them; return how many cells."""
    unknown = connected(labels == UNKNOWN_CELL)
    numbers = np.pad(unknown.numbers(), 1, constant_values=-1)
    small = np.append(unknown.sizes < specks, False)
    around = np.pad(labels, 1, constant_values=UNKNOWN_CELL)
    votes = np.zeros((2, len(small)), dtype=np.int64)
    inner = numbers[1:-1, 1:-1]
    for beside in (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:]):
        for kind, label in enumerate((FREE_CELL, OCCUPIED_CELL)):
            votes[kind] += np.bincount(inner[beside == label] + 1, minlength=len(small) + 1)[1:][
                : len(small)
            ]
    count = 0
    for kind, label in enumerate((FREE_CELL, OCCUPIED_CELL)):
        more = votes[kind] > votes[1 - kind] if kind == 0 else votes[1] >= votes[0]
        chosen = small & more & (votes.sum(axis=0) > 0)
        cells = unknown.cells(chosen[:-1])
        labels[cells] = label
        count += int(cells.sum())
    return count
