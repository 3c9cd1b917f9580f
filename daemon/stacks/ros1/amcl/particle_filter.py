"""The particle filter itself: particles, their weights, and what they say (amcl ``pf``).

A cloud says two things: the mean of its heaviest cluster, and the spread of all particles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.laser_model import LaserModel
from daemon.stacks.ros1.amcl.motion_model import OdometryMotion, move_particles
from daemon.stacks.ros1.amcl.resampling import (
    PoseHistogram,
    clear_bins,
    fill_bins,
    label_clusters,
    particle_limits,
    resample,
)
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import FREE, OccupancyGrid


@kernel
def summarise(
    poses: Floats,
    directions: Floats,
    weights: Floats,
    count: int,
    of: Integers,
    labels: Integers,
    clusters: int,
    sums: Floats,
    result: Floats,
) -> None:
    """Write estimate (3), mean of all (3) and covariance of all: xx, xy, yy, yaw (4).

    The estimate is the weighted mean of the cluster with the largest weight (of the first one
    when several have it), headings averaged on the circle; ``-2 ln R`` is the variance of
    headings with mean resultant length R. ``sums`` (clusters, 5) is scratch.
    """
    sums[:clusters] = 0.0
    total = x_sum = y_sum = c_sum = s_sum = xx = xy = yy = 0.0
    for i in range(count):
        w, x, y = weights[i], poses[0, i], poses[1, i]
        wx, wy = w * x, w * y
        k = labels[of[i]]
        sums[k, 0] += w
        sums[k, 1] += wx
        sums[k, 2] += wy
        sums[k, 3] += w * directions[0, i]
        sums[k, 4] += w * directions[1, i]
        xx += wx * x
        xy += wx * y
        yy += wy * y
    best = 0
    for k in range(clusters):
        total += sums[k, 0]
        x_sum += sums[k, 1]
        y_sum += sums[k, 2]
        c_sum += sums[k, 3]
        s_sum += sums[k, 4]
        if sums[k, 0] > sums[best, 0]:
            best = k
    weight = sums[best, 0]
    result[0], result[1] = sums[best, 1] / weight, sums[best, 2] / weight
    result[2] = math.atan2(sums[best, 4], sums[best, 3])
    mx, my = x_sum / total, y_sum / total
    result[3], result[4], result[5] = mx, my, math.atan2(s_sum, c_sum)
    result[6] = xx / total - mx * mx
    result[7] = xy / total - mx * my
    result[8] = yy / total - my * my
    length = math.hypot(c_sum, s_sum)
    # Rounding may lengthen the resultant of equal headings beyond 1.
    result[9] = max(0.0, -2.0 * math.log(length)) if length > 0.0 else math.inf


_NO_CELLS = np.empty(0, dtype=np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class CloudSummary:
    """The ``pose`` of the heaviest cluster; ``mean`` and ``covariance`` (3, 3) of all particles."""

    pose: Pose2
    mean: Pose2
    covariance: Floats


class ParticleFilter:
    """Particles as columns: ``poses`` (3, n), cosine and sine of headings (2, n), ``weights`` (n,).

    Two sets of arrays take turns: resampling draws from one into the other.
    """

    def __init__(
        self, parameters: AmclParameters, quirks: Quirks, grid: OccupancyGrid, start: Pose2,
        random: np.random.Generator,
    ) -> None:  # fmt: skip
        most = parameters.max_particles
        self._parameters, self._grid, self._random = parameters, grid, random
        self._poses, self._other_poses = np.empty((3, most)), np.empty((3, most))
        self._directions, self._other_directions = np.empty((2, most)), np.empty((2, most))
        self._weights = np.full(most, 1.0 / most)
        self._count, self._full_turns = most, quirks.amcl_reversing_splits_cloud
        self._slow = self._fast = 0.0
        self._limits = particle_limits(parameters)
        self._bins, self._used = PoseHistogram.for_particles(most), 0
        self._numbers = np.empty(3 * most)
        self._cumulative, self._guide = np.empty(most + 1), np.empty(most, dtype=np.int32)
        self._labels, self._stack = np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32)
        self._sums, self._result = np.empty((most, 5)), np.empty(10)
        self._spread(start)

    @property
    def count(self) -> int:
        """How many particles there are now."""
        return self._count

    @property
    def poses(self) -> Floats:
        """The particles, shape (n, 3): a view that the next update changes."""
        return self._poses[:, : self._count].T

    @property
    def weights(self) -> Floats:
        """Their weights, shape (n,), sum 1: a view that the next update changes."""
        return self._weights[: self._count]

    def move(self, motion: OdometryMotion) -> None:
        """Move every particle by what odometry says, with noise."""
        count = self._count
        normals = self._random.standard_normal(out=self._numbers[: 3 * count])
        move_particles(
            self._parameters, motion, self._poses, self._directions, count, normals,
            full_turns=self._full_turns,
        )  # fmt: skip

    def weigh(self, sensor: LaserModel, ranges: Singles) -> None:
        """Multiply weights by the likelihood of a scan and normalise them."""
        p, count, weights = self._parameters, self._count, self._weights
        # Above 0, since the likelihood of a scan is 1 or more.
        total = sensor.weigh(ranges, self._poses, self._directions, count, weights)
        weights[:count] /= total
        average = total / count
        # 0 stands for "never set": the first average is taken as it is.
        self._slow += (p.recovery_alpha_slow if self._slow else 1.0) * (average - self._slow)
        self._fast += (p.recovery_alpha_fast if self._fast else 1.0) * (average - self._fast)

    def resample(self) -> None:
        """Draw a new set of equally weighted particles, as many as KLD asks for."""
        grid, bins, most = self._grid, self._bins, self._parameters.max_particles
        injection = max(0.0, 1.0 - self._fast / self._slow) if self._slow else 0.0
        free = self._free_cells if injection else _NO_CELLS
        injection = injection if free.size else 0.0
        draws = self._random.random(out=self._numbers[: 3 * most if injection else most])
        clear_bins(bins.slots, bins.places, self._used)
        self._count, self._used = resample(
            self._poses, self._directions, self._weights, self._count, injection, draws,
            free, grid.cells.shape[1], grid.x, grid.y, grid.resolution, self._limits,
            self._other_poses, self._other_directions,
            bins.slots, bins.keys, bins.places, bins.of, self._cumulative, self._guide,
        )  # fmt: skip
        self._poses, self._other_poses = self._other_poses, self._poses
        self._directions, self._other_directions = self._other_directions, self._directions
        self._weights[: self._count] = 1.0 / self._count
        # Injected once, judged anew: otherwise particles would be scattered at every scan.
        if injection:
            self._slow = self._fast = 0.0
        self._summarise()

    def _spread(self, start: Pose2) -> None:
        """Draw all particles around the start pose."""
        p, most = self._parameters, self._count
        normals = self._random.standard_normal(out=self._numbers).reshape(3, most)
        variances = (p.initial_cov_xx, p.initial_cov_yy, p.initial_cov_aa)
        for axis, (mean, variance) in enumerate(
            zip((start.x, start.y, start.yaw), variances, strict=True)
        ):
            self._poses[axis] = mean + math.sqrt(variance) * normals[axis]
        self._directions[0], self._directions[1] = np.cos(self._poses[2]), np.sin(self._poses[2])
        bins = self._bins
        self._used = fill_bins(
            bins.slots, bins.keys, bins.places, bins.of, self._poses, self._count
        )
        self._summarise()

    def _summarise(self) -> None:
        """Keep what the particles say as they were drawn, before they move or are weighed."""
        bins, result = self._bins, self._result
        clusters = label_clusters(bins.slots, bins.keys, self._used, self._labels, self._stack)
        summarise(
            self._poses, self._directions, self._weights, self._count, bins.of, self._labels,
            clusters, self._sums, result,
        )  # fmt: skip
        x, y, yaw, mean_x, mean_y, mean_yaw, xx, xy, yy, turn = result.tolist()
        covariance = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, turn]])
        self.summary = CloudSummary(Pose2(x, y, yaw), Pose2(mean_x, mean_y, mean_yaw), covariance)

    @cached_property
    def _free_cells(self) -> Integers:
        """Flat indices of the map's free cells, wanted only when particles are injected."""
        return np.flatnonzero(self._grid.cells == FREE).astype(np.int32)
