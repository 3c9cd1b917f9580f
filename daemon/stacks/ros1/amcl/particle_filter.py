"""Particle filter: particles, their weights, and their summary (amcl ``pf``).

The summary is the mean of the heaviest cluster and the spread of all particles.
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
    Bins,
    FreeCells,
    Particles,
    clear_bins,
    fill_bins,
    label_clusters,
    new_bins,
    new_cloud,
    particle_limits,
    resample,
)
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import FREE, OccupancyGrid


@kernel
def summarise(
    cloud: Particles,
    count: int,
    bins: Bins,
    labels: Integers,
    clusters: int,
    sums: Floats,
    result: Floats,
) -> None:
    """Write estimate (3), mean of all (3) and covariance of all: xx, xy, yy, yaw (4).

    The estimate is the weighted mean of the first cluster with the largest weight; headings are
    averaged on the circle. ``-2 ln R`` is the variance of headings with mean resultant length R.
    ``sums`` (clusters, 5) is scratch.
    """
    poses, directions, weights = cloud.poses, cloud.directions, cloud.weights
    for k in range(clusters):
        for column in range(5):
            sums[k, column] = 0.0
    total = x_sum = y_sum = c_sum = s_sum = xx = xy = yy = 0.0
    for i in range(count):
        w, x, y = weights[i], poses[0, i], poses[1, i]
        wx, wy = w * x, w * y
        k = labels[bins.of[i]]
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


@dataclass(frozen=True, slots=True, eq=False)
class CloudSummary:
    """The ``pose`` of the heaviest cluster; ``mean`` and ``covariance`` (3, 3) of all particles."""

    pose: Pose2
    mean: Pose2
    covariance: Floats


class ParticleFilter:
    """Particles in two clouds that take turns: resampling draws from one into the other."""

    def __init__(
        self, parameters: AmclParameters, quirks: Quirks, grid: OccupancyGrid, start: Pose2,
        random: np.random.Generator,
    ) -> None:  # fmt: skip
        most = parameters.max_particles
        self._parameters, self._grid, self._random = parameters, grid, random
        self._cloud, self._other = new_cloud(most), new_cloud(most)
        self._count, self._full_turns = most, quirks.amcl_reversing_splits_cloud
        self._slow = self._fast = 0.0
        self._limits, self._bins = particle_limits(parameters), new_bins(most)
        self._numbers = np.empty(3 * most)
        self._cumulative, self._guide = np.empty(most + 1), np.empty(most, dtype=np.int32)
        self._labels, self._stack = np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32)
        self._sums, self._result = np.empty((most, 5)), np.empty(10)
        self._spread(start)

    @property
    def count(self) -> int:
        """Number of particles now."""
        return self._count

    @property
    def poses(self) -> Floats:
        """Particles, shape (n, 3): a view that the next update changes."""
        return self._cloud.poses[:, : self._count].T

    @property
    def weights(self) -> Floats:
        """Weights of the particles, shape (n,), sum 1: a view that the next update changes."""
        return self._cloud.weights[: self._count]

    def move(self, motion: OdometryMotion) -> None:
        """Move every particle by the odometry, with noise."""
        count = self._count
        normals = self._random.standard_normal(out=self._numbers[: 3 * count])
        move_particles(
            self._parameters, motion, self._cloud, count, normals, full_turns=self._full_turns
        )

    def weigh(self, sensor: LaserModel, ranges: Singles) -> None:
        """Multiply weights by the likelihood of a scan and normalise them."""
        p = self._parameters
        # The total is above 0, because the likelihood of a scan is at least 1.
        total = sensor.weigh(ranges, self._cloud, self._count)
        weights = self.weights
        weights /= total
        average = total / self._count
        # 0 stands for "unset": the first average is used unchanged.
        self._slow += (p.recovery_alpha_slow if self._slow else 1.0) * (average - self._slow)
        self._fast += (p.recovery_alpha_fast if self._fast else 1.0) * (average - self._fast)

    def resample(self) -> None:
        """Draw a new set of equally weighted particles; KLD sampling decides how many."""
        bins, most = self._bins, self._parameters.max_particles
        injection = max(0.0, 1.0 - self._fast / self._slow) if self._slow else 0.0
        free = self._free_cells if injection else self._no_cells
        injection = injection if free.cells.size else 0.0
        draws = self._random.random(out=self._numbers[: 3 * most if injection else most])
        clear_bins(bins)
        self._count = resample(
            self._cloud, self._count, injection, draws, free, self._limits, self._other, bins,
            self._cumulative, self._guide,
        )  # fmt: skip
        self._cloud, self._other = self._other, self._cloud
        self.weights[:] = 1.0 / self._count
        # Restart the averages after an injection, or every scan would scatter particles.
        if injection:
            self._slow = self._fast = 0.0
        self._summarise()

    def _spread(self, start: Pose2) -> None:
        """Draw all particles around the start pose."""
        p, (poses, directions, _) = self._parameters, self._cloud
        normals = self._random.standard_normal(out=self._numbers).reshape(3, self._count)
        variances = (p.initial_cov_xx, p.initial_cov_yy, p.initial_cov_aa)
        for axis, (mean, variance) in enumerate(
            zip((start.x, start.y, start.yaw), variances, strict=True)
        ):
            poses[axis] = mean + math.sqrt(variance) * normals[axis]
        directions[0], directions[1] = np.cos(poses[2]), np.sin(poses[2])
        fill_bins(self._bins, poses, self._count)
        self._summarise()

    def _summarise(self) -> None:
        """Summarise the particles as drawn, before they move or are weighed."""
        clusters = label_clusters(self._bins, self._labels, self._stack)
        summarise(
            self._cloud, self._count, self._bins, self._labels, clusters, self._sums, self._result
        )
        x, y, yaw, mean_x, mean_y, mean_yaw, xx, xy, yy, turn = self._result.tolist()
        covariance = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, turn]])
        self.summary = CloudSummary(Pose2(x, y, yaw), Pose2(mean_x, mean_y, mean_yaw), covariance)

    @cached_property
    def _no_cells(self) -> FreeCells:
        grid, none = self._grid, np.empty(0, dtype=np.int32)
        return FreeCells(none, grid.cells.shape[1], grid.x, grid.y, grid.resolution)

    @cached_property
    def _free_cells(self) -> FreeCells:
        """Free cells of the map, needed only to inject particles."""
        free = np.flatnonzero(self._grid.cells == FREE).astype(np.int32)
        return self._no_cells._replace(cells=free)
