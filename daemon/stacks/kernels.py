"""Small kernels every stack uses, and the arrays kernels take."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel

Singles: TypeAlias = npt.NDArray[np.float32]
Integers: TypeAlias = npt.NDArray[np.int32]


@kernel
def wrap_angle_modulo(angle: float) -> float:
    """Map an angle [rad] to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def interpolate_at(
    field: Singles, x0: float, y0: float, resolution: float, x: float, y: float
) -> float:
    """Return the value of a field at (x, y), interpolated between cell centres; -1 outside."""
    u, v = (x - x0) / resolution - 0.5, (y - y0) / resolution - 0.5
    row, column = math.floor(v), math.floor(u)
    if row < 0 or column < 0 or row + 1 >= field.shape[0] or column + 1 >= field.shape[1]:
        return -1.0
    a, b = u - column, v - row
    lower = (1.0 - a) * field[row, column] + a * field[row, column + 1]
    upper = (1.0 - a) * field[row + 1, column] + a * field[row + 1, column + 1]
    return float((1.0 - b) * lower + b * upper)
