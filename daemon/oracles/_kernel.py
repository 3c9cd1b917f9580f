"""Exact box clearance over convex polygons, compiled.

In the body frame ``g(p) = max(|x| - hx, |y| - hy)`` is convex and piecewise linear. Over a filled
convex polygon its minimum is -min(hx, hy) when the polygon holds the box centre, and lies on an
edge otherwise; along an edge it lies at an end or where two of the four planes of ``g`` cross.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from grammars.values import Floats


@njit(cache=True)
def cos_sin(angles: Floats) -> tuple[Floats, Floats]:
    """Return cosine and sine of ``angles`` (n,) [rad] from the C library.

    numpy's own differ in the last bit between machines with different vector units, and verdicts
    must not.
    """
    cosines, sines = np.empty(len(angles)), np.empty(len(angles))
    for i in range(len(angles)):
        cosines[i], sines[i] = math.cos(angles[i]), math.sin(angles[i])
    return cosines, sines


@njit(cache=True)
def _edge_minimum(ax: float, ay: float, bx: float, by: float, hx: float, hy: float) -> float:
    """Return the minimum of ``g`` over the segment a-b."""
    dx, dy = bx - ax, by - ay
    best = min(max(abs(ax) - hx, abs(ay) - hy), max(abs(bx) - hx, abs(by) - hy))
    gap = hx - hy
    # Crossings: x = 0, y = 0, x - hx = +-y - hy, -x - hx = +-y - hy, as (value at a, slope).
    for k in range(6):
        if k == 0:
            value, slope = ax, dx
        elif k == 1:
            value, slope = ay, dy
        elif k == 2:
            value, slope = ax - ay - gap, dx - dy
        elif k == 3:
            value, slope = ax + ay - gap, dx + dy
        elif k == 4:
            value, slope = ax + ay + gap, dx + dy
        else:
            value, slope = ax - ay + gap, dx - dy
        if slope != 0.0:
            t = -value / slope
            if 0.0 < t < 1.0:
                best = min(best, max(abs(ax + t * dx) - hx, abs(ay + t * dy) - hy))
    return best


@njit(cache=True)
def _polygon_minimum(
    corners: Floats, first: int, last: int, c: float, s: float, tx: float, ty: float,
    hx: float, hy: float,
) -> float:  # fmt: skip
    """Return the minimum of ``g`` over a filled convex polygon moved by (c, s, tx, ty)."""
    best = math.inf
    left = right = True
    px = tx + c * corners[last - 1, 0] - s * corners[last - 1, 1]
    py = ty + s * corners[last - 1, 0] + c * corners[last - 1, 1]
    for k in range(first, last):
        qx = tx + c * corners[k, 0] - s * corners[k, 1]
        qy = ty + s * corners[k, 0] + c * corners[k, 1]
        side = px * qy - py * qx
        left = left and side >= 0.0
        right = right and side <= 0.0
        best = min(best, _edge_minimum(px, py, qx, qy, hx, hy))
        px, py = qx, qy
    if left != right:
        return -min(hx, hy)
    return best


@njit(cache=True)
def box_clearance(
    poses: Floats, centre: Floats, half: Floats, corners: Floats, offsets: npt.NDArray[np.int64],
    frame: npt.NDArray[np.int64], circle: Floats, tracks: Floats,
) -> tuple[Floats, npt.NDArray[np.int32]]:  # fmt: skip
    """Return clearance (n,) [m] and the index of the nearest polygon (n,) for each pose (n, 3).

    ``centre`` and ``half`` extents of the box in the base frame; the polygons are those of
    :class:`daemon.oracles._clearance.Obstacles`, at least one. Of equally near polygons the first
    one counts.

    A polygon whose circle is at distance d from the box centre has ``g >= d / sqrt(2) - max(hx,
    hy)``, so most are skipped; starting from the previous sample's nearest one keeps it tight.
    """
    samples, polygons = len(poses), len(frame)
    values = np.empty(samples)
    nearest = np.empty(samples, dtype=np.int32)
    hx, hy = half[0], half[1]
    reach = max(hx, hy)
    guess = 0
    for i in range(samples):
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        bx = poses[i, 0] + c * centre[0] - s * centre[1]
        by = poses[i, 1] + s * centre[0] + c * centre[1]
        best, owner = math.inf, -1
        for step in range(-1, polygons):
            p = guess if step < 0 else step
            f = frame[p]
            wx, wy = circle[p, 0], circle[p, 1]
            lc, ls, lx, ly = 1.0, 0.0, 0.0, 0.0
            if f >= 0:
                lx, ly = tracks[i, f, 0], tracks[i, f, 1]
                lc, ls = math.cos(tracks[i, f, 2]), math.sin(tracks[i, f, 2])
                wx, wy = lx + lc * wx - ls * wy, ly + ls * wx + lc * wy
            # Farther than this no point of the circle can be as near as the best so far.
            limit = (best + reach) * 1.4142135623730951 + circle[p, 2] + 1e-9
            if (wx - bx) ** 2 + (wy - by) ** 2 > limit * limit:
                continue
            found = _polygon_minimum(
                corners, offsets[p], offsets[p + 1],
                c * lc + s * ls, c * ls - s * lc,
                c * (lx - bx) + s * (ly - by), c * (ly - by) - s * (lx - bx),
                hx, hy,
            )  # fmt: skip
            if found < best or (found == best and p < owner):
                best, owner = found, p
        values[i], nearest[i] = best, owner
        guess = owner
    return values, nearest
