"""Clearance and distance of the robot from obstacles and places, and presence inside places.

Distances are Euclidean, between the robot's footprint and filled outlines, and 0 where they meet.
Clearance is the signed distance of the nearest obstacle from a box around the robot.

``clearance(hx, hy)`` is the minimum over all obstacle points (x, y) in the body frame of
``max(|x| - hx, |y| - hy)``: positive outside the box, negative inside. One function is both the
collision box and the safety buffer of the paper (sections 4.2.3 and 4.4.1).

In the body frame ``g(p) = max(|x| - hx, |y| - hy)`` is convex and piecewise linear. Over a filled
convex polygon its minimum is -min(hx, hy) when the polygon holds the box centre, and lies on an
edge otherwise; along an edge it lies at an end or where two of the four planes of ``g`` cross.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon

from daemon.judging.oracles._obstacles import IndexArray, ObstaclePolygons, cos_sin
from daemon.judging.oracles._series import ObjectIndices, SignalSeries
from daemon.model.kernels import kernel
from grammars.model.geometry import Floats, Point2, Ring
from grammars.model.scene import Scene

_SQRT_2: Final = 1.4142135623730951
_SLACK: Final = 1e-9
"""Margin added to the radius of circles [m]: rounding must not skip the nearest polygon."""
_AROUND: Final = 1.0
"""Extra distance [m] beyond which polygons are skipped until the robot has moved this far."""


@kernel
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


@kernel
def _polygon_minimum(
    corners: Floats, first: int, last: int, c: float, s: float, tx: float, ty: float,
    hx: float, hy: float, bound: float,
) -> float:  # fmt: skip
    """Return the minimum of ``g`` over a filled convex polygon moved by (c, s, tx, ty).

    A minimum above ``bound`` is not exact, only above it: the circles of long walls rule out few
    of them, but most of their edges lie off one side of the box.
    """
    best = math.inf
    all_left = all_right = True
    px = tx + c * corners[last - 1, 0] - s * corners[last - 1, 1]
    py = ty + s * corners[last - 1, 0] + c * corners[last - 1, 1]
    for k in range(first, last):
        qx = tx + c * corners[k, 0] - s * corners[k, 1]
        qy = ty + s * corners[k, 0] + c * corners[k, 1]
        side = px * qy - py * qx
        all_left = all_left and side >= 0.0
        all_right = all_right and side <= 0.0
        least = max(
            max(min(px, qx), -max(px, qx)) - hx,
            max(min(py, qy), -max(py, qy)) - hy,
        )
        if least <= min(best, bound) + _SLACK:
            best = min(best, _edge_minimum(px, py, qx, qy, hx, hy))
        px, py = qx, qy
    # The centre is inside if it is on the same side of every edge, whichever way the ring turns. It
    # is on every edge (both sides) only if the polygon has no area.
    if all_left != all_right:
        return -min(hx, hy)
    return best


@kernel
def box_clearance(
    poses: Floats, centre: Floats, half: Floats, corners: Floats, offsets: npt.NDArray[np.int64],
    frame: npt.NDArray[np.int64], circle: Floats, tracks: Floats,
) -> tuple[Floats, npt.NDArray[np.int32]]:  # fmt: skip
    """Return clearance (n,) [m] and the index of the nearest polygon (n,) for each pose (n, 3).

    ``centre`` and ``half`` extents of the box in the base frame; the polygons are those of
    :class:`ObstaclePolygons`, at least one. Of equally near polygons the first one counts.

    A polygon whose circle is at distance d from the box centre has ``g >= d / sqrt(2) - max(hx,
    hy)``, so most are skipped; starting from the previous sample's nearest one keeps it tight.
    Polygons that are far away and have not moved yet are skipped without computing d: each is at
    least ``beyond`` away from (ox, oy), the box centre when they were last checked.
    """
    samples, polygons = len(poses), len(frame)
    values = np.empty(samples)
    nearest = np.empty(samples, dtype=np.int32)
    hx, hy = half[0], half[1]
    reach = max(hx, hy)
    # The nearest polygon of the previous sample comes first: the robot moves a few centimetres
    # between samples, so it is mostly the nearest again and rules out all farther ones.
    guess = 0
    # Doors rest most of the time: keep cosine and sine of a frame while its yaw stays the same.
    frames = tracks.shape[1]
    yaws, moves = np.empty(frames), np.empty(frames, dtype=np.bool_)
    cosines, sines = np.empty(frames), np.empty(frames)
    for f in range(frames):
        yaws[f], moves[f] = math.nan, False
    candidates = np.arange(polygons)
    count, beyond, ox, oy = polygons, -math.inf, 0.0, 0.0
    for i in range(samples):
        for f in range(frames):
            if tracks[i, f, 2] != yaws[f]:
                yaws[f] = tracks[i, f, 2]
                cosines[f], sines[f] = math.cos(yaws[f]), math.sin(yaws[f])
            if i > 0 and not moves[f]:
                for k in range(3):
                    if tracks[i, f, k] != tracks[i - 1, f, k]:
                        moves[f], beyond = True, -math.inf
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        bx = poses[i, 0] + c * centre[0] - s * centre[1]
        by = poses[i, 1] + s * centre[0] + c * centre[1]
        best, owner = math.inf, -1
        for again in range(2):
            for step in range(-1, count):
                p = guess if step < 0 else candidates[step]
                f = frame[p]
                wx, wy = circle[p, 0], circle[p, 1]
                lc, ls, lx, ly = 1.0, 0.0, 0.0, 0.0
                if f >= 0:
                    lx, ly = tracks[i, f, 0], tracks[i, f, 1]
                    lc, ls = cosines[f], sines[f]
                    wx, wy = lx + lc * wx - ls * wy, ly + ls * wx + lc * wy
                # Beyond this limit no point of the circle can be as near as the best so far.
                limit = (best + reach) * _SQRT_2 + circle[p, 2] + _SLACK
                if (wx - bx) ** 2 + (wy - by) ** 2 > limit * limit:
                    continue
                minimum = _polygon_minimum(
                    corners, offsets[p], offsets[p + 1],
                    c * lc + s * ls, c * ls - s * lc,
                    c * (lx - bx) + s * (ly - by), c * (ly - by) - s * (lx - bx),
                    hx, hy, best,
                )  # fmt: skip
                # Equals go by index, or the name in the evidence would depend on the guess.
                if minimum < best or (minimum == best and p < owner):
                    best, owner = minimum, p
            limit = (best + reach) * _SQRT_2 + _SLACK
            moved = math.hypot(bx - ox, by - oy)
            if again or (beyond - moved > limit and moved < _AROUND):
                break
            count, beyond, ox, oy = 0, math.inf, bx, by
            for p in range(polygons):
                f = frame[p]
                wx, wy = circle[p, 0], circle[p, 1]
                if f >= 0:
                    wx, wy = (
                        tracks[i, f, 0] + cosines[f] * wx - sines[f] * wy,
                        tracks[i, f, 1] + sines[f] * wx + cosines[f] * wy,
                    )
                away = math.hypot(wx - bx, wy - by) - circle[p, 2]
                if (f < 0 or not moves[f]) and away > limit + _AROUND:
                    beyond = min(beyond, away)
                else:
                    candidates[count] = p
                    count += 1
        values[i], nearest[i] = best, owner
        guess = owner
    return values, nearest


def box_clearance_series(
    obstacles: ObstaclePolygons, poses: Floats, *, centre: Point2, half: Point2
) -> SignalSeries:
    """Return the clearance [m] of a box in the base frame at ``poses`` (n, 3), with the object.

    The tracks of ``obstacles`` are sampled at the same times as the poses.
    """
    if not obstacles.names:
        return SignalSeries(
            np.full(len(poses), np.nan), note="nothing there as high as the robot to keep clear of"
        )
    values, nearest = box_clearance(
        poses,
        np.array(centre, dtype=np.float64),
        np.array(half, dtype=np.float64),
        obstacles.corners,
        obstacles.offsets,
        obstacles.frame,
        obstacles.circle,
        obstacles.tracks,
    )
    return SignalSeries(values, nearest, obstacles.names)


def distance_series(obstacles: ObstaclePolygons, poses: Floats, footprint: Ring) -> SignalSeries:
    """Return the distance [m] from the footprint at ``poses`` (n, 3) to the nearest obstacle.

    The tracks of ``obstacles`` are sampled at the same times as the poses.
    """
    if not obstacles.names:
        note = "nothing of it is as high as the robot"
        return SignalSeries(np.full(len(poses), np.nan), note=note)
    away, owner = nearest_polygons(obstacles, footprint, poses, np.arange(len(poses)))
    return SignalSeries(away, owner, obstacles.names)


def nearest_polygons(
    obstacles: ObstaclePolygons,
    footprint: Ring,
    poses: Floats,
    samples: IndexArray,
    reach: float = math.inf,
) -> tuple[Floats, ObjectIndices]:
    """Return distance (k,) [m] and index (k,) of the polygon nearest to the footprint.

    ``samples`` (k,) choose from the ``poses`` (n, 3), which are at the same times as the tracks of
    ``obstacles``. Of equally near polygons the first one counts. Without a polygon within ``reach``
    [m] the result is infinite and -1; moving polygons count at any distance.
    """
    robot = placed_polygons(np.array(footprint, dtype=np.float64), poses[samples])
    nearest = np.full(len(samples), np.inf)
    owner = np.full(len(samples), -1, dtype=np.int32)
    offsets = obstacles.offsets
    parts = [obstacles.corners[first:last] for first, last in itertools.pairwise(offsets)]
    still = np.flatnonzero(obstacles.frame < 0)
    if len(still):
        tree = shapely.STRtree([Polygon(parts[index]) for index in still])
        (sample, item), away = tree.query_nearest(
            robot, max_distance=None if math.isinf(reach) else reach, return_distance=True
        )
        # Equally near ones follow each other; the first one is assigned last.
        order = np.lexsort((-item, sample))
        nearest[sample[order]], owner[sample[order]] = away[order], still[item[order]]
    for index in np.flatnonzero(obstacles.frame >= 0):
        track = obstacles.tracks[samples, obstacles.frame[index]]
        away = shapely.distance(robot, placed_polygons(parts[index], track))
        closer = (away < nearest) | ((away == nearest) & (index < owner))
        nearest[closer], owner[closer] = away[closer], index
    return nearest, owner


def place_distance_series(outline: Ring, poses: Floats, footprint: Ring, name: str) -> SignalSeries:
    """Return the distance [m] from the footprint at ``poses`` (n, 3) to a part of the floor."""
    robot = placed_polygons(np.array(footprint, dtype=np.float64), poses)
    values: Floats = np.asarray(shapely.distance(robot, Polygon(outline)))
    return SignalSeries(values, np.zeros(len(poses), dtype=np.int32), (name,))


def inside_series(outline: Ring, poses: Floats, name: str) -> SignalSeries:
    """Return 1 where the base at ``poses`` (n, 3) is in a part of the floor or on its edge."""
    inside = shapely.intersects_xy(Polygon(outline), poses[:, 0], poses[:, 1])
    return SignalSeries(inside.astype(np.float64), np.zeros(len(poses), dtype=np.int32), (name,))


def place_outline(scene: Scene, name: str) -> Ring:
    """Return the outline [m] of a space or doorway; raises ``KeyError`` for an unknown one."""
    doorways = {doorway.name: doorway.footprint for doorway in scene.doorways}
    return (doorways | {region.name: region.outline for region in scene.regions})[name]


def placed_polygons(corners: Floats, poses: Floats) -> Any:
    """Return the polygons (n,) with ``corners`` (k, 2) placed at ``poses`` (n, 3)."""
    c, s = cos_sin(poses[:, 2].copy())
    x, y = corners[:, 0], corners[:, 1]
    placed = np.stack(
        (
            poses[:, 0, None] + c[:, None] * x - s[:, None] * y,
            poses[:, 1, None] + s[:, None] * x + c[:, None] * y,
        ),
        axis=-1,
    )
    return shapely.polygons(placed)
