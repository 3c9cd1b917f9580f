"""The map of a scene at the height of the laser.

Rule for a cell, in this order:

1. *occupied* when a solid (or, if objects are drawn, a link) at laser height overlaps it, however
   little; so even a leaf thinner than a cell leaves an unbroken line, and the cell in which a scan
   ends on a wall is always an occupied one;
2. *free* when its centre lies in a space or in the footprint of a doorway at laser height;
3. *unknown* otherwise: outside, inside nothing, and in windows the laser looks through (it meets
   no wall there, yet no robot can stand there).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Floats, Ring
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.model.kinematics import placed_links
from grammars.model.movers import is_mover
from grammars.model.scene import Scene
from grammars.text.diagnostics import did_you_mean

# Corners are rounded to nanometres, a cell is some centimetres: anything below is no overlap.
_NOISE: Final = 1e-6
"""Overlaps smaller than this part of a cell are rounding errors."""

_Spans: TypeAlias = npt.NDArray[np.intp]
"""Runs of cells, shape (n, 3): row, first column, last column."""


def occupancy_grid(
    scene: Scene,
    *,
    resolution: float = 0.05,
    laser_height: float,
    joints: Mapping[str, float] | None = None,
    margin: float = 1.25,
) -> OccupancyGrid:
    """Return the map of ``scene`` as a laser at ``laser_height`` [m] would draw it.

    ``resolution`` is the size of a cell and ``margin`` what is added around the building [m]; the
    origin is a multiple of the resolution. Without ``joints`` objects are left out; otherwise they
    are drawn with these positions by scene-wide name [rad or m], others at their initial ones.
    Movers are never drawn: a map shows what stands, not who passes by.

    Raises :class:`ValueError` for an empty scene, sizes that are not positive and unknown joints.
    """
    if not (resolution > 0.0 and math.isfinite(resolution) and margin >= 0.0):
        raise ValueError(f"resolution {resolution} must be positive, margin {margin} not negative")
    everything = [r.outline for r in scene.regions] + [s.polygon for s in scene.solids]
    if not everything:
        raise ValueError(f"scene {scene.name} has neither regions nor solids")
    corners = np.array([corner for ring in everything for corner in ring])
    # The margin of the published maps: a border of 50 cells of 5 cm, half of it on each side.
    first: Floats = np.floor((corners.min(axis=0) - margin) / resolution)
    last: Floats = np.ceil((corners.max(axis=0) + margin) / resolution)
    shape = (int(last[1] - first[1]), int(last[0] - first[0]))
    origin = first * resolution

    # Both ends count, unlike in pictures (grammars.model.kinematics): what only touches the
    # plane of the laser overlaps it, however little (rule 1).
    solid = [s.polygon for s in scene.solids if s.z_min <= laser_height <= s.z_max]
    if joints is not None:
        solid += _object_polygons(scene, laser_height, joints)
    open_floor = [r.outline for r in scene.regions]
    open_floor += [d.footprint for d in scene.doorways if d.z_min <= laser_height <= d.z_max]

    cells: npt.NDArray[np.int8] = np.full(shape, UNKNOWN, dtype=np.int8)
    to_cells = [(np.array(ring) - origin) / resolution for ring in open_floor]
    cells[_painted(map(_centres_inside, to_cells), shape)] = FREE
    to_cells = [(np.array(ring) - origin) / resolution for ring in solid]
    cells[_painted(map(_cells_overlapped, to_cells), shape)] = OCCUPIED
    return OccupancyGrid(resolution, float(origin[0]), float(origin[1]), cells)


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


def _cells_overlapped(ring: Floats) -> _Spans:
    """Return the cells a convex polygon overlaps; ``ring`` (n, 2) in cells from the origin.

    A row of cells cuts a convex polygon to a convex piece, so the cells it overlaps there are
    those between the ends of the piece: the ends of the edges clipped to the row.
    """
    low, high = _rows(ring[:, 1])
    row = np.arange(low, high + 1)[:, None]
    start, end = ring, np.roll(ring, -1, axis=0)
    bottom = np.minimum(start[:, 1], end[:, 1])
    top = np.maximum(start[:, 1], end[:, 1])
    slanted = top > bottom
    slope = np.zeros(len(ring))
    np.divide(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1], out=slope, where=slanted)
    in_row = slanted & (bottom < row + 1) & (top > row)
    lower = start[:, 0] + slope * (np.clip(row, bottom, top) - start[:, 1])
    upper = start[:, 0] + slope * (np.clip(row + 1, bottom, top) - start[:, 1])
    left = np.where(in_row, np.minimum(lower, upper), np.inf).min(axis=1)
    right = np.where(in_row, np.maximum(lower, upper), -np.inf).max(axis=1)
    met = right >= left
    return _spans(row[met, 0], np.floor(left[met] + _NOISE), np.ceil(right[met] - _NOISE) - 1)


def _centres_inside(ring: Floats) -> _Spans:
    """Return the cells whose centre lies in or on a simple polygon (``ring`` in cells).

    Every row is scanned a little below and above its centre line, so that polygons that share an
    edge leave no gap between them.
    """
    low, high = _rows(ring[:, 1])
    row = np.arange(low, high + 1)
    centre = row.astype(np.float64) + 0.5
    return np.concatenate([_scan(ring, row, centre + nudge) for nudge in (-_NOISE, _NOISE)])


def _scan(ring: Floats, row: npt.NDArray[np.intp], y: Floats) -> _Spans:
    """Return the spans between pairs of crossings of the lines ``y`` (even-odd rule)."""
    start, end = ring, np.roll(ring, -1, axis=0)
    line = y[:, None]
    crossed = (start[:, 1] <= line) != (end[:, 1] <= line)
    at_row, edge = np.nonzero(crossed)
    a, b = start[edge], end[edge]
    x = a[:, 0] + (y[at_row] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    order = np.lexsort((x, at_row))
    x, at_row = x[order], at_row[order]
    first = np.ceil(x[0::2] - 0.5 - _NOISE)
    last = np.floor(x[1::2] - 0.5 + _NOISE)
    return _spans(row[at_row[0::2]], first, last)


def _rows(y: Floats) -> tuple[int, int]:
    return math.floor(y.min() + _NOISE), math.ceil(y.max() - _NOISE) - 1


def _spans(row: npt.NDArray[np.intp], first: Floats, last: Floats) -> _Spans:
    filled = last >= first
    columns = (row[filled], first[filled], last[filled])
    return np.stack(columns, axis=1).astype(np.intp)


def _painted(parts: Iterable[_Spans], shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return which cells lie in any span: runs are opened and closed, then summed along rows."""
    rows, columns = shape
    change = np.zeros((rows, columns + 1), dtype=np.int32)
    for part in parts:
        row, first, last = part[(part[:, 0] >= 0) & (part[:, 0] < rows)].T
        first, last = np.maximum(first, 0), np.minimum(last, columns - 1)
        seen = first <= last
        np.add.at(change, (row[seen], first[seen]), 1)
        np.add.at(change, (row[seen], last[seen] + 1), -1)
    inside: npt.NDArray[np.bool_] = change.cumsum(axis=1, dtype=np.int32)[:, :-1] > 0
    return inside
