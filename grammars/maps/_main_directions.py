"""The directions that most walls of a building follow, at whatever angle it stands."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from grammars.maps._borders import Points


def main_directions(chords: Sequence[Points], *, most: int = 4) -> tuple[float, ...]:
    """Return the directions most walls follow [rad, in (-pi / 4, pi / 4]], the strongest first.

    Walls at right angles have one direction in common. Chords count by their length, those of
    less than six cells not at all: the direction of short ones is chance.
    """
    vectors = np.vstack([np.zeros((0, 2)), *chords])
    length = np.hypot(*vectors.T)
    vectors, length = vectors[length >= 6.0], length[length >= 6.0]
    if not len(length):
        return ()
    quarter = math.pi / 2
    angle = np.arctan2(vectors[:, 1], vectors[:, 0]) % quarter
    total = float(length.sum())
    found: list[float] = []
    left = np.ones(len(angle), dtype=bool)
    bins = np.arange(0.0, 90.0, 0.5) * math.pi / 180
    near = math.radians(2.0)
    while left.any() and len(found) < most:
        off = np.abs(_modulo(angle[None, left] - bins[:, None]))
        weight = np.where(off < near, 1 - off / near, 0.0) @ length[left]
        best = int(weight.argmax())
        close = left & (np.abs(_modulo(angle - bins[best])) < near)
        if length[close].sum() < 0.1 * total:
            break
        # A weighted median: walls drawn along the rows of cells are there exactly, and many.
        offsets = _modulo(angle[close] - bins[best])
        order = np.argsort(offsets, kind="stable")
        heap = np.cumsum(length[close][order] ** 2)
        middle = float(offsets[order][np.searchsorted(heap, heap[-1] / 2)])
        direction = math.remainder(bins[best] + middle, quarter)
        found.append(0.0 if abs(direction) < 1e-9 else direction)
        left &= ~close
    return tuple(found)


def _modulo(angle: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return angles [rad] modulo a right angle, between -pi / 4 and pi / 4."""
    quarter = math.pi / 2
    return angle - np.round(angle / quarter) * quarter
