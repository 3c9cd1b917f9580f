"""The map of a scene at the height of the laser, drawn by one of three rules.

``outline`` draws as the published tool for floor plans does, and is the default. Every corner is
put into the cell it lies in, and what lies in or on the polygon through these cells is filled
(:mod:`templates.polygon_cells`). Painted in this order: spaces are *free*, solids *occupied* (walls
as if they had no doorways), doorways *free* and solids that stand in a doorway *occupied*.

``touch`` and ``centre`` paint spaces and doorways free where they hold the centre of a cell, then
the solids: ``touch`` takes each cell that a solid overlaps, however little, so that a scan that
ends on a wall always ends in an occupied cell; ``centre`` takes those whose centre lies in a solid,
which keeps areas, but what is thinner than a cell may have holes.

Objects, if they are drawn, are occupied by any rule. A door that is shut closes its doorway without
a gap under ``touch`` and under ``outline``, which draws it, and the walls beside it, by ``touch``.

What nobody painted is *unknown*: outside, inside nothing, where the centre of a cell lies in a hole
of a space (by any rule, unless a solid stands there), and in windows the laser looks through
(it meets no wall there, yet no robot can stand there).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Floats, Point2, Ring
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, MapRule, OccupancyGrid
from grammars.model.kinematics import placed_links
from grammars.model.movers import is_mover
from grammars.model.scene import Scene
from grammars.text.diagnostics import did_you_mean
from templates.outline_parts import standing_in, whole_solids, widened
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

# A corner is moved by less than a cell and an edge drawn half a cell beside its line, so no cell
# that a doorway takes from the walls lies further from their true end, which the leaf reaches.
_BESIDE: Final = 2
"""How many cells beside drawn objects solids are drawn by ``touch`` too."""


def occupancy_grid(
    scene: Scene,
    *,
    resolution: float = 0.05,
    laser_height: float,
    joints: Mapping[str, float] | None = None,
    margin: float = 1.25,
    rule: MapRule = "outline",
) -> OccupancyGrid:
    """Return the map of ``scene`` as a laser at ``laser_height`` [m] would draw it.

    ``resolution`` is the size of a cell and ``margin`` what is added around the spaces [m]: the
    origin is their lowest corner less the margin. Where more than the margin stands out the map is
    larger by whole cells. Without ``joints`` objects are left out; otherwise they are drawn with
    these positions by scene-wide name [rad or m], others at their initial ones. Movers are never
    drawn: a map shows what stands, not who passes by.

    Raises :class:`ValueError` for an empty scene, sizes that are not positive and unknown joints.
    """
    building = building_grid(
        scene, resolution=resolution, laser_height=laser_height, margin=margin, rule=rule
    )
    if joints is None:
        return building
    return with_objects(building, scene, laser_height=laser_height, joints=joints, rule=rule)


def building_grid(
    scene: Scene,
    *,
    resolution: float,
    laser_height: float,
    margin: float = 1.25,
    rule: MapRule = "outline",
) -> OccupancyGrid:
    """Return the map of ``scene`` without its objects; see :func:`occupancy_grid`."""
    if not (resolution > 0.0 and math.isfinite(resolution) and margin >= 0.0):
        raise ValueError(f"resolution {resolution} must be positive, margin {margin} not negative")
    solids = _solid_polygons(scene, laser_height)
    doorways = [d for d in scene.doorways if d.z_min <= laser_height <= d.z_max]
    origin, shape = _extent(scene, resolution, margin)

    def taken(cells_of: CellsOf, rings: Sequence[Ring]) -> npt.NDArray[np.bool_]:
        return painted((cells_of((np.array(ring) - origin) / resolution) for ring in rings), shape)

    def floor(cells_of: CellsOf) -> npt.NDArray[np.bool_]:
        found = taken(cells_of, [r.outline for r in scene.regions if not r.holes])
        # One by one: what is a hole in one space may be the floor of another.
        for region in scene.regions:
            if region.holes:
                found |= taken(cells_of, [region.outline]) & ~taken(centres_inside, region.holes)
        return found

    cells: npt.NDArray[np.int8] = np.full(shape, UNKNOWN, dtype=np.int8)
    if rule == "outline":
        cells[floor(outline_filled)] = FREE
        whole = whole_solids(scene.solids, doorways, laser_height)
        cells[taken(outline_of_convex, whole)] = OCCUPIED
        cells[taken(outline_of_convex, [widened(d, resolution) for d in doorways])] = FREE
        cells[taken(outline_of_convex, standing_in(doorways, solids))] = OCCUPIED
    else:
        passages = [d.footprint for d in doorways]
        cells[floor(centres_inside) | taken(centres_inside, passages)] = FREE
        cells[taken(cells_overlapped if rule == "touch" else centres_inside, solids)] = OCCUPIED
    return OccupancyGrid(resolution, float(origin[0]), float(origin[1]), cells)


def with_objects(
    building: OccupancyGrid,
    scene: Scene,
    *,
    laser_height: float,
    joints: Mapping[str, float],
    rule: MapRule = "outline",
) -> OccupancyGrid:
    """Return a map of :func:`building_grid`, made with the same values, with the objects in it.

    ``joints`` are positions by scene-wide name [rad or m]. Raises :class:`ValueError` for unknown
    joints.
    """
    objects = _object_polygons(scene, laser_height, joints)
    cells = building.cells.copy()
    rows, columns = cells.shape
    shape, origin = (rows, columns), np.array((building.x, building.y))

    def taken(cells_of: CellsOf, rings: Sequence[Ring]) -> Spans:
        parts = [cells_of((np.array(ring) - origin) / building.resolution) for ring in rings]
        return np.concatenate([np.zeros((0, 3), dtype=np.intp), *parts])

    leaves = taken(centres_inside if rule == "centre" else cells_overlapped, objects)
    cells.reshape(-1)[cells_in(leaves, shape)] = OCCUPIED
    if rule == "outline":
        # There are many solids, and few of them stand beside an object.
        solids = _beside(_solid_polygons(scene, laser_height), objects, building.resolution)
        beside = cells_in(grown(leaves, shape, _BESIDE), shape)
        touched = cells_in(taken(cells_overlapped, solids), shape)
        cells.reshape(-1)[np.intersect1d(beside, touched)] = OCCUPIED
    return OccupancyGrid(building.resolution, building.x, building.y, cells)


def _extent(scene: Scene, resolution: float, margin: float) -> tuple[Floats, tuple[int, int]]:
    """Return the lower left corner of the map [m] and its rows and columns."""
    outlines = [r.outline for r in scene.regions]
    everything = outlines + [s.polygon for s in scene.solids]
    if not everything:
        raise ValueError(f"scene {scene.name} has neither regions nor solids")
    # As the published tool has it (scenery_builder, OccupancyGrid): the corners of the spaces, a
    # border of 50 cells of 5 cm, half of it on each side, and no rounding to whole cells.
    inner = _corners(outlines or everything)
    origin = inner.min(axis=0) - margin
    size = np.floor((np.ptp(inner, axis=0) + 2 * margin) / resolution + NOISE)
    outer = (_corners(everything) - origin) / resolution
    before = np.maximum(np.ceil(-outer.min(axis=0) - NOISE), 0.0)
    after = np.maximum(np.floor(outer.max(axis=0) + NOISE) + 1 - size, 0.0)
    columns, rows = (size + before + after).astype(int).tolist()
    return origin - before * resolution, (rows, columns)


def _corners(rings: Sequence[Ring]) -> Floats:
    return np.array([corner for ring in rings for corner in ring])


def _solid_polygons(scene: Scene, height: float) -> list[Ring]:
    # Both ends count, unlike in pictures (grammars.model.kinematics): what only touches the
    # plane of the laser overlaps it, however little.
    return [s.polygon for s in scene.solids if s.z_min <= height <= s.z_max]


def _beside(solids: Sequence[Ring], objects: Sequence[Ring], resolution: float) -> list[Ring]:
    """Return the solids of which cells may lie beside cells of an object, and some others."""
    if not (solids and objects):
        return []
    # A cell more, for those in which an edge only begins.
    reach = (_BESIDE + 1) * resolution
    low, high = (np.array([bound(ring) for ring in solids]) for bound in (_lowest, _highest))
    lower, upper = (np.array([bound(ring) for ring in objects]) for bound in (_lowest, _highest))
    apart: npt.NDArray[np.bool_] = (low[:, None] > upper + reach) | (high[:, None] < lower - reach)
    near = np.flatnonzero(np.any(~np.any(apart, axis=2), axis=1))
    return [solids[index] for index in near.tolist()]


def _lowest(ring: Ring) -> Point2:
    return min(x for x, _ in ring), min(y for _, y in ring)


def _highest(ring: Ring) -> Point2:
    return max(x for x, _ in ring), max(y for _, y in ring)


def _object_polygons(scene: Scene, height: float, joints: Mapping[str, float]) -> list[Ring]:
    known = scene.joint_names
    for name in joints:
        if name not in known:
            raise ValueError(f'unknown joint "{name}"; {did_you_mean(name, known)}')
    rings: list[Ring] = []
    for thing in scene.objects:
        if is_mover(thing.joints):
            continue
        for link, placed in placed_links(thing, joints):
            if link.z_min <= height <= link.z_max:
                rings += placed
    return rings
