"""Map of a scene at the height of the laser, drawn by one of three rules.

``outline``, the default, draws like the published tool for floor plans. It rounds every corner to
its cell and fills the polygon through these cells (:mod:`templates.polygon_cells`). The order is:
spaces *free*, solids *occupied* (walls as if they had no doorways), doorways *free*, and solids in
doorways *occupied*. Walls are drawn as a whole, since corners of their pieces would fall into other
cells. Doorways are widened by a cell on both sides of the wall.

``touch`` and ``centre`` first paint the cells free whose centres lie in spaces and doorways, then
the solids. ``touch`` takes every cell that a solid overlaps, so that a scan that ends on a wall
always ends in an occupied cell. ``centre`` takes cells whose centre lies in a solid. This preserves
areas, but solids thinner than a cell may have holes.

Objects, if drawn, are occupied by any rule. A shut door closes its doorway without a gap by
``touch`` and by ``outline``, which draws objects and the walls beside them by ``touch``.

Other cells are *unknown*: outside of spaces, in holes of spaces without a solid, and in windows,
where the laser meets no wall but no robot can stand.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from grammars.model.geometry import Floats, Ring, turn
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, MapRule, OccupancyGrid
from grammars.model.kinematics import placed_links
from grammars.model.movers import is_mover
from grammars.model.scene import Doorway, Scene, Solid
from templates.polygon_cells import (
    NOISE,
    CellsOf,
    Spans,
    cells_in,
    cells_overlapped,
    centres_inside,
    grown,
    outline_filled,
    outline_of_convex,
    painted,
)

# Corners move by less than a cell and edges by half a cell. Cells that a doorway takes from the
# walls are therefore at most this far from the true end of the wall, which the leaf reaches.
_BESIDE: Final = 2
"""Number of cells beside objects in which solids are drawn by ``touch`` too."""


def occupancy_grid(
    scene: Scene,
    *,
    resolution: float = 0.05,
    laser_height: float,
    margin: float = 1.25,
    rule: MapRule = "outline",
) -> OccupancyGrid:
    """Return the map of ``scene`` without its objects at the height of a laser [m].

    ``resolution`` is the size of a cell [m], ``margin`` the border around the spaces [m]. The
    origin is their lowest corner minus the margin. The map grows by whole cells for solids beyond
    the margin. Raises :class:`ValueError` for an empty scene and sizes that are not positive.
    """
    if not (resolution > 0.0 and math.isfinite(resolution) and margin >= 0.0):
        raise ValueError(f"resolution {resolution} must be positive, margin {margin} not negative")
    solids = _solid_polygons(scene, laser_height)
    doorways = [d for d in scene.doorways if d.z_min <= laser_height <= d.z_max]
    origin, shape = _extent(scene, resolution, margin)

    def covered(cells_of: CellsOf, rings: Sequence[Ring]) -> npt.NDArray[np.bool_]:
        return painted((cells_of((np.array(ring) - origin) / resolution) for ring in rings), shape)

    def floor(cells_of: CellsOf) -> npt.NDArray[np.bool_]:
        total = covered(cells_of, [r.outline for r in scene.regions if not r.holes])
        # One by one, because a hole in one space may be the floor of another.
        for region in scene.regions:
            if region.holes:
                holes = covered(centres_inside, region.holes)
                total |= covered(cells_of, [region.outline]) & ~holes
        return total

    cells: npt.NDArray[np.int8] = np.full(shape, UNKNOWN, dtype=np.int8)
    if rule == "outline":
        cells[floor(outline_filled)] = FREE
        whole = _whole_solids(scene.solids, doorways, laser_height)
        cells[covered(outline_of_convex, whole)] = OCCUPIED
        cells[covered(outline_of_convex, [_widened(d, resolution) for d in doorways])] = FREE
        cells[covered(outline_of_convex, _standing_in(doorways, solids))] = OCCUPIED
    else:
        passages = [d.footprint for d in doorways]
        cells[floor(centres_inside) | covered(centres_inside, passages)] = FREE
        cells[covered(cells_overlapped if rule == "touch" else centres_inside, solids)] = OCCUPIED
    return OccupancyGrid(resolution, float(origin[0]), float(origin[1]), cells)


def with_objects(
    building: OccupancyGrid,
    scene: Scene,
    *,
    laser_height: float,
    joints: Mapping[str, float],
    rule: MapRule = "outline",
) -> OccupancyGrid:
    """Return a map of :func:`occupancy_grid` with the objects, drawn with the same settings.

    ``joints`` are positions by scene-wide name [rad or m]; other joints are at their start. Movers
    are never drawn.
    """
    objects = _object_polygons(scene, laser_height, joints)
    cells = building.cells.copy()
    rows, columns = cells.shape
    shape, origin = (rows, columns), np.array((building.x, building.y))

    def spans_of(cells_of: CellsOf, rings: Sequence[Ring]) -> Spans:
        parts = [cells_of((np.array(ring) - origin) / building.resolution) for ring in rings]
        return np.concatenate([np.zeros((0, 3), dtype=np.intp), *parts])

    leaves = spans_of(centres_inside if rule == "centre" else cells_overlapped, objects)
    cells.reshape(-1)[cells_in(leaves, shape)] = OCCUPIED
    if rule == "outline":
        # There are many solids, and few of them stand beside an object.
        solids = _beside(_solid_polygons(scene, laser_height), objects, building.resolution)
        beside = cells_in(grown(leaves, shape, _BESIDE), shape)
        touched = cells_in(spans_of(cells_overlapped, solids), shape)
        cells.reshape(-1)[np.intersect1d(beside, touched)] = OCCUPIED
    return OccupancyGrid(building.resolution, building.x, building.y, cells)


def _extent(scene: Scene, resolution: float, margin: float) -> tuple[Floats, tuple[int, int]]:
    """Return the lower left corner of the map [m] and its rows and columns."""
    outlines = [r.outline for r in scene.regions]
    everything = outlines + [s.polygon for s in scene.solids]
    if not everything:
        raise ValueError(f"scene {scene.name} has neither regions nor solids")
    # As in the published tool (scenery_builder, OccupancyGrid): the corners of the spaces, a border
    # of 50 cells of 5 cm, half of it on each side, and no rounding to whole cells.
    inner = _corners(outlines or everything)
    origin = inner.min(axis=0) - margin
    size = np.floor((np.ptp(inner, axis=0) + 2 * margin) / resolution + NOISE)
    outer = (_corners(everything) - origin) / resolution
    low = np.maximum(np.ceil(-outer.min(axis=0) - NOISE), 0.0)
    high = np.maximum(np.floor(outer.max(axis=0) + NOISE) + 1 - size, 0.0)
    columns, rows = (size + low + high).astype(int).tolist()
    return origin - low * resolution, (rows, columns)


def _corners(rings: Sequence[Ring]) -> Floats:
    return np.array([corner for ring in rings for corner in ring])


def _solid_polygons(scene: Scene, height: float) -> list[Ring]:
    # Both ends count, unlike in pictures (grammars.model.kinematics): a solid that only touches
    # the plane of the laser overlaps it.
    return [s.polygon for s in scene.solids if s.z_min <= height <= s.z_max]


def _beside(solids: Sequence[Ring], objects: Sequence[Ring], resolution: float) -> list[Ring]:
    """Return at least the solids with cells beside cells of an object."""
    if not (solids and objects):
        return []
    # One cell more, for cells in which an edge only begins; twice as far, for diagonals.
    reach = 2.0 * (_BESIDE + 1) * resolution
    tree = shapely.STRtree(_polygons(solids))
    near = tree.query(_polygons(objects), predicate="dwithin", distance=reach)[1]
    return [solids[index] for index in np.unique(near).tolist()]


def _object_polygons(scene: Scene, height: float, joints: Mapping[str, float]) -> list[Ring]:
    rings: list[Ring] = []
    for thing in scene.objects:
        if is_mover(thing.joints):
            continue
        for link, placed in placed_links(thing, joints):
            if link.z_min <= height <= link.z_max:
                rings += placed
    return rings


_Polygons: TypeAlias = npt.NDArray[np.object_]
_OVERLAP: Final = 1e-6
"""Common area up to which an overlap of polygons is a rounding error [m²]."""
_OFF_LINE: Final = 1e-6
"""Distance of a true corner from the line between its neighbours [m]."""


def _whole_solids(
    solids: Iterable[Solid], doorways: Sequence[Doorway], height: float
) -> list[Ring]:
    """Return the outlines of solids at ``height`` [m], walls as if they had no doorways.

    A wall with a window at that height stays in pieces, since only doorways are freed later.
    """
    passages = _polygons([doorway.footprint for doorway in doorways])
    rings: list[Ring] = []
    for _, pieces in itertools.groupby(solids, key=lambda solid: solid.owner):
        rings += _whole(list(pieces), passages, height)
    return rings


def _whole(pieces: list[Solid], passages: _Polygons, height: float) -> list[Ring]:
    standing = [s.polygon for s in pieces if s.z_min <= height <= s.z_max]
    if not standing or pieces[0].kind != "wall":
        return standing
    hull = shapely.MultiPoint([corner for s in pieces for corner in s.polygon]).convex_hull
    near = passages[shapely.intersects(passages, hull)]
    filled = shapely.union_all(np.concatenate([_polygons(standing), near]))
    if shapely.area(shapely.difference(hull, filled)) > _OVERLAP:
        return standing
    return [_true_corners(shapely.get_coordinates(hull)[:-1].tolist())]


def _true_corners(ring: Sequence[tuple[float, float]]) -> Ring:
    """Return a ring without repeated corners and without corners in the middle of an edge."""
    apart = [b for a, b in _pairs(ring) if math.dist(a, b) > _OFF_LINE]
    return tuple(
        b
        for (a, b), (_, c) in zip(_pairs(apart), _pairs([*apart[1:], apart[0]]), strict=True)
        if abs(turn(a, b, c)) > _OFF_LINE * math.dist(a, c)
    )


def _pairs(ring: Sequence[tuple[float, float]]) -> list[tuple[tuple[float, float], ...]]:
    """Return every corner with its predecessor."""
    return [(ring[k - 1], ring[k]) for k in range(len(ring))]


def _widened(doorway: Doorway, by: float) -> Ring:
    """Return a doorway's footprint, longer by ``by`` [m] on both sides of its wall."""
    to_local = doorway.frame.inverse()
    local = np.array([to_local.apply(corner) for corner in doorway.footprint])
    local[:, 1] += by * np.sign(local[:, 1] - local[:, 1].mean())
    return tuple(doorway.frame.apply((float(x), float(y))) for x, y in local)


def _standing_in(doorways: Sequence[Doorway], solids: Sequence[Ring]) -> list[Ring]:
    """Return the solids in a doorway: columns, and walls without a cut."""
    passages = _polygons([doorway.footprint for doorway in doorways])
    return [
        ring
        for ring, solid in zip(solids, _polygons(solids), strict=True)
        if (shapely.area(shapely.intersection(passages, solid)) > _OVERLAP).any()
    ]


def _polygons(rings: Sequence[Ring]) -> _Polygons:
    # shapely would read an empty list as an array of numbers.
    polygons = np.empty(len(rings), dtype=object)
    polygons[:] = [shapely.Polygon(ring) for ring in rings]
    return polygons
