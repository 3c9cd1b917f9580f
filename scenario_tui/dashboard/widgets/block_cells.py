"""Filled areas in terminal cells: masks of small squares, and the block characters that show them.

A cell is split into 2 x 2 quadrants.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Floats
from scenario_tui.dashboard.widgets.cell_view import DOT_BITS, Cells, Codes, points_along

Mask = npt.NDArray[np.bool_]
_QUADRANTS: Final = np.array([*map(ord, " ▘▝▀▖▌▞▛▗▚▐▜▄▙▟█")], dtype=np.int32)
"""The block for each sum of the squares in it."""
_SQUARES: Final = np.array([[1, 2], [4, 8]])


def fill_areas(edges: Floats, width: int, height: int) -> Mask:
    """Return the squares (height, width) whose middle lies in an area.

    ``edges`` (n, 4) are x0, y0, x1, y1 of closed rings, in squares from the upper left corner. All
    rings turn the same way around, and the union of them is filled.
    """
    x0, y0, x1, y1 = edges.T
    down = np.where(y1 > y0, 1, -1)
    top = np.ceil(np.minimum(y0, y1) - 0.5).clip(0, height).astype(np.int64)
    end = np.ceil(np.maximum(y0, y1) - 0.5).clip(0, height).astype(np.int64)
    # One crossing for every row of middles that an edge goes through.
    count = end - top
    edge = np.repeat(np.arange(len(edges)), count)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count - top, count)
    slope = (x1 - x0)[edge] / (y1 - y0)[edge]
    at = x0[edge] + (row + 0.5 - y0[edge]) * slope
    column = np.ceil(at - 0.5).clip(0, width).astype(np.int64)
    turns = np.zeros((height, width + 1), dtype=np.int16)
    np.add.at(turns, (row, column), down[edge].astype(np.int16))
    inside: Mask = np.cumsum(turns[:, :width], axis=1, dtype=np.int16) != 0
    return inside


def area_dots(edges: Floats, columns: int, rows: int) -> Cells:
    """Return the braille dots (rows, columns) in the areas whose ``edges`` (n, 4) are in dots."""
    # Dots are counted from their middles.
    return mask_dots(fill_areas(edges + 0.5, 2 * columns, 4 * rows))


def draw_strokes(mask: Mask, lines: Floats) -> None:
    """Set the squares along straight lines (n, 4) as x0, y0, x1, y1, one square thick."""
    height, width = mask.shape
    low, high = np.minimum(lines[:, :2], lines[:, 2:]), np.maximum(lines[:, :2], lines[:, 2:])
    # In a zoomed map most lines are off the screen.
    lines = lines[np.all((high >= 0) & (low <= (width, height)), axis=1)]
    x, y = np.floor(points_along(lines)).astype(np.int64).T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    mask[y[inside], x[inside]] = True


def ring_edges(rings: Sequence[Floats]) -> Floats:
    """Return the edges (n, 4) of closed rings, each (k, 2), all turned the same way around."""
    if not rings:
        return np.empty((0, 4))
    points, lengths = np.vstack(rings), np.array([len(ring) for ring in rings])
    ends = np.cumsum(lengths)
    following = np.arange(1, len(points) + 1)
    following[ends - 1] = ends - lengths
    after = points[following]
    areas = np.add.reduceat(points[:, 0] * after[:, 1] - after[:, 0] * points[:, 1], ends - lengths)
    back = np.repeat(areas < 0.0, lengths)[:, None]
    return np.hstack([np.where(back, after, points), np.where(back, points, after)])


def middle_line(ring: Floats) -> Floats:
    """Return the line (4,) along the middle of a convex ring (k, 2), in its longest direction."""
    after = np.roll(ring, -1, axis=0)
    lengths = np.hypot(*(after - ring).T)
    longest = int(np.argmax(lengths))
    along = (after - ring)[longest] / max(float(lengths[longest]), 1e-12)
    across = np.array([-along[1], along[0]])
    reach, breadth = ring @ along, ring @ across
    middle = (breadth.min() + breadth.max()) / 2.0
    off, next_off = breadth - middle, np.roll(breadth, -1) - middle
    # It ends at the ring, because walls are cut at an angle where they meet.
    crossing = off * next_off < 0.0
    ways = (np.roll(reach, -1) - reach)[crossing]
    at = reach[crossing] + off[crossing] / (off - next_off)[crossing] * ways
    at = at if len(at) > 1 else reach
    ends: Floats = np.concatenate([end * along + middle * across for end in (at.min(), at.max())])
    return ends


def mask_blocks(mask: Mask) -> Codes:
    """Return a mask of squares (2 x rows, 2 x columns) as block characters of cells."""
    squares = mask.reshape(mask.shape[0] // 2, 2, mask.shape[1] // 2, 2)
    codes: Codes = _QUADRANTS[np.einsum("rhcw,hw->rc", squares, _SQUARES)]
    return codes


def mask_dots(mask: Mask) -> Cells:
    """Return a mask of dots (4 x rows, 2 x columns) as braille dots of cells."""
    squares = mask.reshape(mask.shape[0] // 4, 4, mask.shape[1] // 2, 2)
    dots: Cells = np.einsum("rhcw,hw->rc", squares, DOT_BITS)
    return dots
