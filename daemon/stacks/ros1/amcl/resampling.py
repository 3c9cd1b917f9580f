"""KLD resampling: the spread of the posterior decides the number of particles.

Fox, "Adapting the sample size in particle filters through KLD-sampling", IJRR 22(12), 2003, as
in amcl ``pf_update_resample``: draws are independent, one at a time, and the occupied bins are
counted on the fly.

Resampling and clustering share a histogram of poses: bins of 0.5 m, 0.5 m, 10 deg. The original
keeps them in a k-d tree (amcl ``pf_kdtree``), this module in a hash table with open addressing. As
in the original, headings are not wrapped: particles a full turn apart never share a bin.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from grammars.model.geometry import Floats

_BIN_SIZE = 0.5
_BIN_ANGLE = 10.0 * math.pi / 180.0


class Particles(NamedTuple):
    """Particles as columns; a count passed along says how many are in use.

    ``poses`` (3, n), cosine and sine of the headings in ``directions`` (2, n), ``weights`` (n,).
    """

    poses: Floats
    directions: Floats
    weights: Floats


def new_cloud(most: int) -> Particles:
    """Return a cloud with room for ``most`` particles."""
    return Particles(np.empty((3, most)), np.empty((2, most)), np.full(most, 1.0 / most))


class FreeCells(NamedTuple):
    """Flat indices of a map's free cells, its columns, lower-left corner and resolution [m]."""

    cells: Integers
    columns: int
    x: float
    y: float
    resolution: float


class Bins(NamedTuple):
    """A histogram of poses: ``keys[k]`` (3,) is the position of bin k, ``of[i]`` particle i's bin.

    ``slots`` is a hash table of bin numbers, -1 where empty; ``places[k]`` is the slot of bin k.
    ``used`` (1,) is the number of bins.
    """

    slots: Integers
    keys: Integers
    places: Integers
    of: Integers
    used: Integers


def new_bins(most: int) -> Bins:
    """Return an empty histogram with room for ``most`` particles, each in its own bin."""
    size = 1 << (2 * most).bit_length()
    return Bins(
        np.full(size, -1, dtype=np.int32),
        np.empty((most, 3), dtype=np.int32),
        np.empty(most, dtype=np.int32),
        np.empty(most, dtype=np.int32),
        np.zeros(1, dtype=np.int32),
    )


def clear_bins(bins: Bins) -> None:
    """Empty the histogram."""
    bins.slots[bins.places[: bins.used[0]]] = -1
    bins.used[0] = 0


@kernel
def find_slot(bins: Bins, a: int, b: int, c: int) -> int:
    """Return the slot of a bin, or the empty slot for it."""
    slots, keys = bins.slots, bins.keys
    mask = slots.shape[0] - 1
    # Primes of Teschner et al. 2003 for hashing cells of space.
    mixed = (a * 73856093) ^ (b * 19349663) ^ (c * 83492791)
    place = (mixed ^ (mixed >> 15)) & mask
    while True:
        k = slots[place]
        if k < 0 or (keys[k, 0] == a and keys[k, 1] == b and keys[k, 2] == c):
            return int(place)
        place = (place + 1) & mask


@kernel
def insert_pose(bins: Bins, i: int, poses: Floats) -> None:
    """Put particle ``i`` of ``poses`` (3, n) into its bin."""
    a, b = math.floor(poses[0, i] / _BIN_SIZE), math.floor(poses[1, i] / _BIN_SIZE)
    c = math.floor(poses[2, i] / _BIN_ANGLE)
    place = find_slot(bins, a, b, c)
    k = bins.slots[place]
    if k < 0:
        k = bins.used[0]
        bins.slots[place] = k
        bins.places[k] = place
        bins.keys[k, 0], bins.keys[k, 1], bins.keys[k, 2] = a, b, c
        bins.used[0] += 1
    bins.of[i] = k


@kernel
def fill_bins(bins: Bins, poses: Floats, count: int) -> None:
    """Put the first ``count`` particles of ``poses`` (3, n) into the empty histogram."""
    for i in range(count):
        insert_pose(bins, i, poses)


@kernel
def label_clusters(bins: Bins) -> tuple[Integers, int]:
    """Return the cluster of each bin, and the number of clusters.

    A cluster is a connected component over 26 neighbours, numbered by its first bin.
    """
    keys, used = bins.keys, bins.used[0]
    labels, stack = np.full(used, -1, dtype=np.int32), np.empty(used, dtype=np.int32)
    clusters = 0
    for first in range(used):
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
                other = bins.slots[find_slot(bins, a, b, c)]
                if other >= 0 and labels[other] < 0:
                    labels[other] = clusters
                    stack[waiting] = other
                    waiting += 1
        clusters += 1
    return labels, clusters


def particle_limits(parameters: AmclParameters) -> Integers:
    """Return the number of particles for k occupied bins, k = 0 .. max_particles.

    ``(k - 1) / (2 err) (1 - b + sqrt(b) z)^3`` with ``b = 2 / (9 (k - 1))`` (Fox, equation 14),
    within the parameters' bounds; for a single bin ``max_particles``.
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
    cloud: Particles,
    count: int,
    injection: float,
    draws: Floats,
    free: FreeCells,
    limits: Integers,
    new: Particles,
    bins: Bins,
) -> int:
    """Draw particles with replacement into ``new`` and into the empty bins; return their number.

    With probability ``injection`` a particle comes from the ``free`` cells instead, uniformly, at
    their lower-left corners, with any heading. ``draws`` are uniform in [0, 1), shape (max,) or,
    with injection, (3 max,): particle or cell, heading, whether to inject. Weights are not written.
    """
    # One loop, because the number of draws depends on the bins filled so far.
    most = limits.shape[0] - 1
    cumulative = np.cumsum(cloud.weights[:count])
    poses, directions = new.poses, new.directions
    for number in range(most):
        r = draws[number]
        if injection > 0.0 and draws[2 * most + number] < injection:
            cell = free.cells[int(r * free.cells.shape[0])]
            poses[0, number] = free.x + cell % free.columns * free.resolution
            poses[1, number] = free.y + cell // free.columns * free.resolution
            yaw = draws[most + number] * 2.0 * math.pi - math.pi
            poses[2, number] = yaw
            directions[0, number] = math.cos(yaw)
            directions[1, number] = math.sin(yaw)
        else:
            i = min(np.searchsorted(cumulative, r, side="right"), count - 1)
            for axis in range(3):
                poses[axis, number] = cloud.poses[axis, i]
            directions[0, number] = cloud.directions[0, i]
            directions[1, number] = cloud.directions[1, i]
        insert_pose(bins, number, poses)
        # As in the original, one particle more than the limit.
        if number >= limits[bins.used[0]]:
            return int(number + 1)
    return int(most)
