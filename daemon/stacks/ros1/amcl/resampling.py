"""KLD resampling: as many particles as the spread of the posterior asks for.

Fox, "Adapting the sample size in particle filters through KLD-sampling", IJRR 22(12), 2003, as
in amcl ``pf_update_resample``: draws are independent, one at a time, and the bins they occupy
are counted on the fly.

Resampling and clustering share a histogram of poses: bins of 0.5 m, 0.5 m, 10 deg. The original
keeps them in a k-d tree (amcl ``pf_kdtree``); a hash table with open addressing holds the same
bins. Headings are not wrapped, as there: particles a full turn apart never share a bin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from grammars.model.geometry import Floats

_BIN_SIZE = 0.5
_BIN_ANGLE = 10.0 * math.pi / 180.0


@dataclass(frozen=True, slots=True, eq=False)
class PoseHistogram:
    """``keys[k]`` (3,) is where bin k lies, ``slots`` the hash table, ``of[i]`` particle i's bin.

    ``slots`` holds bin numbers, -1 where empty; ``places[k]`` is where in it bin k stands.
    """

    slots: Integers
    keys: Integers
    places: Integers
    of: Integers

    @classmethod
    def for_particles(cls, most: int) -> PoseHistogram:
        """Return an empty histogram with room for ``most`` particles, each in its own bin."""
        size = 1 << (2 * most).bit_length()
        return cls(
            np.full(size, -1, dtype=np.int32),
            np.empty((most, 3), dtype=np.int32),
            np.empty(most, dtype=np.int32),
            np.empty(most, dtype=np.int32),
        )


@kernel
def find_slot(slots: Integers, keys: Integers, a: int, b: int, c: int) -> int:
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
def insert_pose(
    slots: Integers, keys: Integers, places: Integers, bins: int, x: float, y: float, yaw: float
) -> int:
    """Return the number of the bin of a pose; it is ``bins``, their count, when it is new."""
    a, b, c = math.floor(x / _BIN_SIZE), math.floor(y / _BIN_SIZE), math.floor(yaw / _BIN_ANGLE)
    place = find_slot(slots, keys, a, b, c)
    k = slots[place]
    if k >= 0:
        return int(k)
    slots[place] = bins
    places[bins] = place
    keys[bins, 0], keys[bins, 1], keys[bins, 2] = a, b, c
    return bins


@kernel
def clear_bins(slots: Integers, places: Integers, bins: int) -> None:
    """Empty the histogram of its ``bins`` bins."""
    for k in range(bins):
        slots[places[k]] = -1


@kernel
def fill_bins(
    slots: Integers, keys: Integers, places: Integers, of: Integers, poses: Floats, count: int
) -> int:
    """Put ``count`` particles of ``poses`` (3, n) into the empty histogram; return its bins."""
    bins = 0
    for i in range(count):
        k = insert_pose(slots, keys, places, bins, poses[0, i], poses[1, i], poses[2, i])
        if k == bins:
            bins += 1
        of[i] = k
    return bins


@kernel
def label_clusters(
    slots: Integers, keys: Integers, bins: int, labels: Integers, stack: Integers
) -> int:
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
                other = slots[find_slot(slots, keys, a, b, c)]
                if other >= 0 and labels[other] < 0:
                    labels[other] = clusters
                    stack[waiting] = other
                    waiting += 1
        clusters += 1
    return clusters


def particle_limits(parameters: AmclParameters) -> Integers:
    """Return how many particles k occupied bins ask for, for k = 0 .. max_particles.

    ``(k - 1) / (2 err) (1 - b + sqrt(b) z)^3`` with ``b = 2 / (9 (k - 1))`` (Fox, equation 14),
    within the parameters' bounds; for a single bin the most there may be.
    """
    p = parameters
    k = np.arange(2, p.max_particles + 1, dtype=np.float64)
    b = 2.0 / (9.0 * (k - 1.0))
    needed = np.ceil((k - 1.0) / (2.0 * p.kld_err) * (1.0 - b + np.sqrt(b) * p.kld_z) ** 3)
    result = np.full(p.max_particles + 1, p.max_particles, dtype=np.int32)
    result[2:] = np.clip(needed, p.min_particles, p.max_particles)
    return result


@kernel
def resample(
    poses: Floats,
    directions: Floats,
    weights: Floats,
    count: int,
    injection: float,
    draws: Floats,
    free: Integers,
    columns: int,
    x0: float,
    y0: float,
    resolution: float,
    limits: Integers,
    new_poses: Floats,
    new_directions: Floats,
    slots: Integers,
    keys: Integers,
    places: Integers,
    of: Integers,
    cumulative: Floats,
    guide: Integers,
) -> tuple[int, int]:
    """Draw particles with replacement; return how many and how many bins they occupy.

    With probability ``injection`` a particle is drawn uniformly from the cells ``free`` (flat
    indices) instead, at their lower-left corners, with any heading. ``draws`` (max,) or, with
    injection, (3 max,) uniform in [0, 1): which particle or cell, heading, whether to inject.
    The histogram must be empty. ``cumulative`` (max + 1,) and ``guide`` (max,) are scratch.

    The search through the cumulative weights starts where a table of equal strips of [0, 1)
    says (Chen and Asau 1974) and finds what a search from the start would.
    """
    most = limits.shape[0] - 1
    cumulative[0] = 0.0
    for i in range(count):
        cumulative[i + 1] = cumulative[i] + weights[i]
    i = 0
    for strip in range(count):
        while i < count - 1 and cumulative[i + 1] <= strip / count:
            i += 1
        guide[strip] = i
    drawn = bins = 0
    while drawn < most:
        r = draws[drawn]
        if injection > 0.0 and draws[2 * most + drawn] < injection:
            cell = free[int(r * free.shape[0])]
            new_poses[0, drawn] = x0 + cell % columns * resolution
            new_poses[1, drawn] = y0 + cell // columns * resolution
            yaw = draws[most + drawn] * 2.0 * math.pi - math.pi
            new_poses[2, drawn] = yaw
            new_directions[0, drawn] = math.cos(yaw)
            new_directions[1, drawn] = math.sin(yaw)
        else:
            i = guide[min(int(r * count), count - 1)]
            while i > 0 and cumulative[i] > r:
                i -= 1
            while i < count - 1 and cumulative[i + 1] <= r:
                i += 1
            for axis in range(3):
                new_poses[axis, drawn] = poses[axis, i]
            new_directions[0, drawn] = directions[0, i]
            new_directions[1, drawn] = directions[1, i]
        x, y, yaw = new_poses[0, drawn], new_poses[1, drawn], new_poses[2, drawn]
        k = insert_pose(slots, keys, places, bins, x, y, yaw)
        if k == bins:
            bins += 1
        of[drawn] = k
        drawn += 1
        if drawn > limits[bins]:
            break
    return drawn, bins
