"""What navfn makes of a costmap: costs of crossing a cell, blocked cells and a blocked border."""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.grids import INSCRIBED, NO_INFORMATION

NEUTRAL: Final = 50
BLOCKED: Final = 254
PENDING: Final = 256
"""Flag of a cell that waits in a buffer; added to its cost, so that one look tells both."""
UNREACHED: Final = np.float32(1.0e10)

Bytes: TypeAlias = npt.NDArray[np.uint8]
States: TypeAlias = npt.NDArray[np.uint16]


def translation(*, allow_unknown: bool) -> States:
    """Return the cost of every costmap value, (256,) (navfn ``setCostmap``)."""
    values = np.arange(256)
    costs: States = np.minimum(NEUTRAL + 0.8 * values, BLOCKED - 1).astype(np.uint16)
    costs[INSCRIBED:] = BLOCKED
    if allow_unknown:
        costs[NO_INFORMATION] = BLOCKED - 1
    return costs


@kernel
def translate(
    cells: Bytes, costs: States, table: States, x0: int, y0: int, x1: int, y1: int
) -> bool:
    """Renew the costs of a half-open window, never of the border; return whether any changed."""
    rows, columns = cells.shape
    changed = False
    for row in range(max(y0, 1), min(y1, rows - 1)):
        for column in range(max(x0, 1), min(x1, columns - 1)):
            cost = table[cells[row, column]]
            n = row * columns + column
            if cost != costs[n]:
                costs[n] = cost
                changed = True
    return changed
