"""Grid of costs that costmaps, planners and controllers share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

FREE_SPACE: Final = 0
INSCRIBED: Final = 253
LETHAL: Final = 254
NO_INFORMATION: Final = 255
Window: TypeAlias = tuple[int, int, int, int]
"""Half-open window of cells: first column, first row, end column, end row."""
EMPTY_WINDOW: Final = (0, 0, 0, 0)


@dataclass(slots=True, eq=False)
class ChangedWindow:
    """Window of a grid that has been touched since its reader last took it."""

    window: Window = EMPTY_WINDOW

    def add(self, window: Window) -> None:
        """Grow to the union with another window."""
        self.window = _window_union(self.window, window)

    def take(self) -> Window:
        """Return the window and start again with an empty one."""
        window, self.window = self.window, EMPTY_WINDOW
        return window


@dataclass(slots=True, eq=False)
class CostGrid:
    """A costmap's master grid: ``cells`` of shape (rows, columns), uint8, row 0 at the lowest y.

    The lower-left corner of cell (0, 0) lies at (``x``, ``y``) [m] in the costmap's global frame
    (``map`` or ``odom``). Every writer calls :meth:`touch`, which changes ``version`` and extends
    the window of each reader (:meth:`watch`).
    """

    resolution: float
    x: float
    y: float
    cells: npt.NDArray[np.uint8]
    version: int = 0
    disturbed: Window = EMPTY_WINDOW
    """Window of cells written by others since the costmap's last update."""
    readers: list[ChangedWindow] = field(default_factory=list)

    def touch(self, window: Window) -> None:
        """Report that cells of the ``window`` may have changed."""
        if window[0] >= window[2] or window[1] >= window[3]:
            return
        self.version += 1
        self.disturbed = _window_union(self.disturbed, window)
        for reader in self.readers:
            reader.add(window)

    def watch(self) -> ChangedWindow:
        """Return a new reader's window, which grows with every touch from now on."""
        self.readers.append(ChangedWindow())
        return self.readers[-1]

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Return (column, row) of a point, or ``None`` off the grid (costmap_2d ``worldToMap``)."""
        if x < self.x or y < self.y:
            return None
        column, row = int((x - self.x) / self.resolution), int((y - self.y) / self.resolution)
        rows, columns = self.cells.shape
        return (column, row) if column < columns and row < rows else None


def _window_union(old: Window, window: Window) -> Window:
    if old[0] >= old[2]:
        return window
    return (
        min(old[0], window[0]),
        min(old[1], window[1]),
        max(old[2], window[2]),
        max(old[3], window[3]),
    )
