"""Thinning of global plans for the trace."""

from __future__ import annotations

import math

from daemon.navigation.kernels import kernel
from grammars.values import Floats


@kernel
def sketch(plan: Floats, spacing: float, out: Floats) -> int:
    """Write points of ``plan`` (n, 3) to ``out`` (n, 2), from the goal to the start.

    Returns how many: one every ``spacing`` [m] of way from the goal, between two poses if need be,
    and the start. Two plans over the same ground so have the same points, wherever they begin.
    """
    last = plan.shape[0] - 1
    out[0, 0], out[0, 1] = plan[last, 0], plan[last, 1]
    count, way = 1, 0.0
    for k in range(last - 1, -1, -1):
        dx, dy = plan[k, 0] - plan[k + 1, 0], plan[k, 1] - plan[k + 1, 1]
        length = math.hypot(dx, dy)
        while way + length >= count * spacing and count < out.shape[0] - 1:
            share = (count * spacing - way) / length
            out[count, 0] = plan[k + 1, 0] + share * dx
            out[count, 1] = plan[k + 1, 1] + share * dy
            count += 1
        way += length
    if last > 0:
        out[count, 0], out[count, 1] = plan[0, 0], plan[0, 1]
        count += 1
    return count


@kernel
def farthest(first: Floats, second: Floats) -> float:
    """Return the largest distance along x or y between points of the same index, (n, 2) each."""
    most = 0.0
    for k in range(min(first.shape[0], second.shape[0])):
        dx, dy = abs(first[k, 0] - second[k, 0]), abs(first[k, 1] - second[k, 1])
        most = max(most, dx, dy)
    return most
