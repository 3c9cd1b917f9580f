"""Walls and rooms among painted lines: two lines enclose a wall, one line is the middle of one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.spatial import KDTree

Line: TypeAlias = npt.NDArray[np.float64]
"""Corners of a line, shape (corners, 2)."""
Cells: TypeAlias = npt.NDArray[np.bool_]
"""Cells of a map, shape (rows, columns)."""

_THICKEST: Final = 0.6
"""Two lines farther apart [m] are two walls."""
_GATES: Final = (1.3, 2.5, 5.0)
"""Widths of openings in the outer wall [m] that end the building: doors, gates of halls."""


def paint_lines(lines: Sequence[Line], shape: tuple[int, int], cell: float) -> Cells:
    """Return the cells under lines given in cells, and under the undrawn ends of walls."""
    cells = np.zeros(shape, dtype=np.bool_)
    for line in (*lines, *_caps(lines, _THICKEST / cell)):
        for start, end in pairwise(line):
            steps = math.ceil(2.0 * math.dist(start, end)) + 1
            x, y = np.linspace(start, end, steps).astype(np.intp).T
            cells[y, x] = True
    return cells


def _caps(lines: Sequence[Line], widest: float) -> Iterator[Line]:
    """Yield the lines that close walls whose two faces end side by side, as at a doorway."""
    ends = np.array([(line[k], line[k] - line[n]) for line in lines for k, n in ((0, 1), (-1, -2))])
    _, place, count = np.unique(
        np.round(ends[:, 0]), axis=0, return_inverse=True, return_counts=True
    )
    loose = ends[count[place.ravel()] == 1]
    ways = loose[:, 1] / np.hypot(*loose[:, 1].T)[:, None]
    pairs = KDTree(loose[:, 0]).query_pairs(widest, output_type="ndarray")
    for a, b in pairs[np.lexsort(pairs.T[::-1])].tolist():
        gap = loose[b, 0] - loose[a, 0]
        # The faces of one wall end in the same direction, hardly one before the other.
        if ways[a] @ ways[b] > 0.98 and abs(ways[a] @ gap) <= 0.2 * math.hypot(*gap):
            yield np.array([loose[a, 0], loose[b, 0]])


def walls_and_rooms(painted: Cells, cell: float, thickness: float) -> tuple[Cells, Cells]:
    """Return the cells of walls, and those of the floor that walls and openings enclose.

    A face between lines is a wall where it is nowhere wider than a wall. Lines beside no such face
    become walls ``thickness`` [m] thick. An opening of the outer wall ends the floor at its jambs.
    """
    faces, count = ndimage.label(~painted)
    half = ndimage.distance_transform_edt(~painted, sampling=cell)
    widest = ndimage.maximum(half, faces, np.arange(count + 1))
    filled = (faces > 0) & (np.asarray(widest) <= _THICKEST / 2)[faces]
    single = painted & ~ndimage.binary_dilation(filled, np.ones((3, 3)), iterations=2)
    walls = painted | filled
    if single.any():
        walls |= ndimage.distance_transform_edt(~single, sampling=cell) <= thickness / 2
    clearance = ndimage.distance_transform_edt(~walls, sampling=cell)
    rooms = np.zeros_like(walls)
    for gate in _GATES:
        rooms |= _inside(walls, clearance, gate / 2 + cell, cell)
    return walls, rooms


def _inside(walls: Cells, clearance: npt.NDArray[np.float64], reach: float, cell: float) -> Cells:
    """Return the floor that a disc of radius ``reach`` [m] cannot enter from outside.

    Where the discs inside and outside of an opening overlap, the nearer side has the floor: the
    border is the line between the jambs.
    """
    wide, _ = ndimage.label(clearance > reach)
    outer, inner = wide == wide[0, 0], (wide > 0) & (wide != wide[0, 0])
    to_outer = ndimage.distance_transform_edt(~outer, sampling=cell)
    outside = ~walls & (to_outer <= reach)
    if inner.any():
        outside &= to_outer <= ndimage.distance_transform_edt(~inner, sampling=cell)
    rest, count = ndimage.label(~walls & ~outside)
    touching = np.unique(rest[ndimage.binary_dilation(outside)])
    is_inside = np.ones(count + 1, dtype=np.bool_)
    is_inside[touching] = False
    is_inside[np.unique(rest[inner])] = True
    is_inside[0] = False
    inside: Cells = is_inside[rest]
    return inside
