"""An arc as points that lie on a straight line where the cells were drawn from one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from grammars.maps._borders import Arc, Points


@dataclass(frozen=True, slots=True, eq=False)
class CellTrack:
    """An arc as points that two arcs never share: middles of edges, and true corners.

    ``at`` is where along the arc each point lies, in edges; ``corners`` and ``middles`` are those
    of the arc, twice in a row for a closed one, so that every piece of it is a slice.
    """

    points: Points
    at: npt.NDArray[np.float64]
    corners: Points
    middles: Points

    def passed(self, first: int, last: int) -> tuple[Points, Points]:
        """Return the corners of cells and the middles of edges between two points."""
        low, high = self.at[first], self.at[last]
        corners = self.corners[math.ceil(low) : math.floor(high) + 1]
        return corners, self.middles[math.ceil(low - 0.5) : math.floor(high - 0.5) + 1]


def track_of(arc: Arc) -> CellTrack:
    """Return the points of an arc."""
    corners = arc.corners.astype(np.float64)
    step = np.diff(corners, axis=0)
    edges = len(step)
    middles = corners[:-1] + step / 2
    true = _true_corners(step, arc)
    at = np.sort(np.concatenate([true, np.arange(edges) + 0.5]))
    if arc.closed:
        corners, middles = np.vstack([corners[:-1]] * 2), np.vstack([middles] * 2)
        points = _points_at(at, corners, middles)
        # Cut open at the point furthest from the middle: a true corner, if there is any.
        away = np.hypot(*(points - points.mean(axis=0)).T).round(6)
        first = int(away.argmax())
        at = np.concatenate([at[first:], at[: first + 1] + edges])
    return CellTrack(_points_at(at, corners, middles), at, corners, middles)


def _points_at(at: npt.NDArray[np.float64], corners: Points, middles: Points) -> Points:
    whole = np.floor(at).astype(int)
    half = (at > whole)[:, None]
    found: Points = np.where(half, middles[whole % len(middles)], corners[whole % len(corners)])
    return found


def _true_corners(step: Points, arc: Arc) -> npt.NDArray[np.float64]:
    """Return which corners of cells are no part of a slanting line, and the ends of open arcs.

    True ones have two edges or more on both sides, or belong to a wall or a gap one cell wide.
    """
    edges = len(step)
    before = np.roll(step, 1, axis=0)
    turn = np.sign(before[:, 0] * step[:, 1] - before[:, 1] * step[:, 0])
    if not arc.closed:
        turn[0] = 2.0  # an end, which is no turn to either side
    bends = np.flatnonzero(turn)
    if not len(bends):
        return np.array([0.0, float(edges)])
    ahead = (np.roll(bends, -1) - bends) % edges
    ahead[ahead == 0] = edges
    if not arc.closed:
        ahead[-1] = edges  # up to the other end: however short, it is no step of a slanting line
        ahead[0] = edges
    behind = np.roll(ahead, 1)
    long = (ahead >= 2) & (behind >= 2)
    side = turn[bends]
    about = ((side == np.roll(side, -1)) & (ahead == 1)) | (
        (side == np.roll(side, 1)) & (behind == 1)
    )
    free = ~arc.chequered[bends]
    if arc.closed:
        true: npt.NDArray[np.float64] = bends[(long | about) & free].astype(np.float64)
        return true
    chosen = bends[((long | about) & free) | (bends == 0)]
    return np.append(chosen, edges).astype(np.float64)
