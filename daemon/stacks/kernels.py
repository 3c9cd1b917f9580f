"""Exact distance transform, shared by several stacks."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel

Singles: TypeAlias = npt.NDArray[np.float32]
Integers: TypeAlias = npt.NDArray[np.int32]

FAR = 1.0e6
"""Distance on a grid without any solid cell [cells]."""


@kernel
def distance_transform(solid: npt.NDArray[np.uint8]) -> Singles:
    """Return the distance from each cell centre to the nearest solid cell centre [cells].

    ``solid`` is (rows, columns), non-zero where solid. Solid cells have distance 0. Without any
    solid cell all distances are ``FAR``. Each row takes the lower envelope of the parabolas that
    its column distances span.
    """
    rows, columns = solid.shape
    result = np.empty((rows, columns), dtype=np.float32)
    gap = np.empty((rows, columns), dtype=np.float32)
    for r in range(rows):
        for c in range(columns):
            above = gap[r - 1, c] + 1.0 if r > 0 else FAR
            gap[r, c] = 0.0 if solid[r, c] else min(above, FAR)
    for r in range(rows - 2, -1, -1):
        for c in range(columns):
            gap[r, c] = min(gap[r, c], gap[r + 1, c] + 1.0)
    apex = np.empty(columns, dtype=np.int64)
    begin = np.empty(columns + 1, dtype=np.float64)
    for r in range(rows):
        count = 0
        for c in range(columns):
            if gap[r, c] >= FAR:
                continue
            height = float(gap[r, c]) ** 2 + float(c) ** 2
            start = -np.inf
            # A parabola that the new one hides before its own part begins is not on the envelope.
            while count > 0:
                other = apex[count - 1]
                other_height = float(gap[r, other]) ** 2 + float(other) ** 2
                start = (height - other_height) / (2.0 * (c - other))
                if start > begin[count - 1]:
                    break
                count -= 1
                start = -np.inf
            apex[count] = c
            begin[count] = start
            count += 1
        if count == 0:
            result[r, :] = FAR
            continue
        begin[count] = np.inf
        k = 0
        for c in range(columns):
            while begin[k + 1] < c:
                k += 1
            across = float(c - apex[k])
            result[r, c] = math.sqrt(float(gap[r, apex[k]]) ** 2 + across * across)
    return result
