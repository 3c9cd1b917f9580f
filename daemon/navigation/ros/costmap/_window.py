"""The size of a grid that no map gives, and how it moves with the robot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from daemon.navigation.ros.costmap._parameters import CostmapParameters


def shape_of(parameters: CostmapParameters) -> tuple[int, int]:
    """Return (rows, columns); raises ``ValueError`` for a grid without cells."""
    shape = (
        int(parameters.height / parameters.resolution),
        int(parameters.width / parameters.resolution),
    )
    if min(shape) < 1:
        raise ValueError(
            f"a costmap of {parameters.width:g} m x {parameters.height:g} m has no cell of "
            f"{parameters.resolution:g} m"
        )
    return shape


def slide(cells: npt.NDArray[np.uint8], right: int, up: int, default: int) -> None:
    """Move the content of ``cells`` so that its window goes ``right`` and ``up`` [cells]."""
    rows, columns = cells.shape
    old = cells.copy()
    cells[:] = default
    if abs(up) >= rows or abs(right) >= columns:
        return
    target = (
        slice(max(0, -up), rows - max(0, up)),
        slice(max(0, -right), columns - max(0, right)),
    )
    source = (
        slice(max(0, up), rows - max(0, -up)),
        slice(max(0, right), columns - max(0, -right)),
    )
    cells[target] = old[source]
