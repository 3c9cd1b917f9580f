"""Approximation of borders of cells by few straight lines, within a tolerance.

The algorithm of Douglas and Peucker cuts an arc into pieces. A line is fitted to the middles of the
cells' edges of each piece. It turns to a main direction of the building if that moves it only
little. Successive pieces in one direction become one while all corners of cells stay within the
tolerance. Crossings of the lines are the new corners. A piece too far from its cells is drawn more
closely, in the end along the cells (:class:`Closeness`). All lengths are in cells.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from grammars.maps._borders import Arc, CellTrack, Points, track_of

_CUT_CORNER: Final = 0.36
"""Distance of a cell's corner from the line through the middles of its edges, rounded up."""
_PARALLEL: Final = 0.25
"""Sine of the angle (about 15 degrees) up to which two lines count as parallel."""
_SAME_LINE: Final = 0.05
"""Largest distance between parallel lines that meet in one point."""
_TURNED: Final = 0.8
"""Largest shift of the ends of a piece by a turn to a main direction."""
_MOST_TURN: Final = math.radians(25.0)
_ON_LINE: Final = 0.3
"""Largest distance from the end of an open arc to the line that begins there."""
_STRAIGHT: Final = 0.75
"""Distance of cells' corners from a line drawn in cells: slightly more than half a diagonal."""
_FITTED_FROM: Final = 3
"""Least number of edges to which a line is fitted."""


class Closeness(IntEnum):
    """Degree to which a piece of a border follows its cells."""

    MAIN_DIRECTION = 0
    FITTED = 1
    CHORD = 2
    CELLS = 3


@dataclass(slots=True)
class _Piece:
    """Part of a track between two of its points, with its closeness and its line."""

    first: int
    last: int
    closeness: Closeness
    origin: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    along: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))


