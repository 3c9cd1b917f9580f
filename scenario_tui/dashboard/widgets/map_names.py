"""Names on a map of cells: where each may stand without covering what is drawn there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Floats
from scenario_tui.dashboard.widgets.block_cells import Mask, fill_areas, ring_edges

_SPOTS: Final = 4
"""Places to go to when something comes by."""
_ASIDE: Final = 2
"""Rows above or below a thing in which its name may stand."""

Place = tuple[int, int]
"""Row and column of the first letter."""


@dataclass(frozen=True, slots=True)
class MapName:
    """A name of one or two lines and the ``spots`` it may stand at, the best first."""

    lines: tuple[str, ...]
    layer: int
    spots: tuple[Place, ...]

    @property
    def width(self) -> int:
        """Cells of the longest line."""
        return max(map(len, self.lines))


def name_area(name: str, layer: int, rings: Sequence[Floats], free: Mask) -> MapName | None:
    """Return a name that stands within an area, as near to its middle as there is room.

    ``rings`` (n, 2) are in cells from the upper left corner; ``free`` (rows, columns) are cells
    with nothing in them.
    """
    rows, columns = free.shape
    inside = fill_areas(ring_edges(rings), columns, rows, even_odd=True)
    if not inside.any():
        return None
    row, column = (float(at.mean()) for at in np.nonzero(inside))
    room = inside & free
    for lines in _broken(name):
        width = max(map(len, lines))
        fits = _runs(room, width)
        for below in range(1, len(lines)):
            fits[:-below] &= fits[below:]
            fits[-below:] = False
        at = np.argwhere(fits)
        if len(at) == 0:
            continue
        # A cell is twice as high as wide.
        far = np.abs(2.0 * (at[:, 0] + (len(lines) - 1) / 2 - row))
        far += np.abs(at[:, 1] + (width - 1) / 2 - column)
        return MapName(lines, layer, tuple(_apart(at[np.argsort(far, kind="stable")], width)))
    return None


def name_thing(
    name: str, layer: int, box: Sequence[float], free: Mask, walls: Mask
) -> MapName | None:
    """Return a name beside a thing, on this side of the ``walls`` (rows, columns) around it.

    ``box`` is left, top, right, bottom of it in cells.
    """
    rows, columns = free.shape
    left, top, right, bottom = (int(np.floor(edge)) for edge in box)
    if right < 0 or bottom < 0 or left >= columns or top >= rows:
        return None
    width = len(name)
    middle, centre = (top + bottom) // 2, (left + right) // 2 - (width - 1) // 2
    wanted = [(middle, right + 2), (middle, left - width - 1)]
    across = slice(max(left, 0), right + 1)
    for step in range(1, _ASIDE + 1):
        for row, between in (
            (top - step, walls[max(top - step + 1, 0) : max(top, 0), across]),
            (bottom + step, walls[bottom + 1 : bottom + step, across]),
        ):
            if not between.any():
                wanted += [(row, column) for column in (centre, right + 1, left - width)]
    spots = [
        (row, column)
        for row, column in wanted
        if 0 <= row < rows
        and 0 <= column <= columns - width
        and free[row, max(column - 1, 0) : column + width + 1].all()
    ]
    return MapName((name,), layer, tuple(spots[:_SPOTS])) if spots else None


def take_place(name: MapName, free: Mask) -> None:
    """Mark where a name stands, with a cell on either side, as no longer free."""
    row, column = name.spots[0]
    free[row : row + len(name.lines), max(column - 1, 0) : column + name.width + 1] = False


def _broken(name: str) -> Iterator[tuple[str, ...]]:
    """Yield a name as it is, then broken behind the underscore nearest to its middle."""
    yield (name,)
    cuts = [index + 1 for index, sign in enumerate(name[:-1]) if sign == "_"]
    if cuts:
        cut = min(cuts, key=lambda at: abs(2 * at - len(name)))
        yield name[:cut], name[cut:]


def _runs(room: Mask, width: int) -> Mask:
    """Return where ``width`` cells to the right, and one more on either side, have room."""
    rows, columns = room.shape
    found = np.zeros(room.shape, dtype=np.bool_)
    # With a cell on either side: letters that touch a wall are hard to read.
    if columns < width + 2:
        return found
    sums = np.zeros((rows, columns + 1), dtype=np.int64)
    np.cumsum(room, axis=1, out=sums[:, 1:])
    length = width + 2
    found[:, 1 : columns - width] = sums[:, length:] - sums[:, : columns + 1 - length] == length
    return found


def _apart(places: npt.NDArray[np.intp], width: int) -> list[Place]:
    """Return the first few places of which none covers much of another."""
    found: list[Place] = []
    for row, column in places[:400].tolist():
        if all(abs(row - r) > 1 or abs(column - c) > width for r, c in found):
            found.append((row, column))
            if len(found) == _SPOTS:
                break
    return found
