"""How a scan weighs the particles (amcl ``AMCLLaser``): all three models of the original.

Probabilistic Robotics, sections 6.3 and 6.4, except that ``likelihood_field`` and ``beam``
combine beams as ``1 + sum pz^3`` instead of multiplying them.

The likelihood field stands on how far each cell of the map is from an obstacle
(``distance_field.py``). Distances run between cell centres and are capped at
``laser_likelihood_max_dist``. They are kept squared, as whole numbers, so that every sensor model
is a table over them.

The beam model asks what a ray should have measured on the map (``AMCLLaser::BeamModel``).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.distance_field import SquaredCells, distance_field
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats
from grammars.model.grid import FREE, OccupancyGrid
from grammars.model.robot import Laser


@kernel
def map_range(
    blocked: npt.NDArray[np.uint8],
    x0: float,
    y0: float,
    resolution: float,
    shift: float,
    x: float,
    y: float,
    angle: float,
    reach: float,
) -> float:
    """Return the range [m] to the first cell on the ray that is not free, ``reach`` for none.

    Bresenham from cell to cell, unknown and off the map as good as occupied, the range measured
    between cell centres (amcl ``map_calc_range``). (``x0``, ``y0``) is the map's lower-left
    corner; ``shift`` [cells] is added to coordinates before they are cut to cells.
    """
    rows, columns = blocked.shape
    a = math.floor((x - x0) / resolution + shift)
    b = math.floor((y - y0) / resolution + shift)
    a_end = math.floor((x + reach * math.cos(angle) - x0) / resolution + shift)
    b_end = math.floor((y + reach * math.sin(angle) - y0) / resolution + shift)
    steep = abs(b_end - b) > abs(a_end - a)
    if steep:
        a, b, a_end, b_end = b, a, b_end, a_end
    along, across = abs(a_end - a), abs(b_end - b)
    a_step = 1 if a < a_end else -1
    b_step = 1 if b < b_end else -1
    error = 0
    u, v = a, b
    # The ray is followed one cell beyond its end, as in the original.
    for step in range(along + 2):
        if step > 0:
            u += a_step
            error += across
            if 2 * error >= along:
                v += b_step
                error -= along
        row, column = (u, v) if steep else (v, u)
        inside = 0 <= row < rows and 0 <= column < columns
        if not inside or blocked[row, column] != 0:
            return math.hypot(float(u - a), float(v - b)) * resolution
    return reach


@kernel
def weigh_beams(
    ranges: Singles,
    indices: Integers,
    bearings: Floats,
    mount: Floats,
    range_min: float,
    range_max: float,
    blocked: npt.NDArray[np.uint8],
    x0: float,
    y0: float,
    resolution: float,
    shift: float,
    z_hit: float,
    z_short: float,
    z_max: float,
    z_rand: float,
    sigma_hit: float,
    lambda_short: float,
    poses: Floats,
    count: int,
    sums: Floats,
) -> None:
    """Write ``1 + sum pz^3`` of each particle, pz the mixture of four ways to measure a range.

    A return at ``range_min`` or below stands for one at ``range_max``; beyond ``range_max`` none
    of the four explains it, so it counts nothing.
    """
    for i in range(count):
        c, s = math.cos(poses[2, i]), math.sin(poses[2, i])
        x = poses[0, i] + c * mount[0] - s * mount[1]
        y = poses[1, i] + s * mount[0] + c * mount[1]
        yaw = poses[2, i] + mount[2]
        total = 1.0
        for k in range(indices.shape[0]):
            r = float(ranges[indices[k]])
            if r <= range_min:
                r = range_max
            if not r <= range_max:
                continue
            expected = map_range(
                blocked, x0, y0, resolution, shift, x, y, yaw + bearings[k], range_max
            )
            z = r - expected
            pz = z_hit * math.exp(-(z * z) / (2.0 * sigma_hit * sigma_hit))
            if z < 0.0:
                pz += z_short * lambda_short * math.exp(-lambda_short * r)
            if r == range_max:
                pz += z_max
            if r < range_max:
                pz += z_rand / range_max
            total += pz * pz * pz
        sums[i] = total


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
        if parameters.laser_model_type == "beam":
            self._blocked = (grid.cells != FREE).view(np.uint8)
        else:
            self._field = distance_field(
                grid,
                parameters.laser_likelihood_max_dist,
                brushfire=quirks.amcl_brushfire_distances,
            )
            self._table = self._likelihoods()

    def weigh(
        self, ranges: Singles, poses: Floats, directions: Floats, count: int, weights: Floats,
        *, converged: bool,
    ) -> float:  # fmt: skip
        """Multiply ``weights[:count]`` by the likelihood of a scan; return their sum.

        ``poses`` (3, n) with ``directions`` (2, n), cosine and sine of their headings. Lost rays
        (NaN) count nothing in any model. ``converged`` enables skipping beams.
        """
        model = self._parameters.laser_model_type
        if model == "beam":
            return self._weigh_beams(ranges, poses, count, weights)
        seen = beam_end_points(
            ranges, self._indices, self._bearings, self._mount, *self._limits, self._points
        )
        points = self._points[:seen]
        if model == "likelihood_field_prob" and self._parameters.do_beamskip and converged:
            points = self._agreeing(points, poses, directions, count)
        start = 1.0 if model == "likelihood_field" else 0.0
        self._sum(points, poses, directions, count, self._table, start)
        if model == "likelihood_field_prob":
            np.exp(self._sums[:count], out=self._sums[:count])
        return scale_weights(weights, self._sums, count)

    def _weigh_beams(self, ranges: Singles, poses: Floats, count: int, weights: Floats) -> float:
        p, grid = self._parameters, self._grid
        mixture = (p.laser_z_hit, p.laser_z_short, p.laser_z_max, p.laser_z_rand)
        weigh_beams(
            ranges, self._indices, self._bearings, self._mount, *self._limits, self._blocked,
            grid.x, grid.y, grid.resolution, self._shift, *mixture, p.laser_sigma_hit,
            p.laser_lambda_short, poses, count, self._sums,
        )  # fmt: skip
        return scale_weights(weights, self._sums, count)

    def _likelihoods(self) -> Floats:
        """Return what a beam adds to the sum of a particle, by the value of the field it hits."""
        p = self._parameters
        distances = self._field.distances(p.laser_likelihood_max_dist)
        hit = p.laser_z_hit * np.exp(-(distances**2) / (2.0 * p.laser_sigma_hit**2))
        likelihood = hit + p.laser_z_rand / self._limits[1]
        if p.laser_model_type == "likelihood_field":
            return likelihood**3
        with np.errstate(divide="ignore"):
            return np.log(likelihood)

    def _agreeing(self, points: Floats, poses: Floats, directions: Floats, count: int) -> Floats:
        """Return the end points most particles agree with, or all when hardly any would be left.

        Beams without return count as left out, as in the original; when all are left in, it takes
        stale values for them, while here they tell nothing. A beam that ends farther than
        ``laser_likelihood_max_dist`` from every obstacle agrees with nothing.
        """
        p = self._parameters
        near = self._field.distances(math.inf) < p.beam_skip_distance
        votes = near.astype(np.float64)
        shares = np.empty(len(points))
        for k in range(len(points)):
            self._sum(points[k : k + 1], poses, directions, count, votes, 0.0)
            shares[k] = self._sums[:count].sum() / count
        kept = shares > p.beam_skip_threshold
        skipped = p.laser_max_beams - np.count_nonzero(kept)
        if skipped >= p.laser_max_beams * p.beam_skip_error_threshold:
            return points
        return np.ascontiguousarray(points[kept])

    def _sum(
        self, points: Floats, poses: Floats, directions: Floats, count: int, table: Floats,
        start: float,
    ) -> None:  # fmt: skip
        grid = self._grid
        sum_over_beams(
            self._field.squared, grid.x, grid.y, grid.resolution, self._shift, points, poses,
            directions, count, table, start, self._corner, self._cells, self._sums,
        )  # fmt: skip


def beam_indices(parameters: AmclParameters, rays: int) -> Integers:
    """Return which rays of a scan are used: every so-manyth, from the first on.

    150 rays and 30 beams give 0, 5, .. 145. The number of beams may exceed
    ``laser_max_beams`` when the rays do not divide well, as in the original.
    """
    beams = parameters.laser_max_beams
    if parameters.laser_model_type == "likelihood_field_prob":
        step = math.ceil(rays / beams)
    else:
        step = max(1, (rays - 1) // (beams - 1))
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
    start: float,
    corner: Floats,
    cells: Integers,
    sums: Floats,
) -> None:
    """Write ``start`` plus the sum over end points of ``table`` at the field's value there.

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
        sums[i] = start
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
