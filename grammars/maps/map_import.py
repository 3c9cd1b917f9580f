"""Importer of occupancy maps: floor, walls and doorways of the building, and their accuracy.

This module needs scipy, unlike the reader of walls layers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import shapely

from grammars.maps._borders import (
    FREE_CELL,
    OCCUPIED_CELL,
    UNKNOWN_CELL,
    Patch,
    Points,
    loop_points,
    patches,
    trace_borders,
)
from grammars.maps._cells import tidied
from grammars.maps._doorways import DoorwaySizes, MapGap, find_doorways
from grammars.maps._straight_lines import StraightArc, main_directions
from grammars.maps._walls_layer import (
    AreaText,
    EntrywayText,
    StandingText,
    WallsText,
)
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.grid import OccupancyGrid

_DECIMALS: Final = 3
"""Decimals of corners [m]: whole millimetres, as in a walls layer."""
_FLAT: Final = 1e-6
"""Distance from the line between its neighbours up to which a point is not a corner [m]."""
_NARROWEST, _WIDEST, _DOOR_HEIGHT = 0.7, 1.3, 2.0
"""Sizes of doorways [m]."""
_DEEPEST: Final = 0.6
"""Thickness of the thickest wall with a doorway [m]."""
_WIDER: Final = 0.25
"""Extra width of the floor before and behind a doorway [m]; a corridor has none."""
_WALL: Final = 0.5
"""Least length of a wall beside a doorway [m]."""
_CLEAR: Final = 0.3
"""Free floor before and behind a doorway [m]."""
_JAMB_CELLS: Final = 4.0
"""Distance beyond a gap's cells in which to search for its jambs."""


@dataclass(frozen=True, slots=True)
class ImportSettings:
    """Settings of the import of a map.

    ``tolerance`` is the largest distance between a border of cells and its line [cells, at least
    0.4]. Groups of fewer than ``specks`` cells are noise. ``least_room`` is the smallest room
    [m²], ``height`` the height of the walls [m]. With ``doorways``, gaps between walls become
    doorways.
    """

    name: str = "building"
    tolerance: float = 1.0
    specks: int = 4
    least_room: float = 1.0
    height: float = 2.5
    doorways: bool = True


@dataclass(frozen=True, slots=True)
class ImportReport:
    """Report on an imported building: its sizes and its accuracy.

    ``doorways`` have their width [m]. ``largest_error`` is the largest distance between a corner
    of the cells and its line [cells]. ``directions`` are the main directions of the walls [rad],
    ``dropped_floor`` the area of ignored pockets [m²]. ``dropped_walls`` and ``filled_cells`` count
    cells of noise. Floor ends without a wall along ``open_border`` [m]; its longest piece has its
    middle at ``widest_opening`` [m].
    """

    resolution: float
    width: float
    depth: float
    spaces: tuple[str, ...]
    walls: int
    doorways: Mapping[str, float]
    corners: int
    largest_error: float
    directions: tuple[float, ...]
    dropped_floor: float
    dropped_walls: int
    filled_cells: int
    open_border: float
    widest_opening: Point2 | None


@dataclass(frozen=True, slots=True)
class ImportedBuilding:
    """File of a walls layer, and the report on its building."""

    file: str
    report: ImportReport


@dataclass(frozen=True, slots=True)
class ImportedMap:
    """Building made from a map, and the report on it."""

    building: WallsText
    report: ImportReport


class EmptyMapError(ValueError):
    """A map without a single free cell."""


