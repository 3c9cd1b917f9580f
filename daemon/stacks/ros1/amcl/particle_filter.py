"""Particle filter: the motion of the particles, their weights and their summary (amcl ``pf``).

Motion by odometry follows Thrun, Burgard and Fox, Probabilistic Robotics, section 5.4 (``diff``),
and the omni model of amcl (``AMCLOdom::UpdateAction``). N(s) below is zero-mean noise of standard
deviation s, drawn for each particle. The summary is the mean of the heaviest cluster and the spread
of all particles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.laser_model import Sensor, weigh_particles
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
from grammars.model.geometry import Floats, Pose2, wrap_angle
from grammars.model.grid import FREE, OccupancyGrid

Triple: TypeAlias = tuple[float, float, float]
_TURN_ON_THE_SPOT = 0.01
"""Least translation with a meaningful direction [m] (diff)."""


@dataclass(frozen=True, slots=True)
class OdometryMotion:
    """Motion by odometry since the last update: a translation at ``bearing`` [rad] and a turn.

    ``bearing`` is relative to the heading before the motion.
    """

    translation: float
    bearing: float
    turn: float


def motion_between(before: Pose2, after: Pose2) -> OdometryMotion:
    """Return the motion between two odometry poses."""
    dx, dy = after.x - before.x, after.y - before.y
    turn = wrap_angle(after.yaw - before.yaw)
    return OdometryMotion(math.hypot(dx, dy), wrap_angle(math.atan2(dy, dx) - before.yaw), turn)


def omni_spread(parameters: AmclParameters, motion: OdometryMotion) -> Triple:
    """Return the standard deviations of translation, rotation and strafing [m, rad, m]."""
    p, trans, rot = parameters, motion.translation**2, motion.turn**2
    return _deviations(
        p,
        p.odom_alpha3 * trans + p.odom_alpha4 * rot,
        p.odom_alpha1 * rot + p.odom_alpha2 * trans,
        p.odom_alpha4 * rot + p.odom_alpha5 * trans,
    )


def diff_turns(motion: OdometryMotion) -> tuple[float, float]:
    """Return the turns before and after the translation [rad]."""
    first = 0.0 if motion.translation < _TURN_ON_THE_SPOT else motion.bearing
    return first, wrap_angle(motion.turn - first)


def diff_spread(parameters: AmclParameters, motion: OdometryMotion) -> Triple:
    """Return the standard deviations of first turn, translation and second turn [rad, m, rad].

    Driving backwards is not a turn by pi: forwards and backwards have the same spread.
    """
    p, trans = parameters, motion.translation**2
    first, second = (
        min(abs(turn), abs(wrap_angle(turn - math.pi))) ** 2 for turn in diff_turns(motion)
    )
    return _deviations(
        p,
        p.odom_alpha1 * first + p.odom_alpha2 * trans,
        p.odom_alpha3 * trans + p.odom_alpha4 * (first + second),
        p.odom_alpha1 * second + p.odom_alpha2 * trans,
    )


def _deviations(parameters: AmclParameters, a: float, b: float, c: float) -> Triple:
    if parameters.odom_model_type.endswith("-corrected"):
        return math.sqrt(a), math.sqrt(b), math.sqrt(c)
    return a, b, c


def move_particles(
    parameters: AmclParameters,
    motion: OdometryMotion,
    cloud: Particles,
    count: int,
    normals: Floats,
    *,
    full_turns: bool = True,
) -> None:
    """Move the first ``count`` particles of ``cloud`` by ``motion``, each with its noise.

    ``normals`` (3 count,) are standard normal deviates. With ``full_turns`` driving backwards may
    add full turns to headings, as in the original (diff).
    """
    if parameters.odom_model_type.startswith("omni"):
        omni = motion.translation, motion.bearing, motion.turn
        _move_omni(cloud, count, normals, omni, omni_spread(parameters, motion))
    else:
        first, second = diff_turns(motion)
        diff = first, motion.translation, second
        _move_diff(cloud, count, normals, diff, diff_spread(parameters, motion), full_turns)


# Unlike grammars.model.geometry.wrap_angle, this one rounds, because machine code has no exact
# remainder. It changes the last bits of most angles, so traces depend on the choice.
@kernel
def wrap_angle_modulo(angle: float) -> float:
    """Map an angle [rad] to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def _move_omni(
    cloud: Particles, count: int, normals: Floats, motion: Triple, spread: Triple
) -> None:
    """``t = translation + N, r = turn + N, s = N``; move t along and s across the bearing."""
    poses, directions = cloud.poses, cloud.directions
    translation, bearing, turn = motion
    translation_sigma, turn_sigma, strafe_sigma = spread
    cb, sb = math.cos(bearing), math.sin(bearing)
    for i in range(count):
        c = cb * directions[0, i] - sb * directions[1, i]
        s = sb * directions[0, i] + cb * directions[1, i]
        along = translation + translation_sigma * normals[i]
        across = strafe_sigma * normals[2 * count + i]
        yaw = poses[2, i] + (turn + turn_sigma * normals[count + i])
        poses[0, i] += along * c + across * s
        poses[1, i] += along * s - across * c
        poses[2, i] = yaw
        directions[0, i] = math.cos(yaw)
        directions[1, i] = math.sin(yaw)


