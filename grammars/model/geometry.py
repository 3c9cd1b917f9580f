"""Plane geometry values: SI units, radians, frames per REP 103."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

# In quotes, since most users of this module do not need numpy.
Floats: TypeAlias = "npt.NDArray[np.float64]"
Point2: TypeAlias = tuple[float, float]
Ring: TypeAlias = tuple[Point2, ...]
"""A polygon outline: corners in order, the first one not repeated [m]."""


def signed_area(ring: Sequence[Point2]) -> float:
    """Return the area of a ring [m²], negative if clockwise (shoelace formula)."""
    pairs = zip(ring, (*ring[1:], *ring[:1]), strict=True)
    return sum(p[0] * q[1] - q[0] * p[1] for p, q in pairs) / 2


def wrap_angle(angle: float) -> float:
    """Map an angle [rad] to the half-open interval (-pi, pi]."""
    # remainder is exact. The stacks instead wrap by modulo to [-pi, pi), as robots do:
    # daemon.stacks.kernels.wrap_angle_modulo.
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def turn(a: Point2, b: Point2, c: Point2) -> float:
    """Return the cross product [m^2] at b: > 0 if the path a, b, c turns left, < 0 if right."""
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


_FLAT: Final = 1e-9


def convex_ring(corners: Sequence[Point2]) -> Ring | None:
    """Return the corners of a convex outline counter-clockwise, ``None`` for other outlines.

    Outlines with repeated corners or corners on a straight line count as not convex.
    """
    # By signs, because the hull of shapely would accept repeated corners.
    turns = [turn(corners[i - 2], corners[i - 1], corners[i]) for i in range(len(corners))]
    one_way = all(t > _FLAT for t in turns) or all(t < -_FLAT for t in turns)
    if len(corners) < 3 or not one_way or not _turns_once(corners):
        return None
    return tuple(corners) if turns[0] > 0.0 else tuple(reversed(corners))


def _turns_once(corners: Sequence[Point2]) -> bool:
    """Return whether the outline goes around once; a pentagram goes around twice."""
    headings = [
        math.atan2(b[1] - a[1], b[0] - a[0])
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    ]
    pairs = zip([headings[-1], *headings[:-1]], headings, strict=True)
    total = sum(math.remainder(b - a, math.tau) for a, b in pairs)
    return abs(abs(total) - math.tau) < 1e-6


@dataclass(frozen=True, slots=True)
class Pose2:
    """A pose in the plane, the transform from child frame to parent frame.

    ``x`` and ``y`` in metres, ``yaw`` in radians counter-clockwise (REP 103).
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def __matmul__(self, other: Pose2) -> Pose2:
        """Compose transforms: ``world_from_a @ a_from_b`` is ``world_from_b``."""
        return Pose2(*self.apply((other.x, other.y)), wrap_angle(self.yaw + other.yaw))

    def inverse(self) -> Pose2:
        """Return the transform from parent frame to child frame."""
        x, y, yaw = self.x, self.y, self.yaw
        c, s = math.cos(yaw), math.sin(yaw)
        return Pose2(-c * x - s * y, s * x - c * y, wrap_angle(-yaw))

    def apply(self, point: Point2) -> Point2:
        """Return ``point`` (child frame) in the parent frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return (self.x + c * point[0] - s * point[1], self.y + s * point[0] + c * point[1])

    def apply_ring(self, ring: Ring) -> Ring:
        """Return the corners of ``ring`` (child frame) in the parent frame."""
        return tuple(self.apply(corner) for corner in ring)


@dataclass(frozen=True, slots=True)
class Twist2:
    """A velocity in the plane, in the body frame: ``vx``, ``vy`` [m/s], ``wz`` [rad/s]."""

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0
