"""Walls from lines: what two lines enclose is a wall, and so is a line by itself, thickened.

Lines are cut where they meet. Faces between them that nowhere are wider than a wall can be are
walls; ends of two lines that end side by side are joined first, as at a doorway. What is left is
the middle line of a wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.model.geometry import Point2, Pose2, Ring, turn

THICKEST: Final = 0.6
"""Of two lines that are farther apart [m], each is a wall."""
_THINNEST: Final = 0.02
"""Lines closer than this [m] are one wall's finish, and ends as close are meant to meet."""
SMALLEST_ROOM: Final = 1.0
"""What is enclosed and smaller [m²] is a column or a shaft."""
_GRID: Final = 1e-3
"""Corners this near [m] are one."""
_ABREAST: Final = 0.2
"""How far, as a share of the wall, one of two lines that end side by side may be ahead."""
_DOORWAY: Final = (0.5, 3.0)
"""Widths of gaps between walls that may be doorways [m]."""


@dataclass(frozen=True, slots=True)
class WallGap:
    """A gap between the ends of two walls in line: jambs in the middle of the wall, and depth."""

    start: Point2
    end: Point2
    depth: float

    @property
    def width(self) -> float:
        """Clear width [m]."""
        return math.dist(self.start, self.end)

    @property
    def frame(self) -> Pose2:
        """Its middle, x from start to end."""
        (x0, y0), (x1, y1) = self.start, self.end
        return Pose2((x0 + x1) / 2, (y0 + y1) / 2, math.atan2(y1 - y0, x1 - x0))

    def area(self, *, along: float = 0.0, across: float = 0.0) -> Polygon:
        """Return the floor between the jambs, longer on both sides by so much [m]."""
        x, y = self.width / 2 + along, self.depth / 2 + across
        return Polygon(self.frame.apply_ring(((-x, -y), (x, -y), (x, y), (-x, y))))

    def turned(self) -> WallGap:
        """Return the same gap, seen from the other side."""
        return WallGap(self.end, self.start, self.depth)


def wall_area(lines: Sequence[Sequence[Point2]], thickness: float) -> BaseGeometry:
    """Return the floor that walls stand on; single lines become ``thickness`` [m] thick."""
    drawn = [LineString(line) for line in lines]
    net = shapely.union_all(drawn, grid_size=_GRID)
    net = shapely.union_all([net, *_caps(net)], grid_size=_GRID)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(net)))
    thick = shapely.union_all([face for face in faces if _is_wall(face)])
    pieces = shapely.get_parts(net)
    faces_of_walls = shapely.buffer(thick, 2 * _GRID)
    shapely.prepare(faces_of_walls)
    single = shapely.line_merge(
        shapely.multilinestrings(pieces[~shapely.covers(faces_of_walls, pieces)])
    )
    middles = [line for line in shapely.get_parts(single) if line.length > THICKEST / 4]
    walls = [
        line.buffer(thickness / 2, cap_style="flat", join_style="mitre", mitre_limit=3.0)
        for line in middles
    ]
    # Where three lines meet their ends, cut off square, leave a notch.
    joints = [Point(p).buffer(thickness / 2, quad_segs=2) for p in _meeting_points(middles)]
    return shapely.union_all([thick, *walls, *joints])


def _is_wall(face: Any) -> bool:
    if face.area < SMALLEST_ROOM:
        return True
    return bool(shapely.is_empty(shapely.buffer(face, -THICKEST / 2)))


def _ends(net: BaseGeometry) -> Iterator[tuple[Point2, Point2]]:
    """Yield the loose ends of lines, each with the direction in which its line ends."""
    seen: dict[Point2, list[Point2]] = {}
    for line in shapely.get_parts(net).tolist():
        corners = [(float(x), float(y)) for x, y in line.coords]
        seen.setdefault(corners[0], []).append(corners[1])
        seen.setdefault(corners[-1], []).append(corners[-2])
    for end, before in sorted(seen.items()):
        if len(before) == 1 and end != before[0]:
            length = math.dist(end, before[0])
            yield end, ((end[0] - before[0][0]) / length, (end[1] - before[0][1]) / length)


def loose_ends(lines: Sequence[Sequence[Point2]]) -> list[Point2]:
    """Return where lines end and meet no other, nor are joined with the other face of a wall."""
    net = shapely.union_all([LineString(line) for line in lines], grid_size=_GRID)
    net = shapely.union_all([net, *_caps(net)], grid_size=_GRID)
    return [end for end, _ in _ends(net)]


