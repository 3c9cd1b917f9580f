"""The beam model: what a ray should have measured on the map (amcl ``AMCLLaser::BeamModel``)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from daemon.navigation.kernels import Integers, Singles, kernel
from grammars.values import Floats


@kernel
def map_range(
    blocked: npt.NDArray[np.uint8],
    x0: float,
    y0: float,
    resolution: float,
    shift: float,
    x: float,
    y: float,
    angle: float,
    reach: float,
) -> float:
    """Return the range [m] to the first cell on the ray that is not free, ``reach`` for none.

    Bresenham from cell to cell, unknown and off the map as good as occupied, the range measured
    between cell centres (amcl ``map_calc_range``). (``x0``, ``y0``) is the map's lower-left
    corner; ``shift`` [cells] is added to coordinates before they are cut to cells.
    """
    rows, columns = blocked.shape
    a = math.floor((x - x0) / resolution + shift)
    b = math.floor((y - y0) / resolution + shift)
    a_end = math.floor((x + reach * math.cos(angle) - x0) / resolution + shift)
    b_end = math.floor((y + reach * math.sin(angle) - y0) / resolution + shift)
    steep = abs(b_end - b) > abs(a_end - a)
    if steep:
        a, b, a_end, b_end = b, a, b_end, a_end
    along, across = abs(a_end - a), abs(b_end - b)
    a_step = 1 if a < a_end else -1
    b_step = 1 if b < b_end else -1
    error = 0
    u, v = a, b
    # The ray is followed one cell beyond its end, as in the original.
    for step in range(along + 2):
        if step > 0:
            u += a_step
            error += across
            if 2 * error >= along:
                v += b_step
                error -= along
        row, column = (u, v) if steep else (v, u)
        inside = 0 <= row < rows and 0 <= column < columns
        if not inside or blocked[row, column] != 0:
            return math.hypot(float(u - a), float(v - b)) * resolution
    return reach


@kernel
def weigh_beams(
    ranges: Singles,
    indices: Integers,
    bearings: Floats,
    mount: Floats,
    range_min: float,
    range_max: float,
    blocked: npt.NDArray[np.uint8],
    x0: float,
    y0: float,
    resolution: float,
    shift: float,
    z_hit: float,
    z_short: float,
    z_max: float,
    z_rand: float,
    sigma_hit: float,
    lambda_short: float,
    poses: Floats,
    count: int,
    sums: Floats,
) -> None:
    """Write ``1 + sum pz^3`` of each particle, pz the mixture of four ways to measure a range.

    A return at ``range_min`` or below stands for one at ``range_max``; beyond ``range_max`` none
    of the four explains it, so it counts nothing.
    """
    for i in range(count):
        c, s = math.cos(poses[2, i]), math.sin(poses[2, i])
        x = poses[0, i] + c * mount[0] - s * mount[1]
        y = poses[1, i] + s * mount[0] + c * mount[1]
        yaw = poses[2, i] + mount[2]
        total = 1.0
        for k in range(indices.shape[0]):
            r = float(ranges[indices[k]])
            if r <= range_min:
                r = range_max
            if not r <= range_max:
                continue
            expected = map_range(
                blocked, x0, y0, resolution, shift, x, y, yaw + bearings[k], range_max
            )
            z = r - expected
            pz = z_hit * math.exp(-(z * z) / (2.0 * sigma_hit * sigma_hit))
            if z < 0.0:
                pz += z_short * lambda_short * math.exp(-lambda_short * r)
            if r == range_max:
                pz += z_max
            if r < range_max:
                pz += z_rand / range_max
            total += pz * pz * pz
        sums[i] = total
