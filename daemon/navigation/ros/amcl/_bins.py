"""The histogram of poses that resampling and clustering share: bins of 0.5 m, 0.5 m, 10 deg.

The original keeps them in a k-d tree (amcl ``pf_kdtree``); a hash table with open addressing holds
the same bins. Headings are not wrapped, as there: particles a full turn apart never share a bin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daemon.navigation.kernels import Integers, kernel
from grammars.values import Floats

_SIZE = 0.5
_ANGLE = 10.0 * math.pi / 180.0


@dataclass(frozen=True, slots=True, eq=False)
class Bins:
    """``keys[k]`` (3,) is where bin k lies, ``slots`` the hash table, ``of[i]`` particle i's bin.

    ``slots`` holds bin numbers, -1 where empty; ``places[k]`` is where in it bin k stands.
    """

    slots: Integers
    keys: Integers
    places: Integers
    of: Integers

    @classmethod
    def for_particles(cls, most: int) -> Bins:
        """Return an empty histogram with room for ``most`` particles, each in its own bin."""
        size = 1 << (2 * most).bit_length()
        return cls(
            np.full(size, -1, dtype=np.int32),
            np.empty((most, 3), dtype=np.int32),
            np.empty(most, dtype=np.int32),
            np.empty(most, dtype=np.int32),
        )


@kernel
def find(slots: Integers, keys: Integers, a: int, b: int, c: int) -> int:
    """Return where in ``slots`` a bin stands, or the empty place where it would."""
    mask = slots.shape[0] - 1
    mixed = (a * 73856093) ^ (b * 19349663) ^ (c * 83492791)
    place = (mixed ^ (mixed >> 15)) & mask
    while True:
        k = slots[place]
        if k < 0 or (keys[k, 0] == a and keys[k, 1] == b and keys[k, 2] == c):
            return int(place)
        place = (place + 1) & mask


@kernel
def insert(
    slots: Integers, keys: Integers, places: Integers, bins: int, x: float, y: float, yaw: float
) -> int:
    """Return the number of the bin of a pose; it is ``bins``, their count, when it is new."""
    a, b, c = math.floor(x / _SIZE), math.floor(y / _SIZE), math.floor(yaw / _ANGLE)
    place = find(slots, keys, a, b, c)
    k = slots[place]
    if k >= 0:
        return int(k)
    slots[place] = bins
    places[bins] = place
    keys[bins, 0], keys[bins, 1], keys[bins, 2] = a, b, c
    return bins


@kernel
def clear(slots: Integers, places: Integers, bins: int) -> None:
    """Empty the histogram of its ``bins`` bins."""
    for k in range(bins):
        slots[places[k]] = -1


@kernel
def fill(
    slots: Integers, keys: Integers, places: Integers, of: Integers, poses: Floats, count: int
) -> int:
    """Put ``count`` particles of ``poses`` (3, n) into the empty histogram; return its bins."""
    bins = 0
    for i in range(count):
        k = insert(slots, keys, places, bins, poses[0, i], poses[1, i], poses[2, i])
        if k == bins:
            bins += 1
        of[i] = k
    return bins


@kernel
def label(slots: Integers, keys: Integers, bins: int, labels: Integers, stack: Integers) -> int:
    """Write the cluster of each bin: connected components over 26 neighbours; return how many.

    Clusters are numbered in the order of their first bins.
    """
    labels[:bins] = -1
    clusters = 0
    for first in range(bins):
        if labels[first] >= 0:
            continue
        labels[first] = clusters
        stack[0] = first
        waiting = 1
        while waiting > 0:
            waiting -= 1
            k = stack[waiting]
            for n in range(27):
                a = keys[k, 0] + n // 9 - 1
                b = keys[k, 1] + n // 3 % 3 - 1
                c = keys[k, 2] + n % 3 - 1
                other = slots[find(slots, keys, a, b, c)]
                if other >= 0 and labels[other] < 0:
                    labels[other] = clusters
                    stack[waiting] = other
                    waiting += 1
        clusters += 1
    return clusters