@kernel
def _move_diff(
    cloud: Particles, count: int, normals: Floats, motion: Triple, spread: Triple, full_turns: bool
) -> None:
    """Turn by ``first - N``, drive ``translation - N``, turn by ``second - N``.

    The turns are wrapped. With ``full_turns`` their sum is not: after driving backwards, which is
    two half turns, some headings are a full turn from others and fall into other bins.
    """
    poses, directions = cloud.poses, cloud.directions
    first, translation, second = motion
    first_sigma, translation_sigma, second_sigma = spread
    for i in range(count):
        before = wrap_angle_modulo(first - first_sigma * normals[i])
        along = translation - translation_sigma * normals[count + i]
        after = wrap_angle_modulo(second - second_sigma * normals[2 * count + i])
        heading = poses[2, i] + before
        turn = before + after if full_turns else wrap_angle_modulo(before + after)
        yaw = poses[2, i] + turn
        poses[0, i] += along * math.cos(heading)
        poses[1, i] += along * math.sin(heading)
        poses[2, i] = yaw
        directions[0, i] = math.cos(yaw)
        directions[1, i] = math.sin(yaw)


@kernel
def summarise(cloud: Particles, count: int, bins: Bins) -> Floats:
    """Return estimate (3), mean of all (3) and covariance of all: xx, xy, yy, yaw (4).

    The estimate is the weighted mean of the first cluster with the largest weight; headings are
    averaged on the circle. ``-2 ln R`` is the variance of headings with mean resultant length R.
    """
    poses, directions, weights = cloud.poses, cloud.directions, cloud.weights
    labels, clusters = label_clusters(bins)
    sums, result = np.zeros((clusters, 5)), np.empty(10)
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
    return result


class ParticleFilter:
    """Particles in two clouds that take turns: resampling draws from one into the other.

    ``pose`` is that of the heaviest cluster. ``mean`` and ``covariance`` (3, 3) are those of all
    particles, ``count`` their number.
    """

    def __init__(
        self, parameters: AmclParameters, quirks: Quirks, grid: OccupancyGrid, start: Pose2,
        random: np.random.Generator,
    ) -> None:  # fmt: skip
        most = parameters.max_particles
        self._parameters, self._grid, self._random = parameters, grid, random
        self._cloud, self._other = new_cloud(most), new_cloud(most)
        self.count, self._full_turns = most, quirks.amcl_reversing_splits_cloud
        self._slow = self._fast = 0.0
        self._limits, self._bins = particle_limits(parameters), new_bins(most)
        self._numbers = np.empty(3 * most)
        self._spread(start)

    @property
    def poses(self) -> Floats:
        """Particles, shape (n, 3): a view that the next update changes."""
        return self._cloud.poses[:, : self.count].T

    @property
    def weights(self) -> Floats:
        """Weights of the particles, shape (n,), sum 1: a view that the next update changes."""
        return self._cloud.weights[: self.count]

    def move(self, motion: OdometryMotion) -> None:
        """Move every particle by the odometry, with noise."""
        count = self.count
        normals = self._random.standard_normal(out=self._numbers[: 3 * count])
        move_particles(
            self._parameters, motion, self._cloud, count, normals, full_turns=self._full_turns
        )

    def weigh(self, sensor: Sensor, ranges: Singles) -> None:
        """Multiply weights by the likelihood of a scan and normalise them."""
        p = self._parameters
        # The total is above 0, because the likelihood of a scan is at least 1.
        total = weigh_particles(sensor, ranges, self._cloud, self.count)
        weights = self.weights
        weights /= total
        average = total / self.count
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
        self.count = resample(
            self._cloud, self.count, injection, draws, free, self._limits, self._other, bins
        )
        self._cloud, self._other = self._other, self._cloud
        self.weights[:] = 1.0 / self.count
        # Restart the averages after an injection, or every scan would scatter particles.
        if injection:
            self._slow = self._fast = 0.0
        self._summarise()

    def _spread(self, start: Pose2) -> None:
        """Draw all particles around the start pose."""
        p, (poses, directions, _) = self._parameters, self._cloud
        normals = self._random.standard_normal(out=self._numbers).reshape(3, self.count)
        variances = (p.initial_cov_xx, p.initial_cov_yy, p.initial_cov_aa)
        for axis, (mean, variance) in enumerate(
            zip((start.x, start.y, start.yaw), variances, strict=True)
        ):
            poses[axis] = mean + math.sqrt(variance) * normals[axis]
        directions[0], directions[1] = np.cos(poses[2]), np.sin(poses[2])
        fill_bins(self._bins, poses, self.count)
        self._summarise()

    def _summarise(self) -> None:
        """Summarise the particles as drawn, before they move or are weighed."""
        summary = summarise(self._cloud, self.count, self._bins).tolist()
        self.pose, self.mean = Pose2(*summary[:3]), Pose2(*summary[3:6])
        xx, xy, yy, turn = summary[6:]
        self.covariance: Floats = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, turn]])

    @cached_property
    def _no_cells(self) -> FreeCells:
        grid, none = self._grid, np.empty(0, dtype=np.int32)
        return FreeCells(none, grid.cells.shape[1], grid.x, grid.y, grid.resolution)

    @cached_property
    def _free_cells(self) -> FreeCells:
        """Free cells of the map, needed only to inject particles."""
        free = np.flatnonzero(self._grid.cells == FREE).astype(np.int32)
        return self._no_cells._replace(cells=free)
