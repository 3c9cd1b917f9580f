"""KLD resampling: as many particles as the spread of the posterior asks for.

Fox, "Adapting the sample size in particle filters through KLD-sampling", IJRR 22(12), 2003, as in
amcl ``pf_update_resample``: draws are independent, one at a time, and the bins they occupy
are counted on the fly.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.kernels import Integers, kernel
from daemon.navigation.ros.amcl._bins import insert
from daemon.navigation.ros.amcl._parameters import AmclParameters
from grammars.values import Floats


def limits(parameters: AmclParameters) -> Integers:
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
        k = insert(slots, keys, places, bins, x, y, yaw)
        if k == bins:
            bins += 1
        of[drawn] = k
        drawn += 1
        if drawn > limits[bins]:
            break
    return drawn, bins