def vectorise(
    grid: OccupancyGrid, settings: ImportSettings | None = None, *, yaw: float = 0.0
) -> ImportedMap:
    """Return the building on a map.

    Free floor becomes spaces, occupied cells become walls; they share their borders. Every corner
    of a cell on a border lies within the tolerance of its line. ``yaw`` [rad] turns the map about
    its origin. Equal maps give equal buildings.

    Raises :class:`EmptyMapError` for a map without free floor.
    """
    settings = settings or ImportSettings()
    per_cell = grid.resolution
    room = max(round(settings.least_room / per_cell**2), 1)
    tidy = tidied(grid.cells, least_room=room, specks=settings.specks)
    if not (tidy.labels == FREE_CELL).any():
        raise EmptyMapError("the map shows no free floor")
    arcs = trace_borders(tidy.labels)
    straight = [StraightArc.of(arc, settings.tolerance) for arc in arcs]
    regions = patches(arcs, [arc.track.points for arc in straight])
    directions = main_directions([arc.chords() for arc in straight])
    for arc in straight:
        arc.straighten(directions)
    frame = _Frame(Pose2(grid.x, grid.y, yaw), per_cell)
    lines = _drawn(straight, regions, frame)
    areas = [(region.label, _polygon(region, lines)) for region in regions]
    floors = [area for label, area in areas if label == FREE_CELL]
    walls = [area for label, area in areas if label == OCCUPIED_CELL]
    gaps: tuple[MapGap, ...] = ()
    if settings.doorways:
        # Allow for a cell more or less: a wall may begin anywhere in its first cell.
        sizes = DoorwaySizes(
            _NARROWEST / per_cell - 1.0,
            _WIDEST / per_cell + 1.0,
            _DEEPEST / per_cell,
            _WALL / per_cell,
            _CLEAR / per_cell,
            _WIDER / per_cell,
            room,
        )
        gaps = find_doorways(tidy.labels, directions, sizes)
    gaps = tuple(_between_walls(gap, walls, frame) for gap in gaps)
    rooms = _parted(floors, gaps, frame)
    bounds = np.array([polygon.bounds for polygon in (*rooms, *walls)])
    width, depth = (bounds[:, 2:].max(axis=0) - bounds[:, :2].min(axis=0)).tolist()
    size = f"{width:.1f} m by {depth:.1f} m"
    # The corners are valid; checking them again would take as long as the import.
    building = WallsText.model_construct(
        walls=settings.name,
        about=f"Made by scenario import from a map of {per_cell:g} m per cell, {size}.",
        height=settings.height,
        spaces={f"room_{k}": AreaText.model_construct(**_area(p)) for k, p in enumerate(rooms, 1)},
        standing=[StandingText.model_construct(**_area(p)) for p in _in_order(walls)],
        entryways=_entryways(gaps, frame, min(_DOOR_HEIGHT, settings.height)),
    )
    ends = sorted(
        (
            shapely.LineString(line)
            for arc, line in zip(arcs, lines, strict=True)
            if {arc.left, arc.right} == {FREE_CELL, UNKNOWN_CELL}
        ),
        key=shapely.length,
    )
    report = ImportReport(
        resolution=per_cell,
        width=width,
        depth=depth,
        spaces=tuple(building.spaces),
        walls=len(building.standing),
        doorways={
            name: round(math.dist(door.start, door.end), _DECIMALS)
            for name, door in building.entryways.items()
        },
        corners=sum(len(line) - 1 for line in lines),
        largest_error=max(arc.error() for arc in straight),
        directions=directions,
        dropped_floor=tidy.dropped_free * per_cell**2,
        dropped_walls=tidy.dropped_occupied,
        filled_cells=tidy.filled,
        open_border=float(sum(end.length for end in ends)),
        widest_opening=_middle(ends[-1]) if ends else None,
    )
    return ImportedMap(building, report)


@dataclass(frozen=True, slots=True)
class _Frame:
    """Transform from cells to metres, rounded to millimetres."""

    pose: Pose2
    resolution: float
    _turn: npt.NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        cos, sin = np.cos(self.pose.yaw), np.sin(self.pose.yaw)
        object.__setattr__(self, "_turn", np.array([[cos, sin], [-sin, cos]]))

    def metres(self, cells: Points) -> Points:
        """Return points in the frame of the map [m]."""
        placed = cells * self.resolution @ self._turn + (self.pose.x, self.pose.y)
        # Adding 0.0 turns -0.0 into 0.0.
        return np.round(placed, _DECIMALS) + 0.0


