"""Weights of particles by a scan: ``likelihood_field`` of amcl (``AMCLLaser``).

Probabilistic Robotics, section 6.4, except that beams are combined as ``1 + sum pz^3`` instead of
multiplied.

The likelihood field stands on how far each cell of the map is from an obstacle
(``distance_field.py``). Distances run between cell centres and are capped at
``laser_likelihood_max_dist``. They are kept squared, as whole numbers, so that the sensor model is
a table over them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.distance_field import DistanceField, SquaredCells, distance_field
from daemon.stacks.ros1.amcl.resampling import Cloud
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Laser


class LikelihoodField(NamedTuple):
    """A framed field of squared distances and what a beam adds by them, ``table``.

    ``x``, ``y`` is the corner of its map [m], ``shift`` [cells] is added to what is looked up.
    """

    squared: SquaredCells
    table: Floats
    x: float
    y: float
    resolution: float
    shift: float


class LaserModel:
    """Weighs particles by scans of one laser on one map."""

    def __init__(
        self, parameters: AmclParameters, quirks: Quirks, grid: OccupancyGrid, laser: Laser
    ) -> None:
        self._indices, self._mount = beam_indices(parameters, laser.rays), laser.mount
        bearings = (laser.angle_min + self._indices * laser.angle_increment).tolist()
        # Not by numpy: its cosine differs from that of C in the last bits.
        angles = [laser.mount.yaw + bearing for bearing in bearings]
        self._beams = np.array([[math.cos(a) for a in angles], [math.sin(a) for a in angles]])
        # Messages carry single precision: a return at the very limit must stay at the limit.
        self._limits = _range_limits(parameters, float(np.float32(laser.range_min)),
                               float(np.float32(laser.range_max)))  # fmt: skip
        self._sums = np.empty(parameters.max_particles)
        self._corner = np.empty((2, parameters.max_particles))
        self._cells = np.empty(parameters.max_particles, dtype=np.int32)
        field = distance_field(
            grid,
            parameters.laser_likelihood_max_dist,
            brushfire=quirks.amcl_brushfire_distances,
        )
        table = _likelihoods(parameters, field, self._limits[1])
        shift = 0.5 if quirks.amcl_half_cell_shift else 0.0
        self._field = LikelihoodField(field.squared, table, grid.x, grid.y, grid.resolution, shift)

    def weigh(self, ranges: Singles, cloud: Cloud, count: int) -> float:
        """Multiply the first ``count`` weights by the likelihood of a scan; return their sum.

        Lost rays (NaN) count nothing.
        """
        points = self._end_points(ranges)
        sum_over_beams(self._field, points, cloud, count, self._corner, self._cells, self._sums)
        weights = cloud.weights[:count]
        weights *= self._sums[:count]
        # Added one after the other, which a sum of numpy is not.
        return float(np.cumsum(weights)[-1])

    def _end_points(self, ranges: Singles) -> Floats:
        """Return the end points (n, 2) of usable beams in the base frame.

        A return at the least range or below counts as none, as one at the largest or beyond does.
        """
        least, most = self._limits
        reach = ranges[self._indices].astype(np.float64)
        usable = (reach > least) & (reach < most)
        points = reach[usable] * self._beams[:, usable]
        points += [[self._mount.x], [self._mount.y]]
        return np.ascontiguousarray(points.T)


def _likelihoods(parameters: AmclParameters, field: DistanceField, range_max: float) -> Floats:
    """Return what a beam adds to the sum of a particle, by the value of the field it hits."""
    p = parameters
    distances = field.distances(p.laser_likelihood_max_dist)
    hit = p.laser_z_hit * np.exp(-(distances**2) / (2.0 * p.laser_sigma_hit**2))
    likelihood = hit + p.laser_z_rand / range_max
    return likelihood**3


def beam_indices(parameters: AmclParameters, rays: int) -> Integers:
    """Return which rays of a scan are used: every so-manyth, from the first on.

    150 rays and 30 beams give 0, 5, .. 145. The number of beams may exceed
    ``laser_max_beams`` when the rays do not divide well, as in the original.
    """
    step = max(1, (rays - 1) // (parameters.laser_max_beams - 1))
    return np.arange(0, rays, step, dtype=np.int32)


def _range_limits(parameters: AmclParameters, least: float, most: float) -> tuple[float, float]:
    """Return between which ranges a return counts [m]: the parameters only narrow the scanner."""
    if parameters.laser_min_range > 0.0:
        least = max(least, parameters.laser_min_range)
    if parameters.laser_max_range > 0.0:
        most = min(most, parameters.laser_max_range)
    return least, most


@kernel
def sum_over_beams(
    field: LikelihoodField,
    points: Floats,
    cloud: Cloud,
    count: int,
    corner: Floats,
    cells: Integers,
    sums: Floats,
) -> None:
    """Write 1 plus the sum over end points of ``table`` at the field's value there.

    ``corner`` (2, n) and ``cells`` (n,) are scratch. Beams run outside, particles inside, which
    leaves each sum in the order of the beams and the loop that finds the cells free of look-ups
    and dependencies, so that it runs on several particles at once.
    """
    poses, directions, table = cloud.poses, cloud.directions, field.table
    rows, columns = field.squared.shape
    flat = field.squared.reshape(rows * columns)
    width = np.int32(columns)
    inverse = 1.0 / field.resolution
    right, top = float(columns - 1), float(rows - 1)
    for i in range(count):
        corner[0, i] = (poses[0, i] - field.x) * inverse + field.shift + 1.0
        corner[1, i] = (poses[1, i] - field.y) * inverse + field.shift + 1.0
        sums[i] = 1.0
    for k in range(points.shape[0]):
        px, py = points[k, 0] * inverse, points[k, 1] * inverse
        for i in range(count):
            c, s = directions[0, i], directions[1, i]
            u = min(max(corner[0, i] + (c * px - s * py), 0.0), right)
            v = min(max(corner[1, i] + (s * px + c * py), 0.0), top)
            cells[i] = np.int32(v) * width + np.int32(u)
        for i in range(count):
            sums[i] += table[flat[cells[i]]]
