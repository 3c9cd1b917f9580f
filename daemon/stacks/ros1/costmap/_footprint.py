"""The footprint of a costmap: padding, radii, the polygon that stands for a radius."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from grammars.model.geometry import Floats, Point2

_CORNERS = 16
"""Corners of the polygon that stands for ``robot_radius`` (costmap_2d footprint.cpp)."""


def footprint_of_radius(radius: float) -> tuple[Point2, ...]:
    """Return the 16 corners that costmap_2d puts on a circle of ``radius`` [m]."""
    angles = [2.0 * math.pi * k / _CORNERS for k in range(_CORNERS)]
    return tuple((radius * math.cos(angle), radius * math.sin(angle)) for angle in angles)


def padded_footprint(points: Sequence[Point2], padding: float = 0.01) -> Floats:
    """Return ``points`` as (k, 2) with every coordinate moved out from zero by ``padding`` [m].

    A coordinate of exactly zero stays (costmap_2d ``padFootprint``). Raises ``ValueError`` for
    fewer than three points.
    """
    corners = np.array(points, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1:] != (2,) or len(corners) < 3:
        raise ValueError(
            f"a footprint needs at least three points [x, y], this one has {len(points)}"
        )
    return np.asarray(corners + np.sign(corners) * padding, dtype=np.float64)


def radii(points: Floats | Sequence[Point2]) -> tuple[float, float]:
    """Return the inscribed and the circumscribed radius [m] of a polygon about the origin.

    The inscribed one is the distance from the origin to the nearest edge, whether or not the
    origin lies inside (costmap_2d ``calculateMinAndMaxDistances``).
    """
    corners = [(float(x), float(y)) for x, y in points]
    following = corners[1:] + corners[:1]
    edges = [_to_segment(a, b) for a, b in zip(corners, following, strict=True)]
    away = [math.hypot(x, y) for x, y in corners]
    return min(edges + away), max(away)


def _to_segment(a: Point2, b: Point2) -> float:
    """Return the distance from the origin to the segment from ``a`` to ``b``."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length2 = dx * dx + dy * dy
    along = -(a[0] * dx + a[1] * dy) / length2 if length2 > 0.0 else 0.0
    along = min(1.0, max(0.0, along))
    return math.hypot(a[0] + along * dx, a[1] + along * dy)
