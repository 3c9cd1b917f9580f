"""The guard: how long a command can be kept before the footprint meets something.

The footprint is swept along the arc of the command. What it must not meet are the scan's returns,
remembered obstacles beside and behind the robot (the laser does not look there) and the walls
of the map. A point already closer than the margin only stops motion that brings it closer still,
so that a robot can always back out of a tight spot.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.kernels import Singles, kernel, value_at
from grammars.values import Floats, Ring


def half_planes(footprint: Ring) -> Floats:
    """Return the edges of a convex ring as (m, 3): outward unit normal and offset [m].

    A point is outside by ``max(normal . p - offset)`` metres (exact beside edges, less at
    corners). Works for either orientation of the ring.
    """
    corners = np.asarray(footprint, dtype=np.float64)
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    corners, edges, lengths = corners[lengths > 0], edges[lengths > 0], lengths[lengths > 0]
    normals = np.column_stack((edges[:, 1], -edges[:, 0])) / lengths[:, None]
    offsets = np.einsum("ij,ij->i", normals, corners)
    centre = corners.mean(axis=0)
    flip = np.where(normals @ centre > offsets, -1.0, 1.0)
    return np.column_stack((normals * flip[:, None], offsets * flip))


def outline(footprint: Ring, spacing: float = 0.1) -> Floats:
    """Return points (n, 2) on the ring, corners included, at most ``spacing`` [m] apart."""
    points: list[tuple[float, float]] = []
    for (ax, ay), (bx, by) in zip(footprint, footprint[1:] + footprint[:1], strict=True):
        steps = max(1, math.ceil(math.hypot(bx - ax, by - ay) / spacing))
        points += [(ax + (bx - ax) * k / steps, ay + (by - ay) * k / steps) for k in range(steps)]
    return np.array(points)


@kernel
def _outside(planes: Floats, x: float, y: float) -> float:
    """Return by how much a point of the base frame lies outside the footprint [m]."""
    most = -1e9
    for k in range(planes.shape[0]):
        most = max(most, planes[k, 0] * x + planes[k, 1] * y - planes[k, 2])
    return most


@kernel
def free_time(
    planes: Floats,
    rim: Floats,
    points: Floats,
    known: np.ndarray,
    count: int,
    surface: Singles,
    x0: float,
    y0: float,
    resolution: float,
    pose: Floats,
    vx: float,
    vy: float,
    wz: float,
    horizon: float,
    step: float,
    margin: float,
) -> tuple[float, float, float]:
    """Return how long the body-frame command (vx, vy, wz) keeps clear, and the room beside it.

    The three results are the time until something the map shows comes within ``margin`` [m] of
    the footprint, the same for everything else (``known[i]`` is 0), both at most ``horizon`` [s],
    and the least room [m] to points that are passed without being met. ``rim`` (n, 2) are
    points on the footprint that are looked up in ``surface``. The sweep advances ``step`` [s].
    """
    steps = max(1, math.ceil(horizon / step))
    walls = others = horizon
    room = 1e9
    reach = math.hypot(vx, vy) * horizon + 0.5
    farthest = 0.0
    for k in range(rim.shape[0]):
        farthest = max(farthest, math.hypot(rim[k, 0], rim[k, 1]))
    reach += farthest
    sweep = np.empty((steps, 4))
    for k in range(steps):
        x, y, yaw = _advance(vx, vy, wz, (k + 1) * step)
        sweep[k, 0], sweep[k, 1] = x, y
        sweep[k, 2], sweep[k, 3] = math.cos(yaw), math.sin(yaw)
    for i in range(count):
        px, py = points[i, 0], points[i, 1]
        if px * px + py * py > reach * reach:
            continue
        before = _outside(planes, px, py)
        limit = min(margin, before - 0.002)
        end = walls if known[i] else others
        nearest, away, met, closing = before, before, False, False
        for k in range(steps):
            if (k + 1) * step > end:
                break
            dx, dy = px - sweep[k, 0], py - sweep[k, 1]
            c, s = sweep[k, 2], sweep[k, 3]
            previous, away = away, _outside(planes, c * dx + s * dy, c * dy - s * dx)
            closing = away < previous - 1e-6
            if away < limit:
                if known[i]:
                    walls = k * step
                else:
                    others = k * step
                met = True
                break
            nearest = min(nearest, away)
        # What is still ahead at the end of the sweep, or left behind by it, is not beside the way.
        left = nearest >= before and away > before + 0.01
        if not met and not closing and not left:
            room = min(room, nearest)
    c0, s0 = math.cos(pose[2]), math.sin(pose[2])
    for i in range(rim.shape[0]):
        rx, ry = rim[i, 0], rim[i, 1]
        before = value_at(
            surface, x0, y0, resolution,
            pose[0] + c0 * rx - s0 * ry, pose[1] + s0 * rx + c0 * ry,
        )  # fmt: skip
        limit = min(margin, before - 0.002)
        for k in range(steps):
            if (k + 1) * step > walls:
                break
            c, s = sweep[k, 2], sweep[k, 3]
            bx, by = sweep[k, 0] + c * rx - s * ry, sweep[k, 1] + s * rx + c * ry
            away = value_at(
                surface, x0, y0, resolution,
                pose[0] + c0 * bx - s0 * by, pose[1] + s0 * bx + c0 * by,
            )  # fmt: skip
            if away < limit:
                walls = k * step
                break
    return walls, others, room


@kernel
def nearest_other(planes: Floats, points: Floats, known: np.ndarray, count: int) -> float:
    """Return the distance from the footprint to the nearest point the map does not show [m]."""
    nearest = 1e9
    for i in range(count):
        if not known[i]:
            nearest = min(nearest, _outside(planes, points[i, 0], points[i, 1]))
    return nearest


@kernel
def _advance(vx: float, vy: float, wz: float, t: float) -> tuple[float, float, float]:
    """Return the base's displacement after ``t`` seconds of a constant body-frame command."""
    turn = wz * t
    if abs(turn) < 1e-6:
        return vx * t, vy * t, turn
    s, c = math.sin(turn), math.cos(turn)
    return (vx * s - vy * (1.0 - c)) / wz, (vx * (1.0 - c) + vy * s) / wz, turn