@dataclass(slots=True)
class StraightArc:
    """Arc made of straight pieces, which may be drawn more closely step by step."""

    track: CellTrack
    closed: bool
    tolerance: float
    pieces: list[_Piece]
    cuts: list[int]
    directions: tuple[float, ...] = ()

    @classmethod
    def of(cls, arc: Arc, tolerance: float) -> StraightArc:
        """Cut an arc into pieces whose chords stay within ``tolerance`` [cells]."""
        track = track_of(arc)
        simpler = shapely.LineString(track.points).simplify(
            max(tolerance - _CUT_CORNER, 0.05), preserve_topology=False
        )
        cuts = _positions(track.points, shapely.get_coordinates(simpler))
        closeness = Closeness.CHORD
        if arc.closed and len(cuts) < 4:
            cuts, closeness = [0, len(track.points) - 1], Closeness.CELLS
        pieces = [_Piece(a, b, closeness) for a, b in pairwise(cuts)]
        straight = cls(track, arc.closed, tolerance, pieces, cuts)
        straight._join_cuts()
        return straight

    def chords(self) -> Points:
        """Return the vectors from cut to cut."""
        cuts = [piece.first for piece in self.pieces] + [self.pieces[-1].last]
        return np.diff(self.track.points[cuts], axis=0)

    def straighten(self, directions: tuple[float, ...]) -> None:
        """Turn lines to main ``directions`` [rad, each modulo a right angle]."""
        self.directions = directions
        for piece in self.pieces:
            if piece.closeness is Closeness.CHORD:
                piece.closeness = Closeness.MAIN_DIRECTION
                self._fit(piece)
        self._join_runs()

    def draw_closer(self, indices: Iterable[int]) -> bool:
        """Draw some pieces a step more closely; return whether any piece changed.

        Indices of pieces may change.
        """
        closer = False
        for index in sorted(set(indices), reverse=True):
            piece = self.pieces[index]
            if piece.closeness is Closeness.CELLS:
                continue
            closer = True
            piece.closeness = Closeness(piece.closeness + 1)
            if piece.closeness is Closeness.CHORD:
                # One line is too coarse: restore the cuts that it joined.
                low, high = bisect_left(self.cuts, piece.first), bisect_left(self.cuts, piece.last)
                parts = pairwise(self.cuts[low : high + 1])
                self.pieces[index : index + 1] = [_Piece(a, b, Closeness.CHORD) for a, b in parts]
                for part in self.pieces[index : index + high - low]:
                    self._fit(part)
            else:
                self._fit(piece)
        return closer

    def line(self) -> tuple[Points, list[int]]:
        """Return the points of the straight arc, and the index of each line's piece.

        Pieces beyond the tolerance are drawn more closely first.
        """
        while True:
            joints = self._joints()
            astray = [i for i in range(len(self.pieces)) if self._error(i, joints) > self.tolerance]
            if not self.draw_closer(astray):
                break
        first = joints[0][-1:] if self.closed else joints[0]
        points: list[npt.NDArray[np.float64]] = first[:1]
        owners: list[int] = []
        for point in first[1:]:
            points.append(point)
            owners.append(0)
        for i, piece in enumerate(self.pieces):
            if piece.closeness is Closeness.CELLS:
                between = list(self.track.points[piece.first + 1 : piece.last])
            else:
                between = []
            following = [*between, *joints[i + 1]]
            if self.closed and i + 1 == len(self.pieces):
                # The first joint is also the last one; its last point is the first of the arc.
                following = [*between, *joints[0]]
            for point in following:
                if np.hypot(*(point - points[-1])) > 1e-9:
                    points.append(point)
                    owners.append(i)
        return np.array(points), owners

    def error(self) -> float:
        """Return the largest distance between the straight arc and the corners of its cells."""
        joints = self._joints()
        return max(self._error(i, joints) for i in range(len(self.pieces)))

    def _error(self, index: int, joints: Sequence[list[npt.NDArray[np.float64]]]) -> float:
        piece = self.pieces[index]
        if piece.closeness is Closeness.CELLS:
            return 0.0
        start, end = joints[index][-1], joints[index + 1][0]
        way = end - start
        length = float(np.hypot(*way))
        chord = self.track.points[piece.last] - self.track.points[piece.first]
        if length < 1e-9 or way @ chord <= 0.0:
            return math.inf
        corners, _ = self.track.passed(piece.first, piece.last)
        ends = (
            math.dist(start, self.track.points[piece.first]),
            math.dist(end, self.track.points[piece.last]),
        )
        if not len(corners):
            return max(ends)
        share = np.clip((corners - start) @ way / length**2, 0.0, 1.0)
        away = np.hypot(*(corners - start - share[:, None] * way).T)
        return max(float(away.max()), *ends)

    def _joints(self) -> list[list[npt.NDArray[np.float64]]]:
        """Return the joints of pieces: one point each, or two where the lines are parallel."""
        inner = [self._joint(a, b) for a, b in pairwise(self.pieces)]
        if self.closed:
            around = self._joint(self.pieces[-1], self.pieces[0])
            return [around, *inner, around]
        return [self._end(self.pieces[0], 0), *inner, self._end(self.pieces[-1], -1)[::-1]]

    def _end(self, piece: _Piece, index: int) -> list[npt.NDArray[np.float64]]:
        """Return the fixed end of an open arc, and the begin of its line if it is elsewhere."""
        end = self.track.points[index]
        foot = piece.origin + ((end - piece.origin) @ piece.along) * piece.along
        if piece.closeness is Closeness.CELLS or math.dist(end, foot) < _ON_LINE:
            return [end]
        return [end, foot]

    def _joint(self, one: _Piece, other: _Piece) -> list[npt.NDArray[np.float64]]:
        cut = self.track.points[one.last]
        if Closeness.CELLS in (one.closeness, other.closeness):
            return [cut]
        cross = one.along[0] * other.along[1] - one.along[1] * other.along[0]
        if abs(cross) > _PARALLEL:
            between = other.origin - one.origin
            share = (between[0] * other.along[1] - between[1] * other.along[0]) / cross
            meeting = one.origin + share * one.along
            if math.dist(meeting, cut) <= self.tolerance:
                return [meeting]
        feet = [p.origin + ((cut - p.origin) @ p.along) * p.along for p in (one, other)]
        if math.dist(*feet) <= _SAME_LINE:
            return [(feet[0] + feet[1]) / 2]
        return feet

    def _fit(self, piece: _Piece) -> None:
        """Fit the line of a piece according to its closeness."""
        start, end = self.track.points[piece.first], self.track.points[piece.last]
        chord = end - start
        length = float(np.hypot(*chord))
        piece.origin, piece.along = start, chord / length if length else np.array([1.0, 0.0])
        _, middles = self.track.passed(piece.first, piece.last)
        if piece.closeness >= Closeness.CHORD:
            return
        if len(middles) >= _FITTED_FROM:
            piece.origin = middles.mean(axis=0)
            spread = middles - piece.origin
            _, axes = np.linalg.eigh(spread.T @ spread)
            piece.along = axes[:, 1] * (1.0 if axes[:, 1] @ chord >= 0.0 else -1.0)
        if piece.closeness is Closeness.MAIN_DIRECTION and len(middles):
            self._turn(piece, middles, length)

    def _turn(self, piece: _Piece, middles: Points, length: float) -> None:
        heading = math.atan2(piece.along[1], piece.along[0])
        for direction in self.directions:
            off = math.remainder(heading - direction, math.pi / 2)
            if abs(off) <= _MOST_TURN and length / 2 * math.sin(abs(off)) <= _TURNED:
                heading -= off
                piece.along = np.array([math.cos(heading), math.sin(heading)]).round(12)
                across = np.array([-piece.along[1], piece.along[0]])
                # The median leaves a wall on the edge of most of its cells.
                piece.origin = across * float(np.median(middles @ across))
                return

    def _join_cuts(self) -> None:
        """Join neighbouring pieces that form one straight line in any direction.

        Chords begin and end on the edge of the band that a slanted line fills, so one line may be
        cut into several chords.
        """
        limit = min(_STRAIGHT, self.tolerance)
        joined: list[_Piece] = []
        for piece in self.pieces:
            together = joined and self._one_line(joined[-1], piece, limit)
            if together:
                joined[-1] = together
            else:
                joined.append(piece)
        if len(joined) > 2 or not self.closed:
            self.pieces = joined

    def _one_line(self, one: _Piece, other: _Piece, limit: float) -> _Piece | None:
        ends = self.track.points[[one.first, one.last, other.last]]
        if (ends[1] - ends[0]) @ (ends[2] - ends[1]) <= 0.0:
            return None
        together = _Piece(one.first, other.last, Closeness.FITTED)
        self._fit(together)
        corners, _ = self.track.passed(one.first, other.last)
        across = np.array([-together.along[1], together.along[0]])
        if np.abs((corners - together.origin) @ across).max() > limit:
            return None
        together.closeness = Closeness.CHORD
        return together

    def _join_runs(self) -> None:
        """Join neighbouring pieces that follow one main direction within the tolerance."""
        joined: list[_Piece] = []
        index = 0
        while index < len(self.pieces):
            piece = self.pieces[index]
            reach = index
            if self._is_main(piece):
                for other in range(index + 1, len(self.pieces)):
                    following = self.pieces[other]
                    chord = self.track.points[following.last] - self.track.points[following.first]
                    if chord @ piece.along < -1e-9:
                        break
                    same = self._is_main(following) and following.along @ piece.along > 1 - 1e-9
                    if same:
                        together = self._together(piece, following)
                        if together is None:
                            break
                        piece, reach = together, other
                    elif self._strays(piece, following):
                        break
            joined.append(piece)
            index = reach + 1
        if len(joined) > 2 or not self.closed:
            self.pieces = joined

    def _is_main(self, piece: _Piece) -> bool:
        if piece.closeness is not Closeness.MAIN_DIRECTION:
            return False
        heading = math.atan2(piece.along[1], piece.along[0])
        return any(
            abs(math.remainder(heading - direction, math.pi / 2)) < 1e-9
            for direction in self.directions
        )

    def _strays(self, piece: _Piece, following: _Piece) -> bool:
        across = np.array([-piece.along[1], piece.along[0]])
        corners, _ = self.track.passed(following.first, following.last)
        return bool(
            len(corners) and np.abs((corners - piece.origin) @ across).max() > 2 * self.tolerance
        )

    def _together(self, piece: _Piece, following: _Piece) -> _Piece | None:
        across = np.array([-piece.along[1], piece.along[0]])
        corners, middles = self.track.passed(piece.first, following.last)
        level = float(np.median(middles @ across))
        if np.abs(corners @ across - level).max() > self.tolerance + 1e-9:
            return None
        return _Piece(piece.first, following.last, piece.closeness, across * level, piece.along)


