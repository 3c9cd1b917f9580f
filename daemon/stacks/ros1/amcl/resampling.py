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
from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from grammars.model.geometry import Floats

_BIN_SIZE = 0.5
_BIN_ANGLE = 10.0 * math.pi / 180.0


class Particles(NamedTuple):
    """Particles as columns, of which the first so many count.

    ``poses`` (3, n), cosine and sine of their headings in ``directions`` (2, n), ``weights`` (n,).
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
    """A histogram of poses: ``keys[k]`` (3,) is where bin k lies, ``of[i]`` particle i's bin.

    ``slots`` is a hash table of bin numbers, -1 where empty; ``places[k]`` is where in it bin k
    stands. ``used`` (1,) is how many bins there are.
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
    """Return where in ``slots`` a bin stands, or the empty place where it would."""
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
def label_clusters(bins: Bins, labels: Integers, stack: Integers) -> int:
    """Write the cluster of each bin: connected components over 26 neighbours; return how many.

    Clusters are numbered in the order of their first bins.
    """
    keys, used = bins.keys, bins.used[0]
    for k in range(used):
        labels[k] = -1
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
    cloud: Particles,
    count: int,
    injection: float,
    draws: Floats,
    free: FreeCells,
    limits: Integers,
    new: Particles,
    bins: Bins,
    cumulative: Floats,
    guide: Integers,
) -> int:
    """Draw particles with replacement into ``new`` and into the empty bins; return how many.

    With probability ``injection`` a particle is drawn uniformly from the ``free`` cells instead, at
    their lower-left corners, with any heading. ``draws`` (max,) or, with injection, (3 max,)
    uniform in [0, 1): which particle or cell, heading, whether to inject. ``cumulative`` (max + 1,)
    and ``guide`` (max,) are scratch. Weights are not written.

    The search through the cumulative weights starts where a table of equal strips of [0, 1)
    says (Chen and Asau 1974) and finds what a search from the start would.
    """
    # One loop, though long: how many particles are drawn depends on the bins that those drawn
    # before have filled.
    most = limits.shape[0] - 1
    cumulative[0] = 0.0
    for i in range(count):
        cumulative[i + 1] = cumulative[i] + cloud.weights[i]
    i = 0
    for strip in range(count):
        while i < count - 1 and cumulative[i + 1] <= strip / count:
            i += 1
        guide[strip] = i
    poses, directions = new.poses, new.directions
    for drawn in range(most):
        r = draws[drawn]
        if injection > 0.0 and draws[2 * most + drawn] < injection:
            cell = free.cells[int(r * free.cells.shape[0])]
            poses[0, drawn] = free.x + cell % free.columns * free.resolution
            poses[1, drawn] = free.y + cell // free.columns * free.resolution
            yaw = draws[most + drawn] * 2.0 * math.pi - math.pi
            poses[2, drawn] = yaw
            directions[0, drawn] = math.cos(yaw)
            directions[1, drawn] = math.sin(yaw)
        else:
            i = guide[min(int(r * count), count - 1)]
            while i > 0 and cumulative[i] > r:
                i -= 1
            while i < count - 1 and cumulative[i + 1] <= r:
                i += 1
            for axis in range(3):
                poses[axis, drawn] = cloud.poses[axis, i]
            directions[0, drawn] = cloud.directions[0, i]
            directions[1, drawn] = cloud.directions[1, i]
        insert_pose(bins, drawn, poses)
        # As there: one particle more than the limit asks for.
        if drawn >= limits[bins.used[0]]:
            return int(drawn + 1)
    return int(most)