def _caps(net: BaseGeometry) -> list[LineString]:
    """Return the lines that close walls whose two faces end side by side, and hairline gaps."""
    ends = list(_ends(net))
    if len(ends) < 2:
        return []
    points = shapely.points([end for end, _ in ends])
    near, other = shapely.STRtree(points).query(points, predicate="dwithin", distance=THICKEST)
    pairs = [(int(a), int(b)) for a, b in zip(near, other, strict=True) if a < b]
    pairs.sort(key=lambda pair: (math.dist(ends[pair[0]][0], ends[pair[1]][0]), pair))
    joined: set[int] = set()
    found = []
    for a, b in pairs:
        # Nearest first, and each end once: the other face of the same wall is nearer than that of
        # the next wall.
        if a not in joined and b not in joined and _belong_together(ends[a], ends[b]):
            joined |= {a, b}
            found.append(LineString([ends[a][0], ends[b][0]]))
    return found


def _belong_together(one: tuple[Point2, Point2], other: tuple[Point2, Point2]) -> bool:
    (p, u), (q, v) = one, other
    apart = math.dist(p, q)
    if apart <= _THINNEST:
        return True
    same_way = u[0] * v[0] + u[1] * v[1] > 0.98
    ahead = abs((q[0] - p[0]) * u[0] + (q[1] - p[1]) * u[1])
    return same_way and ahead <= _ABREAST * apart


def _meeting_points(lines: Sequence[Any]) -> list[Point2]:
    ends: dict[Point2, int] = {}
    for line in lines:
        for x, y in (line.coords[0], line.coords[-1]):
            ends[float(x), float(y)] = ends.get((float(x), float(y)), 0) + 1
    return [end for end, count in sorted(ends.items()) if count > 2]


def polygons_in(area: BaseGeometry) -> list[Polygon]:
    """Return the polygons of an area from left to right, without dust."""
    parts = [
        part
        for part in shapely.get_parts(shapely.set_precision(area, _GRID / 10)).tolist()
        if isinstance(part, Polygon) and part.area > _GRID
    ]
    tidy = [shapely.simplify(part, _GRID / 10) for part in parts]
    return sorted(
        (part for part in tidy if isinstance(part, Polygon)), key=lambda part: part.bounds
    )


def enclosed(walls: BaseGeometry) -> list[Polygon]:
    """Return the floor that walls enclose, in pieces as large as a room, the largest first."""
    x0, y0, x1, y1 = walls.bounds
    around = shapely.box(x0 - 1.0, y0 - 1.0, x1 + 1.0, y1 + 1.0)
    outside = Point(x0 - 0.5, y0 - 0.5)
    rooms = [
        part
        for part in polygons_in(around.difference(walls))
        if part.area >= SMALLEST_ROOM and not part.contains(outside)
    ]
    return sorted(rooms, key=lambda room: (-round(room.area, 3), room.bounds))


def gaps_in(walls: BaseGeometry) -> list[WallGap]:
    """Return the gaps as wide as a doorway between the end of a wall and what it looks at."""
    ends = [end for part in polygons_in(walls) for end in _wall_ends(part)]
    if not ends:
        return []
    middles = np.array([end.middle for end in ends])
    normals = np.array([end.normal for end in ends])
    rays = [middles + normals * reach for reach in (_GRID, _DOORWAY[1])]
    seen = shapely.intersection(shapely.linestrings(np.stack(rays, axis=1)), walls)
    away: Any = shapely.distance(shapely.points(middles), seen)
    found: list[WallGap] = []
    # Nothing seen is nan, which is not as wide as a doorway either.
    for k in np.flatnonzero((away >= _DOORWAY[0]) & (away <= _DOORWAY[1])).tolist():
        x, y = (middles[k] + normals[k] * away[k]).tolist()
        gap = WallGap(ends[k].middle, (x, y), ends[k].thickness)
        area = gap.area()
        # Two ends that look at each other are one gap; and a gap is free of walls.
        if all(area.intersection(other.area()).area < area.area / 2 for other in found) and (
            walls.intersection(area.buffer(-_THINNEST / 2)).area < _GRID
        ):
            found.append(gap)
    return found


@dataclass(frozen=True, slots=True)
class _WallEnd:
    middle: Point2
    normal: Point2
    thickness: float


def _wall_ends(wall: Polygon) -> Iterator[_WallEnd]:
    """Yield the short sides of a wall, where both of its faces end."""
    # Counter-clockwise, holes clockwise: so the wall lies to the left of every side.
    turned = shapely.orient_polygons(wall)
    for ring in (turned.exterior, *turned.interiors):
        corners: Ring = tuple((float(x), float(y)) for x, y in ring.coords[:-1])
        for k, end in enumerate(corners):
            start, before = corners[k - 1], corners[k - 2]
            after = corners[(k + 1) % len(corners)]
            side = math.dist(start, end)
            if not _THINNEST <= side <= THICKEST:
                continue
            if turn(before, start, end) <= 0.0 or turn(start, end, after) <= 0.0:
                continue
            middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
            normal = ((end[1] - start[1]) / side, (start[0] - end[0]) / side)
            yield _WallEnd(middle, normal, side)
