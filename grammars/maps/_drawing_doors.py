"""Doorways of a drawing: where blocks of doors lie in gaps of walls, or across walls.

A gap tells best how wide a doorway is, so a block takes the gap it lies in. Across a wall without
a gap the doorway is as wide as what the block draws along the wall, and is cut out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPoint, Point
from shapely.geometry.base import BaseGeometry

from grammars.maps._drawing_lines import DoorBlock
from grammars.maps._drawing_walls import THICKEST, WallGap
from grammars.model.geometry import Point2, Pose2

_BESIDE: Final = 0.15
"""How far from a gap a block may be drawn [m]."""
_UNLIKE: Final = 0.35
"""Share of a gap by which its width may differ from that of a block."""
_LONG: Final = 0.3
"""Sides of walls that tell where a wall leads are at least this long [m]."""
_OPEN: Final = (0.4, 4.0)
"""Widths of openings that are cut out of walls [m]."""
_ASIDE: Final = 0.05
"""A leaf lies to one side of its wall when its middle is this far off it [m]."""


def gap_of(block: DoorBlock, gaps: Sequence[WallGap]) -> WallGap | None:
    """Return the gap in a wall that a block lies in, seen so that the leaf is to its right."""
    if not block.points:
        return None
    drawn: BaseGeometry = MultiPoint(block.points).convex_hull
    fitting = [
        gap
        for gap in gaps
        if gap.area(along=_BESIDE, across=_BESIDE).intersects(drawn)
        and abs(_width_along(block, gap.frame) - gap.width) <= _UNLIKE * gap.width
    ]
    if not fitting:
        return None
    at = Point(block.at)

    def unlike(gap: WallGap) -> tuple[float, float]:
        away = gap.area().distance(at)
        return (round(away, 3), abs(_width_along(block, gap.frame) - gap.width))

    return _seen_from_leaf(min(fitting, key=unlike), block)


def cut_for(block: DoorBlock, walls: BaseGeometry) -> WallGap | None:
    """Return the opening a block makes in a wall that it is drawn across; nothing if in none."""
    at = Point(block.at)
    if not block.points or walls.distance(at) > THICKEST:
        return None
    side = _nearest_side(walls, at)
    if side is None:
        return None
    (x0, y0), (x1, y1) = side
    along = Pose2(*block.at, math.atan2(y1 - y0, x1 - x0))
    xs = [x for x, _ in along.inverse().apply_ring(block.points)]
    low, high = min(xs), max(xs)
    if block.width:
        middle = (low + high) / 2
        low, high = middle - block.width / 2, middle + block.width / 2
    if not _OPEN[0] <= high - low <= _OPEN[1]:
        return None
    through = _through(walls, along, (low + high) / 2)
    if through is None:
        return None
    near, far = through
    y = (near + far) / 2
    gap = WallGap(along.apply((low, y)), along.apply((high, y)), far - near)
    return _seen_from_leaf(gap, block)


def _through(walls: BaseGeometry, along: Pose2, x: float) -> tuple[float, float] | None:
    """Return where a line across a wall enters and leaves it, nearest to the block."""
    line = LineString([along.apply((x, -THICKEST)), along.apply((x, THICKEST))])
    pieces = []
    for part in shapely.get_parts(walls.intersection(line)).tolist():
        if isinstance(part, LineString) and part.length > 0.0:
            ys = [along.inverse().apply((px, py))[1] for px, py in part.coords]
            pieces.append((min(ys), max(ys)))
    return min(pieces, key=lambda ends: abs(ends[0] + ends[1]), default=None)


def _nearest_side(walls: BaseGeometry, at: Point) -> tuple[Point2, Point2] | None:
    corners: Any = shapely.get_parts(shapely.boundary(walls))
    best: tuple[float, tuple[Point2, Point2]] | None = None
    for line in corners.tolist():
        points = np.asarray(line.coords)
        long = np.flatnonzero(np.linalg.norm(np.diff(points, axis=0), axis=1) >= _LONG)
        for k in long.tolist():
            side = ((float(points[k, 0]), float(points[k, 1])), tuple(points[k + 1].tolist()))
            away = round(LineString(side).distance(at), 6)
            if best is None or away < best[0]:
                best = (away, (side[0], (side[1][0], side[1][1])))
    return best[1] if best else None


def _width_along(block: DoorBlock, frame: Pose2) -> float:
    xs = [x for x, _ in frame.inverse().apply_ring(block.points)]
    return block.width or max(xs) - min(xs)


def _seen_from_leaf(gap: WallGap, block: DoorBlock) -> WallGap:
    """Return the gap with the drawn leaf to its right, which is where a door opens inwards."""
    middle = MultiPoint(block.points).convex_hull.centroid
    if middle.is_empty:
        return gap
    aside = gap.frame.inverse().apply((middle.x, middle.y))[1]
    if abs(aside) > _ASIDE:
        return gap.turned() if aside > 0.0 else gap
    # A sliding door is drawn in its wall: then from left to right, or upwards.
    return gap.turned() if (gap.start > gap.end) else gap