def _drawn(
    straight: Sequence[StraightArc], regions: Sequence[Patch], frame: _Frame
) -> list[Points]:
    """Return the lines of all arcs [m], close enough to their cells that none crosses another."""
    lines = [_line(arc, frame) for arc in straight]
    while True:
        crossing = _crossings(lines) or _invalid(regions, lines)
        closer = [
            index
            for index in sorted({arc for arc, _ in crossing})
            if straight[index].draw_closer(piece for arc, piece in crossing if arc == index)
        ]
        if not closer:
            return [line for line, _ in lines]
        for index in closer:
            lines[index] = _line(straight[index], frame)


def _line(arc: StraightArc, frame: _Frame) -> tuple[Points, list[int]]:
    """Return the points of an arc [m], and the index of each line's piece."""
    points, owners = arc.line()
    placed = frame.metres(points)
    apart = (np.diff(placed, axis=0) != 0.0).any(axis=1)
    return placed[np.append(True, apart)], [
        owner for owner, there in zip(owners, apart, strict=True) if there
    ]


def _crossings(lines: Sequence[tuple[Points, list[int]]]) -> set[tuple[int, int]]:
    """Return the pieces (arc, piece) whose lines meet others except at common ends."""
    owner = [(index, piece) for index, (_, pieces) in enumerate(lines) for piece in pieces]
    segments = np.vstack([np.stack([line[:-1], line[1:]], axis=1) for line, _ in lines])
    straight = np.asarray(shapely.linestrings(segments))
    one, other = shapely.STRtree(straight).query(straight, predicate="intersects")
    once = one < other
    one, other = one[once], other[once]
    shared = np.zeros(len(one), dtype=np.bool_)
    folded = np.zeros(len(one), dtype=np.bool_)
    for k in (0, 1):
        for m in (0, 1):
            same = (segments[one, k] == segments[other, m]).all(axis=1)
            way = segments[one, 1 - k] - segments[one, k]
            back = segments[other, 1 - m] - segments[other, m]
            cross = way[:, 0] * back[:, 1] - way[:, 1] * back[:, 0]
            folded |= same & (np.abs(cross) < 1e-12) & ((way * back).sum(axis=1) > 0.0)
            shared |= same
    wrong = ~shared | folded
    return {owner[k] for k in np.concatenate([one[wrong], other[wrong]]).tolist()}


def _invalid(
    regions: Sequence[Patch], owned_lines: Sequence[tuple[Points, list[int]]]
) -> set[tuple[int, int]]:
    """Return all pieces of the regions that are no longer valid polygons."""
    lines = [line for line, _ in owned_lines]
    pieces: set[tuple[int, int]] = set()
    for region in regions:
        if not _is_sound(region, lines):
            arcs = {i for loop in (region.outline, *region.holes) for i, _ in loop.arcs}
            pieces |= {(i, piece) for i in arcs for piece in owned_lines[i][1]}
    return pieces


def _is_sound(region: Patch, lines: Sequence[Points]) -> bool:
    loops = (region.outline, *region.holes)
    if any(len(loop_points(loop, lines)) < 3 for loop in loops):
        return False
    return bool(_polygon(region, lines).is_valid)


def _polygon(region: Patch, lines: Sequence[Points]) -> shapely.Polygon:
    holes = [loop_points(hole, lines) for hole in region.holes]
    return shapely.Polygon(loop_points(region.outline, lines), holes)


