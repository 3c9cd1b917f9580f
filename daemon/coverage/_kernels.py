"""Compiled loops that paint cells: rays of scans, footprints along a way."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from grammars.values import Floats

Cells = npt.NDArray[np.bool_]
Ranges = npt.NDArray[np.float32]


@njit(cache=True)
def paint_rays(
    cells: Cells, x0: float, y0: float, resolution: float, poses: Floats, ranges: Ranges,
    angle_min: float, step: float, range_max: float,
) -> None:  # fmt: skip
    """Mark the cells that rays pass: those at every half a cell from the laser to the return.

    ``poses`` (n, 3) of the laser, ``ranges`` (n, rays). No return (inf) is a look as far as
    ``range_max``; a lost ray (nan) and one that met something too near (-inf) see nothing.
    """
    rows, columns = cells.shape
    for i in range(len(poses)):
        x, y, yaw = poses[i, 0] - x0, poses[i, 1] - y0, poses[i, 2]
        for k in range(ranges.shape[1]):
            reach = min(float(ranges[i, k]), range_max)
            if not reach > 0.0:
                continue
            angle = yaw + angle_min + k * step
            dx, dy = math.cos(angle), math.sin(angle)
            for j in range(int(reach / (0.5 * resolution)) + 1):
                along = 0.5 * j * resolution
                column = math.floor((x + along * dx) / resolution)
                row = math.floor((y + along * dy) / resolution)
                if 0 <= row < rows and 0 <= column < columns:
                    cells[row, column] = True


@njit(cache=True)
def paint_footprints(
    cells: Cells, x0: float, y0: float, resolution: float, poses: Floats, ring: Floats,
    reach: float,
) -> None:  # fmt: skip
    """Mark the cells whose centre a convex ``ring`` (m, 2), counter-clockwise, covers at a pose.

    ``reach`` is the distance of its farthest corner from the base.
    """
    rows, columns = cells.shape
    corners = len(ring)
    for i in range(len(poses)):
        x, y = poses[i, 0] - x0, poses[i, 1] - y0
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        bottom = max(0, math.floor((y - reach) / resolution))
        top = min(rows - 1, math.floor((y + reach) / resolution))
        left = max(0, math.floor((x - reach) / resolution))
        right = min(columns - 1, math.floor((x + reach) / resolution))
        for row in range(bottom, top + 1):
            for column in range(left, right + 1):
                if cells[row, column]:
                    continue
                u, v = (column + 0.5) * resolution - x, (row + 0.5) * resolution - y
                px, py = c * u + s * v, c * v - s * u
                covered = True
                for k in range(corners):
                    ax, ay = ring[k, 0], ring[k, 1]
                    bx, by = ring[(k + 1) % corners, 0], ring[(k + 1) % corners, 1]
                    if (bx - ax) * (py - ay) - (by - ay) * (px - ax) < 0.0:
                        covered = False
                        break
                if covered:
                    cells[row, column] = True