def _positions(points: Points, simpler: Points) -> list[int]:
    """Return the indices of the points that a simpler line has, in order."""
    where = {tuple(point): i for i, point in enumerate(points[:-1].tolist())}
    return [*(where[tuple(point)] for point in simpler[:-1].tolist()), len(points) - 1]


def main_directions(chords: Sequence[Points], *, most: int = 4) -> tuple[float, ...]:
    """Return the directions of most walls [rad, in (-pi / 4, pi / 4]], the strongest first.

    Walls at right angles share one direction. The weight of a chord is its length; chords of less
    than six cells do not count, since their direction is chance.
    """
    vectors = np.vstack([np.zeros((0, 2)), *chords])
    length = np.hypot(*vectors.T)
    vectors, length = vectors[length >= 6.0], length[length >= 6.0]
    if not len(length):
        return ()
    quarter = math.pi / 2
    angle = np.arctan2(vectors[:, 1], vectors[:, 0]) % quarter
    total = float(length.sum())
    directions: list[float] = []
    remaining = np.ones(len(angle), dtype=bool)
    bins = np.arange(0.0, 90.0, 0.5) * math.pi / 180
    near = math.radians(2.0)
    while remaining.any() and len(directions) < most:
        off = np.abs(_modulo(angle[None, remaining] - bins[:, None]))
        weight = np.where(off < near, 1 - off / near, 0.0) @ length[remaining]
        best = int(weight.argmax())
        close = remaining & (np.abs(_modulo(angle - bins[best])) < near)
        if length[close].sum() < 0.1 * total:
            break
        # A weighted median: walls along the rows of cells are exact and frequent.
        offsets = _modulo(angle[close] - bins[best])
        order = np.argsort(offsets, kind="stable")
        heap = np.cumsum(length[close][order] ** 2)
        middle = float(offsets[order][np.searchsorted(heap, heap[-1] / 2)])
        direction = math.remainder(bins[best] + middle, quarter)
        directions.append(0.0 if abs(direction) < 1e-9 else direction)
        remaining &= ~close
    return tuple(directions)


def _modulo(angle: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return angles [rad] modulo a right angle, between -pi / 4 and pi / 4."""
    quarter = math.pi / 2
    return angle - np.round(angle / quarter) * quarter