def _between_walls(gap: MapGap, walls: Sequence[shapely.Polygon], frame: _Frame) -> MapGap:
    """Return a gap with its jambs moved to the outlines of the walls beside it."""
    along = gap.along()
    across = np.array([-along[1], along[0]])
    reach = gap.width / 2 + _JAMB_CELLS
    ends = []
    for side in (-1.0, 1.0):
        reaches: list[float] = []
        for share in (-0.25, 0.0, 0.25):
            middle = np.array([gap.x, gap.y]) + share * gap.depth * across
            way = frame.metres(np.array([middle, middle + side * reach * along]))
            line = shapely.LineString(way)
            hits = [line.intersection(wall) for wall in walls if line.intersects(wall)]
            distances = [shapely.Point(way[0]).distance(hit) for hit in hits]
            if distances and min(distances) > 0.0:
                reaches.append(min(distances) / frame.resolution)
        ends.append(side * (float(np.median(reaches)) if reaches else gap.width / 2))
    shift = sum(ends) / 2
    x, y = (np.array([gap.x, gap.y]) + shift * along).tolist()
    return MapGap(x, y, gap.heading, ends[1] - ends[0], gap.depth, gap.walls)


def _parted(
    floors: Sequence[shapely.Polygon], gaps: Sequence[MapGap], frame: _Frame
) -> list[shapely.Polygon]:
    """Return the rooms: the floors without the doorways, in reading order."""
    # Cut as far beyond the jambs as the gap was shut, so that ragged jambs leave no way past it.
    doorways = shapely.union_all(
        [shapely.Polygon(frame.metres(gap.corners(beyond=2.0))) for gap in gaps]
    )
    rooms: list[shapely.Polygon] = []
    for floor in floors:
        rest: shapely.Geometry = floor
        if gaps:
            rest = shapely.set_precision(floor.difference(doorways), 10.0**-_DECIMALS)
        parts = [part for part in getattr(rest, "geoms", [rest]) if part.area > 0.0]
        largest = max(part.area for part in parts)
        # Bits of floor beside jambs are not rooms.
        least = min(largest, (2 * _JAMB_CELLS * frame.resolution) ** 2)
        # The cut at doorways leaves points in the middle of straight walls.
        rooms += [
            part.normalize().simplify(_FLAT) if gaps else part
            for part in parts
            if part.area >= least
        ]
    return _in_order(rooms)


def _in_order(polygons: Iterable[shapely.Polygon]) -> list[shapely.Polygon]:
    """Return polygons in reading order: by their upper edge, to the metre, then from the left."""

    def place(polygon: shapely.Polygon) -> tuple[float, float, float, float]:
        x, low, _, top = polygon.bounds
        return (-float(np.round(top)), x, -top, low)

    return sorted(polygons, key=place)


def _entryways(gaps: Sequence[MapGap], frame: _Frame, height: float) -> dict[str, EntrywayText]:
    """Return the entryways in reading order, each from its left or lower jamb on."""
    placed: list[tuple[Point2, Point2, float]] = []
    for gap in gaps:
        half = gap.along() * gap.width / 2
        middle = np.array([gap.x, gap.y])
        a, b = (tuple(p) for p in frame.metres(np.array([middle - half, middle + half])).tolist())
        start, end = sorted((a, b))
        placed.append(((start[0], start[1]), (end[0], end[1]), gap.depth * frame.resolution))
    placed.sort(key=lambda door: (-round((door[0][1] + door[1][1]) / 2), *door))
    return {
        f"doorway_{k}": EntrywayText.model_construct(
            start=start, end=end, depth=round(depth, _DECIMALS), height=height
        )
        for k, (start, end, depth) in enumerate(placed, 1)
    }


def _middle(line: shapely.LineString) -> Point2:
    middle = line.interpolate(0.5, normalized=True)
    return (round(middle.x, 1), round(middle.y, 1))


def _area(polygon: shapely.Polygon) -> dict[str, Any]:
    """Return the keys of an area."""
    holes = [_ring(hole) for hole in polygon.interiors]
    return {"outline": _ring(polygon.exterior)} | ({"holes": holes} if holes else {})


def _ring(ring: shapely.LinearRing) -> Ring:
    # Adding 0.0 turns -0.0 into 0.0.
    return tuple(
        (round(x, _DECIMALS) + 0.0, round(y, _DECIMALS) + 0.0) for x, y in ring.coords[:-1]
    )
