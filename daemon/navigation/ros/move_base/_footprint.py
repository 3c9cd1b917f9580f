"""Whether a footprint can turn on the spot in a costmap (``CostmapModel::footprintCost``)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.grids import LETHAL
from grammars.values import Floats


@kernel
def _line_is_free(cells: npt.NDArray[np.uint8], x0: int, y0: int, x1: int, y1: int) -> bool:
    """Walk a line of cells, both ends included; lethal and unknown cells (254, 255) block it."""
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    step_x, step_y = (1 if x1 >= x0 else -1), (1 if y1 >= y0 else -1)
    steep = dy > dx
    long, short = (dy, dx) if steep else (dx, dy)
    error = long // 2
    x, y = x0, y0
    for _ in range(long + 1):
        if cells[y, x] >= LETHAL:
            return False
        error += short
        if error >= long:
            error -= long
            if steep:
                x += step_x
            else:
                y += step_y
        if steep:
            y += step_y
        else:
            x += step_x
    return True


@kernel
def outline_is_free(
    cells: npt.NDArray[np.uint8],
    left: float,
    bottom: float,
    resolution: float,
    footprint: Floats,
    x: float,
    y: float,
    yaw: float,
) -> bool:
    """Tell whether the outline of ``footprint`` (k, 2) at a pose hits nothing and stays inside.

    Only the outline counts, not what is inside it; cells of 253 may be crossed.
    """
    rows, columns = cells.shape
    c, s = math.cos(yaw), math.sin(yaw)
    first_x = first_y = before_x = before_y = 0
    for k in range(footprint.shape[0]):
        px = x + footprint[k, 0] * c - footprint[k, 1] * s - left
        py = y + footprint[k, 0] * s + footprint[k, 1] * c - bottom
        cell_x, cell_y = int(px / resolution), int(py / resolution)
        if px < 0.0 or py < 0.0 or cell_x >= columns or cell_y >= rows:
            return False
        if k == 0:
            first_x, first_y = cell_x, cell_y
        elif not _line_is_free(cells, before_x, before_y, cell_x, cell_y):
            return False
        before_x, before_y = cell_x, cell_y
    return _line_is_free(cells, before_x, before_y, first_x, first_y)


@kernel
def turn_is_free(
    cells: npt.NDArray[np.uint8],
    left: float,
    bottom: float,
    resolution: float,
    footprint: Floats,
    x: float,
    y: float,
    yaw: float,
    angle: float,
    granularity: float,
) -> bool:
    """Tell whether the outline stays free while it turns left by ``angle`` [rad].

    It is looked at every ``granularity`` [rad], at the end itself only by chance.
    """
    turned = 0.0
    while turned < angle:
        if not outline_is_free(cells, left, bottom, resolution, footprint, x, y, yaw + turned):
            return False
        turned += granularity
    return True
