"""Weights of particles by a scan: ``likelihood_field`` of amcl (``AMCLLaser``).

Probabilistic Robotics, section 6.4, except that beams are combined as ``1 + sum pz^3`` instead of
multiplied.

The likelihood field uses the distance of each cell of the map from an obstacle
(``distance_field.py``). Distances run between cell centres and are capped at
``laser_likelihood_max_dist``. They are squared integers, so the sensor model is a table over them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.distance_field import DistanceField, SquaredCells, distance_field
from daemon.stacks.ros1.amcl.resampling import Particles
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Laser


class Sensor(NamedTuple):
    """A laser on a map, for the kernel.

    ``beams`` (2, k) are cosine and sine of the rays ``indices`` in the base frame, ``mount_x`` and
    ``mount_y`` [m] the position of the laser there. A return between ``least`` and ``most`` [m]
    counts. ``squared`` is the framed field of the map with corner ``x``, ``y`` [m]. Look-ups there
    are shifted by ``shift`` [cells]; ``table`` maps a value to the beam's contribution.
    """

    indices: Integers
    beams: Floats
    mount_x: float
    mount_y: float
    least: float
    most: float
    squared: SquaredCells
    x: float
    y: float
    resolution: float
    shift: float
    table: Floats


def make_sensor(
    parameters: AmclParameters, quirks: Quirks, grid: OccupancyGrid, laser: Laser
) -> Sensor:
    """Return the model of a laser on a map."""
    p = parameters
    field = distance_field(
        grid, p.laser_likelihood_max_dist, brushfire=quirks.amcl_brushfire_distances
    )
    # Messages carry single precision: a return at the very limit must stay at the limit.
    limits = _range_limits(p, float(np.float32(laser.range_min)),
                           float(np.float32(laser.range_max)))  # fmt: skip
    indices, shift = beam_indices(p, laser.rays), 0.5 if quirks.amcl_half_cell_shift else 0.0
    bearings = (laser.angle_min + indices * laser.angle_increment).tolist()
    # numpy's cosine differs from that of C in the last bits.
    angles = [laser.mount.yaw + bearing for bearing in bearings]
    beams = np.array([[math.cos(a) for a in angles], [math.sin(a) for a in angles]])
    return Sensor(
        indices, beams, laser.mount.x, laser.mount.y, *limits, field.squared, grid.x, grid.y,
        grid.resolution, shift, _likelihoods(p, field, limits[1]),
    )  # fmt: skip


def _likelihoods(parameters: AmclParameters, field: DistanceField, range_max: float) -> Floats:
    """Return a beam's contribution to the sum of a particle, by the value of the field."""
    p = parameters
    distances = field.distances(p.laser_likelihood_max_dist)
    hit = p.laser_z_hit * np.exp(-(distances**2) / (2.0 * p.laser_sigma_hit**2))
    likelihood = hit + p.laser_z_rand / range_max
    return likelihood**3


def beam_indices(parameters: AmclParameters, rays: int) -> Integers:
    """Return the indices of the rays in use, at equal steps from the first on.

    150 rays and 30 beams give 0, 5, .. 145. The number of beams may exceed
    ``laser_max_beams`` when the rays do not divide well, as in the original.
    """
    step = max(1, (rays - 1) // (parameters.laser_max_beams - 1))
    return np.arange(0, rays, step, dtype=np.int32)


def _range_limits(parameters: AmclParameters, least: float, most: float) -> tuple[float, float]:
    """Return the least and the largest range of returns [m]: the scanner's or narrower ones."""
    if parameters.laser_min_range > 0.0:
        least = max(least, parameters.laser_min_range)
    if parameters.laser_max_range > 0.0:
        most = min(most, parameters.laser_max_range)
    return least, most


@kernel
def weigh_particles(sensor: Sensor, ranges: Singles, cloud: Particles, count: int) -> float:
    """Multiply the first ``count`` weights by the likelihood of a scan; return their sum.

    The likelihood is 1 plus the sum over beams of ``table``. Lost rays (NaN) count nothing. The
    outer loop is over beams, the inner ones over particles, so each sum has the order of the
    beams. The loop for the cells has no look-ups and no dependencies, so it runs on several
    particles at once.
    """
    poses, directions, weights = cloud.poses, cloud.directions, cloud.weights
    corner, cells, sums = np.empty((2, count)), np.empty(count, dtype=np.int32), np.empty(count)
    beams, table = sensor.beams, sensor.table
    rows, columns = sensor.squared.shape
    flat = sensor.squared.reshape(rows * columns)
    width = np.int32(columns)
    inverse = 1.0 / sensor.resolution
    right, top = float(columns - 1), float(rows - 1)
    for i in range(count):
        corner[0, i] = (poses[0, i] - sensor.x) * inverse + sensor.shift + 1.0
        corner[1, i] = (poses[1, i] - sensor.y) * inverse + sensor.shift + 1.0
        sums[i] = 1.0
    for k in range(beams.shape[1]):
        r = float(ranges[sensor.indices[k]])
        # A return at one of the limits does not count.
        if not sensor.least < r < sensor.most:
            continue
        px = (sensor.mount_x + r * beams[0, k]) * inverse
        py = (sensor.mount_y + r * beams[1, k]) * inverse
        for i in range(count):
            c, s = directions[0, i], directions[1, i]
            u = min(max(corner[0, i] + (c * px - s * py), 0.0), right)
            v = min(max(corner[1, i] + (s * px + c * py), 0.0), top)
            cells[i] = np.int32(v) * width + np.int32(u)
        for i in range(count):
            sums[i] += table[flat[cells[i]]]
    total = 0.0
    for i in range(count):
        weights[i] *= sums[i]
        total += weights[i]
    return total
