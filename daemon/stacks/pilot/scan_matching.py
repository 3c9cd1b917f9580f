"""Scans matched to the map: Gauss-Newton on the signed distance to the painted walls.

Residuals are the signed distances of the scan's end points to the surface, as in direct scan
matching on a map gradient (Kohlbrecher et al. 2011, Hector SLAM), but signed, so that a wall
pulls from both sides and its painted thickness does no harm. The odometry prior enters through
its information matrix, which makes the solution the update of an iterated Kalman filter.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles, wrap_angle_modulo
from grammars.model.geometry import Floats

_STENCIL = 1.5
"""Half the width over which the direction of a wall is taken from the field [cells]."""
_LEAST_SLOPE, _MOST_SLOPE = 0.3, 1.5
"""A distance field has slope 1; ridges between walls and edges of the known map have not."""
_FALSE_INFORMATION = 0.02
"""Part of the information across a corridor that its raster feigns along it."""


@kernel
def project(
    ranges: Singles,
    cosines: Floats,
    sines: Floats,
    mount: Floats,
    range_min: float,
    range_max: float,
    points: Floats,
) -> int:
    """Write the returns of a scan as points of the base frame into ``points`` (rays, 2).

    Returns how many there are; rays that are lost or saw nothing are left out (REP 117).
    """
    c, s = math.cos(mount[2]), math.sin(mount[2])
    count = 0
    for i in range(ranges.shape[0]):
        r = float(ranges[i])
        if not (range_min <= r <= range_max):
            continue
        px, py = r * cosines[i], r * sines[i]
        points[count, 0] = mount[0] + c * px - s * py
        points[count, 1] = mount[1] + s * px + c * py
        count += 1
    return count


@kernel
def invert_symmetric(a: Floats, result: Floats) -> None:
    """Write the inverse of a symmetric positive definite (3, 3) matrix into ``result``."""
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[1, 2]
    c01 = a[0, 2] * a[1, 2] - a[0, 1] * a[2, 2]
    c02 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    result[0, 0] = c00 / det
    result[0, 1] = result[1, 0] = c01 / det
    result[0, 2] = result[2, 0] = c02 / det
    result[1, 1] = (a[0, 0] * a[2, 2] - a[0, 2] * a[0, 2]) / det
    result[1, 2] = result[2, 1] = (a[0, 1] * a[0, 2] - a[0, 0] * a[1, 2]) / det
    result[2, 2] = (a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]) / det


@kernel
def _interpolate(field: Singles, u: float, v: float) -> float:
    """Return the field at column ``u``, row ``v``, interpolated between cell centres."""
    column, row = math.floor(u), math.floor(v)
    a, b = u - column, v - row
    lower = (1.0 - a) * field[row, column] + a * field[row, column + 1]
    upper = (1.0 - a) * field[row + 1, column] + a * field[row + 1, column + 1]
    return float((1.0 - b) * lower + b * upper)


@kernel
def _normal_equations(
    surface: Singles,
    x0: float,
    y0: float,
    resolution: float,
    points: Floats,
    count: int,
    mount: Floats,
    pose: Floats,
    inset: float,
    width: float,
    precision: float,
    hessian: Floats,
    slope: Floats,
) -> tuple[int, float]:
    """Accumulate the weighted normal equations at ``pose``.

    Weights are Geman-McClure's with scale ``width`` [m]; points farther than three widths from
    any wall (doors, people) count nothing. ``mount`` is where the laser sits on the base. Returns
    the number of inliers and their weighted mean residual [m].
    """
    # One loop over the rays; taken apart, each part would look the same cells up again.
    rows, columns = surface.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    inliers = 0
    total = weights = 0.0
    hessian[:, :] = 0.0
    slope[:] = 0.0
    for i in range(count):
        rx = c * points[i, 0] - s * points[i, 1]
        ry = s * points[i, 0] + c * points[i, 1]
        u = (pose[0] + rx - x0) / resolution - 0.5
        v = (pose[1] + ry - y0) / resolution - 0.5
        column, row = math.floor(u), math.floor(v)
        if column < 2 or row < 2 or column + 3 >= columns or row + 3 >= rows:
            continue
        residual = _interpolate(surface, u, v) + inset
        if abs(residual) > 3.0 * width:
            continue
        # Right at a slanted wall the field follows the steps of its raster; its direction shows
        # from a little further away.
        gx = _interpolate(surface, u + _STENCIL, v) - _interpolate(surface, u - _STENCIL, v)
        gy = _interpolate(surface, u, v + _STENCIL) - _interpolate(surface, u, v - _STENCIL)
        slope_here = math.hypot(gx, gy) / (2.0 * _STENCIL * resolution)
        if not _LEAST_SLOPE < slope_here < _MOST_SLOPE:
            continue
        gx /= 2.0 * _STENCIL * resolution * slope_here
        gy /= 2.0 * _STENCIL * resolution * slope_here
        # A laser sees faces that look towards it, never the back of a wall.
        if gx * (rx - c * mount[0] + s * mount[1]) + gy * (ry - s * mount[0] - c * mount[1]) > 0.0:
            continue
        gt = gy * rx - gx * ry
        ratio = residual / width
        weight = precision / (1.0 + ratio * ratio) ** 2
        hessian[0, 0] += weight * gx * gx
        hessian[0, 1] += weight * gx * gy
        hessian[0, 2] += weight * gx * gt
        hessian[1, 1] += weight * gy * gy
        hessian[1, 2] += weight * gy * gt
        hessian[2, 2] += weight * gt * gt
        slope[0] += weight * gx * residual
        slope[1] += weight * gy * residual
        slope[2] += weight * gt * residual
        total += weight * residual
        weights += weight
        inliers += 1
    hessian[1, 0], hessian[2, 0], hessian[2, 1] = hessian[0, 1], hessian[0, 2], hessian[1, 2]
    return inliers, total / weights if inliers > 0 else 0.0


@kernel
def _distrust_weak_direction(hessian: Floats, slope: Floats) -> None:
    """Take what the raster of the map feigns off the direction that is seen worst, in place.

    The gradients of a painted wall are off by some degrees, so a corridor seems to tell a little
    about the position along it. ``_FALSE_INFORMATION`` of the information across is taken off
    there, consistently from both sides of the equations.
    """
    a, b, c = hessian[0, 0], hessian[0, 1], hessian[1, 1]
    middle, spread = 0.5 * (a + c), math.hypot(0.5 * (a - c), b)
    weak, strong = middle - spread, middle + spread
    if weak <= 0.0 or spread <= 0.0:
        return
    angle = 0.5 * math.atan2(2.0 * b, a - c) + 0.5 * math.pi
    wx, wy = math.cos(angle), math.sin(angle)
    cut = 1.0 - math.sqrt(max(0.0, weak - _FALSE_INFORMATION * strong) / weak)
    part = cut * (wx * slope[0] + wy * slope[1])
    slope[0] -= part * wx
    slope[1] -= part * wy
    for k in range(3):
        part = cut * (wx * hessian[0, k] + wy * hessian[1, k])
        hessian[0, k] -= part * wx
        hessian[1, k] -= part * wy
    for k in range(3):
        part = cut * (wx * hessian[k, 0] + wy * hessian[k, 1])
        hessian[k, 0] -= part * wx
        hessian[k, 1] -= part * wy


@kernel
def match_scan(
    surface: Singles,
    x0: float,
    y0: float,
    resolution: float,
    points: Floats,
    count: int,
    mount: Floats,
    mean: Floats,
    covariance: Floats,
    inset: float,
    first_width: float,
    last_width: float,
    sigma: float,
    iterations: int,
    least_inliers: int,
) -> tuple[int, float]:
    """Fuse a scan into ``mean`` (3,) and ``covariance`` (3, 3), both changed in place.

    ``points[:count]`` are returns in the base frame of a laser at ``mount`` (x, y, yaw), and
    ``sigma`` [m] is the standard deviation one of them counts with. The kernel width shrinks from
    ``first_width`` to ``last_width`` [m] (graduated non-convexity). Walls stand ``inset`` [m]
    behind their painted edge. Returns the number of inliers and their mean residual [m]; with
    fewer than ``least_inliers`` nothing changes.
    """
    hessian, slope = np.empty((3, 3)), np.empty(3)
    prior, step = np.empty((3, 3)), np.empty(3)
    inverse = np.empty((3, 3))
    pose = mean.copy()
    invert_symmetric(covariance, prior)
    width = first_width
    inliers, residual = 0, 0.0
    for _ in range(iterations):
        inliers, residual = _normal_equations(
            surface, x0, y0, resolution, points, count, mount, pose, inset, width,
            1.0 / (sigma * sigma), hessian, slope,
        )  # fmt: skip
        if inliers < least_inliers:
            return inliers, 0.0
        _distrust_weak_direction(hessian, slope)
        away = wrap_angle_modulo(pose[2] - mean[2])
        for k in range(3):
            slope[k] += prior[k, 0] * (pose[0] - mean[0])
            slope[k] += prior[k, 1] * (pose[1] - mean[1]) + prior[k, 2] * away
            for j in range(3):
                hessian[k, j] += prior[k, j]
        invert_symmetric(hessian, inverse)
        for k in range(3):
            step[k] = -(
                inverse[k, 0] * slope[0] + inverse[k, 1] * slope[1] + inverse[k, 2] * slope[2]
            )
            pose[k] += step[k]
        settled = abs(step[0]) + abs(step[1]) < 2e-4 and abs(step[2]) < 1e-4
        if settled and width <= last_width:
            break
        width = max(last_width, 0.6 * width)
    mean[0], mean[1], mean[2] = pose[0], pose[1], wrap_angle_modulo(pose[2])
    # Element by element: for arrays of two shapes numba compiles the words of an error, in 3 s.
    for k in range(3):
        for j in range(3):
            covariance[k, j] = inverse[k, j]
    return inliers, residual
