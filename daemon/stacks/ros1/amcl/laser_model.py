"""How a scan weighs the particles: ``likelihood_field`` of amcl (``AMCLLaser``).

Probabilistic Robotics, section 6.4, except that beams are combined as ``1 + sum pz^3`` instead of
multiplied.

The likelihood field stands on how far each cell of the map is from an obstacle
(``distance_field.py``). Distances run between cell centres and are capped at
``laser_likelihood_max_dist``. They are kept squared, as whole numbers, so that the sensor model is
a table over them.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.distance_field import SquaredCells, distance_field
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats
from grammars.model.grid import OccupancyGrid
from grammars.model.robot import Laser


class LaserModel:
    """Weighs particles by scans of one laser on one map."""

    def __init__(
        self, parameters: AmclParameters, quirks: Quirks, grid: OccupancyGrid, laser: Laser
    ) -> None:
        self._parameters, self._grid = parameters, grid
        self._shift = 0.5 if quirks.amcl_half_cell_shift else 0.0
        self._indices = beam_indices(parameters, laser.rays)
        self._bearings = _bearings(laser, self._indices)
        self._mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        # Messages carry single precision: a return at the very limit must stay at the limit.
        self._limits = _range_limits(parameters, float(np.float32(laser.range_min)),
                               float(np.float32(laser.range_max)))  # fmt: skip
        self._sums = np.empty(parameters.max_particles)
        self._corner = np.empty((2, parameters.max_particles))
        self._cells = np.empty(parameters.max_particles, dtype=np.int32)
        self._points = np.empty((len(self._indices), 2))
        self._field = distance_field(
            grid,
            parameters.laser_likelihood_max_dist,
            brushfire=quirks.amcl_brushfire_distances,
        )
        self._table = self._likelihoods()

    def weigh(
        self, ranges: Singles, poses: Floats, directions: Floats, count: int, weights: Floats
    ) -> float:
        """Multiply ``weights[:count]`` by the likelihood of a scan; return their sum.

        ``poses`` (3, n) with ``directions`` (2, n), cosine and sine of their headings. Lost rays
        (NaN) count nothing.
        """
        grid = self._grid
        seen = beam_end_points(
            ranges, self._indices, self._bearings, self._mount, *self._limits, self._points
        )
        sum_over_beams(
            self._field.squared, grid.x, grid.y, grid.resolution, self._shift,
            self._points[:seen], poses, directions, count, self._table, self._corner,
            self._cells, self._sums,
        )  # fmt: skip
        return scale_weights(weights, self._sums, count)

    def _likelihoods(self) -> Floats:
        """Return what a beam adds to the sum of a particle, by the value of the field it hits."""
        p = self._parameters
        distances = self._field.distances(p.laser_likelihood_max_dist)
        hit = p.laser_z_hit * np.exp(-(distances**2) / (2.0 * p.laser_sigma_hit**2))
        likelihood = hit + p.laser_z_rand / self._limits[1]
        return likelihood**3


def beam_indices(parameters: AmclParameters, rays: int) -> Integers:
    """Return which rays of a scan are used: every so-manyth, from the first on.

    150 rays and 30 beams give 0, 5, .. 145. The number of beams may exceed
    ``laser_max_beams`` when the rays do not divide well, as in the original.
    """
    step = max(1, (rays - 1) // (parameters.laser_max_beams - 1))
    return np.arange(0, rays, step, dtype=np.int32)


def _bearings(laser: Laser, indices: Integers) -> Floats:
    return np.asarray(laser.angle_min + indices * laser.angle_increment, dtype=np.float64)


def _range_limits(parameters: AmclParameters, least: float, most: float) -> tuple[float, float]:
    """Return between which ranges a return counts [m]: the parameters only narrow the scanner."""
    if parameters.laser_min_range > 0.0:
        least = max(least, parameters.laser_min_range)
    if parameters.laser_max_range > 0.0:
        most = min(most, parameters.laser_max_range)
    return least, most


@kernel
def beam_end_points(
    ranges: Singles,
    indices: Integers,
    bearings: Floats,
    mount: Floats,
    range_min: float,
    range_max: float,
    points: Floats,
) -> int:
    """Write the end points of usable beams in the base frame; return how many there are.

    A return at ``range_min`` or below counts as none, as one at ``range_max`` or beyond does.
    """
    count = 0
    for k in range(indices.shape[0]):
        r = float(ranges[indices[k]])
        if range_min < r < range_max:
            points[count, 0] = mount[0] + r * math.cos(mount[2] + bearings[k])
            points[count, 1] = mount[1] + r * math.sin(mount[2] + bearings[k])
            count += 1
    return count


@kernel
def sum_over_beams(
    squared: SquaredCells,
    x0: float,
    y0: float,
    resolution: float,
    shift: float,
    points: Floats,
    poses: Floats,
    directions: Floats,
    count: int,
    table: Floats,
    corner: Floats,
    cells: Integers,
    sums: Floats,
) -> None:
    """Write 1 plus the sum over end points of ``table`` at the field's value there.

    ``corner`` (2, n) and ``cells`` (n,) are scratch. Beams run outside, particles inside, which
    leaves each sum in the order of the beams and the loop that finds the cells free of look-ups
    and dependencies, so that it runs on several particles at once.
    """
    rows, columns = squared.shape
    flat = squared.reshape(rows * columns)
    width = np.int32(columns)
    inverse = 1.0 / resolution
    right, top = float(columns - 1), float(rows - 1)
    for i in range(count):
        corner[0, i] = (poses[0, i] - x0) * inverse + shift + 1.0
        corner[1, i] = (poses[1, i] - y0) * inverse + shift + 1.0
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


@kernel
def scale_weights(weights: Floats, factors: Floats, count: int) -> float:
    """Multiply weights by factors; return the sum of the products."""
    total = 0.0
    for i in range(count):
        weights[i] *= factors[i]
        total += weights[i]
    return total
