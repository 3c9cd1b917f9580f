"""Waypoints around every space: the inset contour of its floor (Ortega et al. 2024, section 3.3).

The contour is a negative buffer with mitred corners, so it is right for rooms of any shape. Where
a space is too narrow there is none, where it has a narrow middle there are several parts: both are
reported. Waypoints are numbered as in the published tools: waypoint 0 lies near the second corner
of the space, the following ones in the order of its corners.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Point, Polygon

from grammars.scene import Region, Scene
from grammars.values import Floats, Point2, Ring

Yaw: TypeAlias = Literal["zero", "path"]
_SHARPEST: Final = 1e6
"""Corners are never cut off, however sharp."""
_SAME: Final = 1e-6
"""Lengths below this are rounding errors [m]."""


@dataclass(frozen=True, slots=True)
class Contour:
    """The inset of one space: ``parts`` are rings, numbered in the order of the space's corners.

    ``findings`` say what is not as people may expect.
    """

    space: str
    parts: tuple[Ring, ...]
    findings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Stop:
    """A waypoint of a route: ``part`` and ``number`` of its corner, position [m], yaw [rad]."""

    part: int
    number: int
    x: float
    y: float
    yaw: float


def inset_contour(region: Region, distance: float) -> Contour:
    """Return the contour ``distance`` [m] inside of a space.

    Raises :class:`ValueError` unless ``distance`` is positive and finite.
    """
    if not (distance > 0.0 and math.isfinite(distance)):
        raise ValueError(f"a contour lies inside of a space, not {distance} m from its edge")
    floor = Polygon(region.outline)
    inner = floor.buffer(-distance, join_style="mitre", mitre_limit=_SHARPEST)
    rings = [
        _numbered(part.exterior, region.outline, distance)
        for part in shapely.get_parts(inner)
        if part.area > _SAME
    ]
    rings.sort(key=lambda found: found[0])
    parts = tuple(ring for _, ring in rings)
    return Contour(region.name, parts, _findings(region, parts, distance))


def route(
    contour: Contour,
    *,
    first: int = 0,
    forward: bool = True,
    closed: bool = False,
    yaw: Yaw = "zero",
) -> tuple[Stop, ...]:
    """Return the waypoints of a contour in the order they are driven.

    ``first`` is the number to begin with (counted around where there are fewer corners),
    ``closed`` comes back to it in the end. With yaw ``path`` the robot looks towards the next
    waypoint, with ``zero`` along the x axis of the map.
    """
    stops: list[Stop] = []
    for index, ring in enumerate(contour.parts):
        step = 1 if forward else -1
        order = [(first + step * i) % len(ring) for i in range(len(ring) + closed)]
        points = [ring[i] for i in order]
        ahead = _headings(points) if yaw == "path" else [0.0] * len(points)
        stops += [
            Stop(index, number, *point, heading)
            for number, point, heading in zip(order, points, ahead, strict=True)
        ]
    return tuple(stops)


def too_close(
    scene: Scene, contour: Contour, distance: float, *, height: float
) -> tuple[tuple[str, str, float], ...]:
    """Return the waypoints nearer than ``distance`` to a column or divider below ``height`` [m].

    Each as waypoint (``0``, or ``1.0`` for part 1), what stands there, and how far it is [m].
    """
    things = [s for s in scene.solids if s.kind != "wall" and s.z_min < height]
    tree = shapely.STRtree([Polygon(s.polygon) for s in things])
    found: dict[tuple[str, str], float] = {}
    for index, ring in enumerate(contour.parts):
        for number, corner in enumerate(ring):
            at = Point(corner)
            for hit in tree.query(at, predicate="dwithin", distance=distance - _SAME).tolist():
                label = f"{index}.{number}" if len(contour.parts) > 1 else str(number)
                away = float(at.distance(Polygon(things[hit].polygon)))
                key = (label, things[hit].owner)
                found[key] = min(away, found.get(key, math.inf))
    return tuple((label, owner, away) for (label, owner), away in found.items())


def _numbered(ring: shapely.LinearRing, outline: Ring, distance: float) -> tuple[int, Ring]:
    """Return the corners in the order of ``outline``, and which of its edges comes first."""
    corners = shapely.get_coordinates(shapely.normalize(ring).simplify(0.0))[:-1]
    if _turns_left(corners) != _turns_left(np.array(outline)):
        corners = corners[::-1]
    arriving = _edges_behind(corners, np.array(outline), distance)
    start = int(np.argmin(arriving))
    turned = np.roll(corners, -start, axis=0)
    return int(arriving[start]), tuple((float(x), float(y)) for x, y in turned)


def _edges_behind(corners: Floats, outline: Floats, distance: float) -> npt.NDArray[np.intp]:
    """Return for every corner which edge of the outline its arriving side is the inset of."""
    start, end = outline, np.roll(outline, -1, axis=0)
    along = end - start
    length = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length, _SAME)[:, None]
    before = np.roll(corners, 1, axis=0)
    side = corners - before
    side = side / np.maximum(np.linalg.norm(side, axis=1), _SAME)[:, None]
    middle = (corners + before) / 2.0
    parallel = side @ along.T
    offset = middle[:, None, :] - start[None, :, :]
    across = np.abs(offset[:, :, 0] * along[:, 1] - offset[:, :, 1] * along[:, 0])
    position = np.einsum("ijk,jk->ij", offset, along)
    beyond = np.maximum(0.0, np.maximum(-position, position - length))
    unlike = 2.0 * (1.0 - parallel) + np.abs(across - distance) + beyond
    nearest: npt.NDArray[np.intp] = np.argmin(unlike, axis=1)
    return nearest


def _turns_left(ring: Floats) -> bool:
    x, y = ring.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) > 0.0


def _headings(points: Sequence[Point2]) -> list[float]:
    ahead = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in itertools.pairwise(points)]
    return [*ahead, ahead[-1] if ahead else 0.0]


def _findings(region: Region, parts: tuple[Ring, ...], distance: float) -> tuple[str, ...]:
    if not parts:
        return (f"{region.name}: nowhere {distance:g} m from its walls, so no waypoints",)
    found = []
    if len(parts) > 1:
        found.append(
            f"{region.name}: {distance:g} m from its walls it falls into {len(parts)} parts"
        )
    corners = shapely.get_num_coordinates(Polygon(region.outline).simplify(0.0)) - 1
    lost = int(corners) - sum(map(len, parts))
    if lost > 0:
        found.append(
            f"{region.name}: {lost} of its corners have no waypoint {distance:g} m from the walls"
        )
    return tuple(found)
