"""Basics of the physics: time step, materials, collision filters; mass and distance of polygons."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pymunk

from daemon.model.kernels import kernel
from daemon.model.sut import TICK_RATE
from grammars.model.geometry import Floats, Point2, Pose2, Ring

# 100 Hz: with 20 doors a simulated second costs 0.3 to 1.2 ms, at 1 kHz 2 to 10 ms (measured). A
# robot driven through joints is at most 5 mm deep in a wall.
DT = 1.0 / TICK_RATE

FRICTION = 0.5
"""Coulomb friction of every surface; Chipmunk multiplies those of two in contact: 0.25."""

ROBOT_COLLISION_TYPE = 1
"""Collision type of the robot, the only one whose contacts are recorded."""

_ROBOT, _BUILDING, _FIXED, _MOVING, _WALKING = 1, 2, 4, 8, 16

ROBOT_FILTER = pymunk.ShapeFilter(categories=_ROBOT)
BUILDING_FILTER = pymunk.ShapeFilter(categories=_BUILDING, mask=_ROBOT)


def link_filter(group: int, *, moves: bool) -> pymunk.ShapeFilter:
    """Return the filter of a link of object number ``group`` (from 1).

    Moving links meet the robot and the links of other objects. They ignore walls, columns and
    dividers: by design a leaf stands in its jamb and a sliding panel runs into its wall, and the
    limits of its joint bound its motion. Links of one object ignore each other for the same reason.
    """
    if moves:
        return pymunk.ShapeFilter(group, _MOVING, _ROBOT | _FIXED | _MOVING)
    return pymunk.ShapeFilter(group, _FIXED, _ROBOT | _MOVING)


def walker_filter(group: int) -> pymunk.ShapeFilter:
    """Return the filter of a mover's body, which meets only the robot.

    A mover is unstoppable, so the hinge of a leaf at its limit would break.
    """
    return pymunk.ShapeFilter(group, _WALKING, _ROBOT)


def ring_array(ring: Ring) -> Floats:
    """Return the corners as a float64 array of shape (n, 2)."""
    return np.array(ring, dtype=np.float64).reshape(-1, 2)


def ring_edges(ring: Ring) -> list[tuple[float, float, float, float]]:
    """Return the closed outline as segments (x1, y1, x2, y2)."""
    return [(*a, *b) for a, b in zip(ring, (*ring[1:], ring[0]), strict=True)]


def transform_array(pose: Pose2, points: Floats) -> Floats:
    """Transform points of shape (n, 2) from the frame at ``pose`` into the parent frame."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    result: Floats = points @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)
    return result


def centroid(ring: Ring) -> Point2:
    """Return the centroid of a simple polygon (shoelace formula)."""
    area = x = y = 0.0
    for x1, y1, x2, y2 in ring_edges(ring):
        cross = x1 * y2 - x2 * y1
        area += cross
        x += (x1 + x2) * cross
        y += (y1 + y2) * cross
    return x / (3.0 * area), y / (3.0 * area)


def mass_properties(parts: Sequence[tuple[Ring, float]]) -> tuple[float, Point2, float]:
    """Return total mass, centre of mass and moment about it of polygons with masses.

    The mass of a polygon is spread evenly over its area.
    """
    centroids = [centroid(ring) for ring, _ in parts]
    mass = sum(m for _, m in parts)
    x = sum(m * c[0] for (_, m), c in zip(parts, centroids, strict=True)) / mass
    y = sum(m * c[1] for (_, m), c in zip(parts, centroids, strict=True)) / mass
    moment = sum(pymunk.moment_for_poly(m, list(ring), (-x, -y)) for ring, m in parts)
    return mass, (x, y), moment


@kernel
def has_separating_edge(a: Floats, b: Floats) -> bool:
    """Tell whether an edge of convex ``a`` (n, 2) has all of ``b`` (m, 2) strictly outside."""
    # Twice the signed area, because rings may turn either way.
    n = a.shape[0]
    turn = 0.0
    for i in range(1, n - 1):
        turn += (a[i, 0] - a[0, 0]) * (a[i + 1, 1] - a[0, 1])
        turn -= (a[i, 1] - a[0, 1]) * (a[i + 1, 0] - a[0, 0])
    sign = 1.0 if turn >= 0.0 else -1.0
    for i in range(n if n > 2 else 0):
        j = (i + 1) % n
        ex, ey = a[j, 0] - a[i, 0], a[j, 1] - a[i, 1]
        outside = True
        for k in range(b.shape[0]):
            if sign * (ex * (b[k, 1] - a[i, 1]) - ey * (b[k, 0] - a[i, 0])) >= 0.0:
                outside = False
                break
        if outside:
            return True
    return False


@kernel
def corner_distance(a: Floats, b: Floats) -> float:
    """Return the least distance [m] from a corner of ``a`` to the outline of ``b``."""
    best = np.inf
    m = b.shape[0]
    for k in range(m):
        px, py = b[k, 0], b[k, 1]
        ex, ey = b[(k + 1) % m, 0] - px, b[(k + 1) % m, 1] - py
        length2 = ex * ex + ey * ey
        for i in range(a.shape[0]):
            dx, dy = a[i, 0] - px, a[i, 1] - py
            u = 0.0
            if length2 > 0.0:
                u = min(1.0, max(0.0, (dx * ex + dy * ey) / length2))
            best = min(best, math.hypot(dx - u * ex, dy - u * ey))
    return best


@kernel
def convex_distance(a: Floats, b: Floats) -> float:
    """Return the distance [m] between convex polygons (n, 2) and (m, 2); 0 if they overlap.

    A polygon may have a single corner. The separating axis theorem decides about overlap.
    """
    # Two corners, or a corner and an edge, have no area that could overlap.
    if not (has_separating_edge(a, b) or has_separating_edge(b, a)) and a.shape[0] + b.shape[0] > 3:
        return 0.0
    return min(corner_distance(a, b), corner_distance(b, a))
