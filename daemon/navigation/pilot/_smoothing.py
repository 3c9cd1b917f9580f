"""Any-angle shortening of grid paths, and their even resampling."""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.kernels import Integers, Singles, kernel
from daemon.navigation.pilot._astar import cost_factor
from grammars.values import Floats


@kernel
def _line_cost(
    clearance: Singles,
    row0: int,
    column0: int,
    row1: int,
    column1: int,
    lethal: float,
    preferred: float,
    weight: float,
) -> float:
    """Return the cost of the straight line between two cell centres [cells], inf if closed."""
    dr, dc = float(row1 - row0), float(column1 - column0)
    length = math.hypot(dr, dc)
    steps = max(1, math.ceil(2.0 * length))
    total = 0.0
    for i in range(steps + 1):
        t = i / steps
        value = clearance[round(row0 + t * dr), round(column0 + t * dc)]
        if value < lethal:
            return np.inf
        share = 0.5 if i == 0 or i == steps else 1.0
        total += share * cost_factor(value, lethal, preferred, weight)
    return total * length / steps


@kernel
def shorten(
    clearance: Singles,
    path: Integers,
    lethal: float,
    preferred: float,
    weight: float,
    reach: int,
) -> Integers:
    """Return the corners of ``path`` (flat cell indices) after taking every worthwhile shortcut.

    A straight line replaces a stretch of at most ``reach`` cells when it costs no more, so that a
    shortcut never trades the middle of a doorway for its jamb.
    """
    columns = clearance.shape[1]
    count = path.shape[0]
    corners = np.empty(count, dtype=np.int32)
    corners[0] = path[0]
    kept = 1
    i = 0
    while i < count - 1:
        row, column = path[i] // columns, path[i] % columns
        spent = 0.0
        best = i + 1
        for j in range(i + 1, min(count, i + reach + 1)):
            before, here = path[j - 1], path[j]
            r, c = here // columns, here % columns
            length = math.hypot(float(r - before // columns), float(c - before % columns))
            spent += 0.5 * length * (
                cost_factor(clearance[before // columns, before % columns], lethal, preferred,
                            weight)
                + cost_factor(clearance[r, c], lethal, preferred, weight)
            )  # fmt: skip
            if j - i > 1:
                line = _line_cost(clearance, row, column, r, c, lethal, preferred, weight)
                if line <= 1.002 * spent:
                    best = j
        corners[kept] = path[best]
        kept += 1
        i = best
    return corners[:kept].copy()


@kernel
def resample(corners: Floats, spacing: float) -> Floats:
    """Return points (n, 2) along the polyline ``corners`` (m, 2), at most ``spacing`` [m] apart.

    Corners are kept.
    """
    total = 1
    for i in range(corners.shape[0] - 1):
        length = math.hypot(corners[i + 1, 0] - corners[i, 0], corners[i + 1, 1] - corners[i, 1])
        total += max(1, math.ceil(length / spacing - 1e-9))
    points = np.empty((total, 2))
    points[0] = corners[0]
    k = 1
    for i in range(corners.shape[0] - 1):
        dx, dy = corners[i + 1, 0] - corners[i, 0], corners[i + 1, 1] - corners[i, 1]
        steps = max(1, math.ceil(math.hypot(dx, dy) / spacing - 1e-9))
        for j in range(1, steps + 1):
            points[k, 0] = corners[i, 0] + dx * j / steps
            points[k, 1] = corners[i, 1] + dy * j / steps
            k += 1
    return points


@kernel
def lengths_along(points: Floats) -> Floats:
    """Return the distance travelled at each point of a polyline (n, 2) [m]."""
    travelled = np.empty(points.shape[0])
    travelled[0] = 0.0
    for i in range(1, points.shape[0]):
        step = math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
        travelled[i] = travelled[i - 1] + step
    return travelled
