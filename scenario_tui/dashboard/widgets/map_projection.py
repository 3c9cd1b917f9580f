"""Projection of a map to the dots of a canvas; a building has one orientation in every pane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from grammars.model.geometry import Floats, Point2

_STRAIGHT: Final = math.radians(1.0)
"""Largest angle of walls that count as straight; such a map is not turned."""
_UPRIGHT: Final = 2.0
"""Ratio of height to width from which on a straight map is laid down, because screens are wide."""
_BINS: Final = 90
"""Bins for the directions of walls, a degree each; all four sides of a room fall into one."""
_NEAR: Final = math.radians(2.0)
_FARTHEST: Final = 1e9
"""Largest distance from the origin of a map [m]; an estimate may lie anywhere."""
_OUTMOST: Final = 2e4
"""Largest coordinate [dots]; a line beyond it is cut."""


@dataclass(frozen=True, slots=True)
class MapProjection:
    """Dots (x to the right, y down) of points: ``middle`` [m] lies on the dot ``centre``.

    ``turn`` [rad] is the turn of the map to the left on the screen, ``scale`` the dots per metre.
    Dots are about square: a cell is twice as high as wide, and has four dots by two.
    """

    middle: Point2
    centre: Point2
    scale: float
    turn: float = 0.0

    def dots(self, points: Floats) -> Floats:
        """Return points (n, 2) [m] as dots (n, 2), cut far outside of any screen."""
        ways = (np.clip(points, -_FARTHEST, _FARTHEST) - self.middle) @ _rotation(self.turn)
        dots: Floats = self.centre + ways * (self.scale, -self.scale)
        return dots.clip(-_OUTMOST, _OUTMOST)

    def metres(self, right: float, up: float) -> Point2:
        """Return a vector on the screen, in dots, as a vector on the map [m]."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        return ((c * right + s * up) / self.scale, (c * up - s * right) / self.scale)


def cell_of(x: float, y: float) -> tuple[int, int]:
    """Return the row and column of the cell that holds a dot, given by its middle."""
    return math.floor((y + 0.5) / 4), math.floor((x + 0.5) / 2)


def map_turn(axis: float, corners: Floats) -> float:
    """Return the turn of a map to the left [rad] that makes its walls straight on the screen.

    ``axis`` [rad] is the direction of most walls, ``corners`` (n, 2) [m] are those of the building.
    A straight map is not turned; a turned one lies on its longer side.
    """
    turn = -axis if abs(axis) > _STRAIGHT else 0.0
    width, height = np.ptp(corners @ _rotation(turn), axis=0).tolist()
    if height > width * (1.0 if turn else _UPRIGHT):
        turn -= math.copysign(math.pi / 2, turn or -1.0)
    return turn


def fit(points: Floats, turn: float, width: int, height: int) -> MapProjection:
    """Return the projection of all ``points`` (n, 2) [m] to ``width`` x ``height`` dots."""
    rotation = _rotation(turn)
    turned = points @ rotation
    low, high = turned.min(axis=0), turned.max(axis=0)
    extent = np.maximum(high - low, 0.1)
    scale = float(min((width - 1) / extent[0], (height - 1) / extent[1]))
    x, y = (rotation @ (low + high) / 2).tolist()
    return MapProjection((x, y), ((width - 1) / 2, (height - 1) / 2), scale, turn)


def _rotation(turn: float) -> Floats:
    """Return the matrix (2, 2) that turns rows of points to the left."""
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, s], [-s, c]])


def main_axis(edges: Floats) -> float:
    """Return the direction [rad, -pi/4 to pi/4] that most walls are parallel or square to.

    ``edges`` (n, 4) [m] are x0, y0, x1, y1.
    """
    ways = edges[:, 2:] - edges[:, :2]
    lengths = np.hypot(*ways.T)
    angles = np.arctan2(ways[:, 1], ways[:, 0]) % (math.pi / 2)
    if not lengths.any():
        return 0.0
    # By bins, because the mean of all directions would be wrong for a building with a skewed wing.
    bins = np.rint(np.degrees(angles)).astype(np.int64) % _BINS
    counts = np.bincount(bins, lengths, minlength=_BINS)
    # A bin with its neighbours, because walls at a half degree fall into two.
    around = counts + np.roll(counts, 1) + np.roll(counts, -1)
    peak = math.radians(int(np.argmax(around)))
    off = (angles - peak + math.pi / 4) % (math.pi / 2) - math.pi / 4
    near = np.abs(off) <= _NEAR
    axis = peak + float(np.average(off[near], weights=lengths[near]))
    return math.remainder(axis, math.pi / 2)
