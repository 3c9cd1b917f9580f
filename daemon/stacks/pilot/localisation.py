"""Localisation: odometry predicts the pose, scans matched to the map correct it.

:class:`Sensing` makes the pose, the surroundings and the obstacles of observations.

Gauss-Newton on the signed distance of the returns to the painted walls, as in direct scan
matching on a map gradient (Kohlbrecher et al. 2011, Hector SLAM), but signed: a wall pulls from
both sides and its painted thickness does no harm. The odometry enters through its information
matrix, so the solution is the update of an iterated Kalman filter.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel, machine_code
from daemon.model.sut import Briefing, Estimate, LaserScan, Observation, Odometry
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.maps import MapField, Scan, UnmappedObstacles, interpolate, project
from grammars.model.geometry import Floats, Point2, Pose2, wrap_angle
from grammars.model.robot import Laser, OdometryNoise

Triple: TypeAlias = tuple[float, float, float]

_INSET = 0.5
"""Mean depth of a wall behind its painted edge, as maps paint every cell a wall touches [cells]."""
_STENCIL = 1.5
"""Half the width over which the field gives the direction of a wall [cells]."""
_LEAST_SLOPE, _MOST_SLOPE = 0.3, 1.5
"""Bounds of the slope: 1 in a distance field, not so on ridges and at edges of the known map."""
_FEIGNED = 0.02
"""Part of the information across a corridor that its raster seems to give along it."""
_ITERATIONS = 12
_LEAST_INLIERS = 8
_NARROW = 0.05
"""Width of the matcher's weights when the pose is sure [m]."""
_SETTLED = 2e-4
"""A smaller step ends the matching [m]; half of it counts for the heading [rad]."""


@kernel
def _normal_equations(
    field: MapField,
    points: Floats,
    mean: Triple,
    eye: Point2,
    sigma: float,
    pose: Floats,
    width: float,
    sums: Floats,
) -> int:
    """Add the weighted normal equations at ``pose`` to ``sums`` (3, 4), the right side last.

    Weights are Geman-McClure's with scale ``width`` [m]; points farther than three widths from
    any wall (doors, people) count nothing. Returns the number of inliers.
    """
    size, surface = field.resolution, field.surface
    c, s = math.cos(pose[2] - mean[2]), math.sin(pose[2] - mean[2])
    inliers = 0
    last_x = last_y = 1e9
    for i in range(points.shape[0]):
        px, py = points[i, 0] - mean[0], points[i, 1] - mean[1]
        # Returns closer together than a cell share its error, so only the first counts.
        if (px - last_x) ** 2 + (py - last_y) ** 2 < size * size:
            continue
        last_x, last_y = px, py
        rx, ry = c * px - s * py, s * px + c * py
        u = (pose[0] + rx - field.x) / size - 0.5
        v = (pose[1] + ry - field.y) / size - 0.5
        residual = interpolate(surface, u, v) + _INSET * size
        if abs(residual) > 3.0 * width:
            continue
        # Right at a slanted wall the field follows the steps of the raster. A little further away
        # it shows the direction.
        gx = interpolate(surface, u + _STENCIL, v) - interpolate(surface, u - _STENCIL, v)
        gy = interpolate(surface, u, v + _STENCIL) - interpolate(surface, u, v - _STENCIL)
        steep = math.hypot(gx, gy)
        # A laser sees only faces that look towards it.
        faces = gx * (points[i, 0] - eye[0]) + gy * (points[i, 1] - eye[1]) <= 0.0
        sloped = _LEAST_SLOPE < steep / (2.0 * _STENCIL * size) < _MOST_SLOPE
        if not (faces and sloped):
            continue
        gx, gy = gx / steep, gy / steep
        row = (gx, gy, gy * rx - gx * ry, residual)
        ratio = residual / width
        weight = 1.0 / (sigma * (1.0 + ratio * ratio)) ** 2
        for k in range(3):
            for j in range(4):
                sums[k, j] += weight * row[k] * row[j]
        inliers += 1
    return inliers


@kernel
def _distrust_weak_direction(sums: Floats) -> None:
    """Remove false information of the map's raster from the worst direction, in place.

    The gradients of a painted wall are off by some degrees, so a corridor seems to give some
    information about the position along it.
    """
    a, b, c = sums[0, 0], sums[0, 1], sums[1, 1]
    middle, spread = 0.5 * (a + c), math.hypot(0.5 * (a - c), b)
    weak, feigned = max(1e-9, middle - spread), _FEIGNED * (middle + spread)
    cut = 1.0 - math.sqrt(max(0.0, weak - feigned) / weak)
    angle = 0.5 * math.atan2(2.0 * b, a - c)
    wx, wy = -math.sin(angle), math.cos(angle)
    for k in range(4):
        along = cut * (wx * sums[0, k] + wy * sums[1, k])
        sums[0, k], sums[1, k] = sums[0, k] - along * wx, sums[1, k] - along * wy
    for k in range(3):
        along = cut * (wx * sums[k, 0] + wy * sums[k, 1])
        sums[k, 0], sums[k, 1] = sums[k, 0] - along * wx, sums[k, 1] - along * wy


@kernel
def _invert(a: Floats, result: Floats) -> None:
    """Write the inverse of the symmetric positive definite ``a[:, :3]`` (3, 3) into ``result``."""
    for k in range(3):
        k1, k2 = (k + 1) % 3, (k + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            result[k, j] = a[k1, j1] * a[k2, j2] - a[k1, j2] * a[k2, j1]
    determinant = a[0, 0] * result[0, 0] + a[0, 1] * result[0, 1] + a[0, 2] * result[0, 2]
    for k in range(3):
        for j in range(3):
            result[k, j] /= determinant


@kernel
def match_scan(
    field: MapField,
    points: Floats,
    mean: Triple,
    eye: Point2,
    sigma: float,
    covariance: Floats,
    width: float,
) -> Triple:
    """Return the pose (x, y, yaw) of the base that fits a scan.

    ``points`` (n, 2) are its returns in the map, seen from the pose ``mean`` by a laser at
    ``eye``; ``sigma`` is the standard deviation of a return [m]. The weights narrow from
    ``width`` to ``_NARROW`` [m] (graduated non-convexity). ``covariance`` (3, 3) of the predicted
    pose becomes that of the result. Too few inliers change nothing.
    """
    prior, inverse = np.empty((3, 3)), np.empty((3, 3))
    pose, step = np.array(mean), np.empty(3)
    _invert(covariance, prior)
    for _ in range(_ITERATIONS):
        sums = np.zeros((3, 4))
        inliers = _normal_equations(field, points, mean, eye, sigma, pose, width, sums)
        if inliers < _LEAST_INLIERS:
            return mean
        _distrust_weak_direction(sums)
        for k in range(3):
            for j in range(3):
                sums[k, 3] += prior[k, j] * (pose[j] - mean[j])
                sums[k, j] += prior[k, j]
        _invert(sums, inverse)
        for k in range(3):
            step[k] = inverse[k, 0] * sums[0, 3] + inverse[k, 1] * sums[1, 3]
            step[k] += inverse[k, 2] * sums[2, 3]
            pose[k] -= step[k]
        settled = abs(step[0]) + abs(step[1]) < _SETTLED and abs(step[2]) < 0.5 * _SETTLED
        if settled and width <= _NARROW:
            break
        width = max(_NARROW, 0.6 * width)
    # Element by element: for arrays of two shapes numba compiles an error message, in 3 s.
    for k in range(3):
        for j in range(3):
            covariance[k, j] = inverse[k, j]
    return pose[0], pose[1], pose[2]


_WIDE: Final = 0.45
"""Width of the matcher's weights when the pose is unsure [m]."""
_RASTER: Final = 0.015
"""Error of one return beyond the laser's own noise, mostly the raster of the map [m]."""
_ALIKE: Final = 2.0
"""Number of neighbouring rays that share the error of a map cell and count as one."""
_MAP_COVARIANCE: Final = np.diag([0.02**2, 0.02**2, 0.005**2])
"""Systematic error of the map, which more scans do not average away [m^2, rad^2]."""
_LEVER: Final = 2.0
"""Lever arm that turns an error in heading into one in position [m]."""
_CAUTION: Final = 1.5
"""Factor on the variance in the odometry's description."""
_LEAST_NOISE: Final = 0.002**2
"""Variance of a displacement on top of the odometry's description, per metre or radian."""


class Localiser:
    """An iterated extended Kalman filter over x, y, yaw in the map frame.

    Odometry noise follows the robot's description. Errors of the map do not average out over
    scans, so they enter the reported covariance, not the filter's own.

    Attributes:
        pose: the best estimate of the base's pose in the map frame.
    """

    def __init__(
        self, field: MapField, noise: OdometryNoise, start: Pose2, parameters: PilotParameters
    ) -> None:
        self._field, self._noise = field, noise
        self.pose = self._spread_at = start
        position, heading = parameters.start_sigma**2, parameters.start_yaw_sigma**2
        self._covariance = np.diag([position, position, heading])
        self._last: Odometry | None = None
        self._odometry = Pose2()
        self._distance = self._turn = 0.0
        at, nothing = (0.0, 0.0, 0.0), np.empty((0, 2))
        sample = field, nothing, at, at[:2], 0.0, self._covariance, 0.0
        self._match = machine_code(match_scan, *sample)

    def estimate(self, time: float) -> Estimate:
        """Return the estimate with a covariance that includes the map's own error."""
        self._spread()
        return Estimate(time, self.pose, self._covariance + _MAP_COVARIANCE)

    def move(self, sample: Odometry) -> None:
        """Take a wheel odometry sample."""
        if self._last is None:
            self._odometry = sample.pose
        self._last = sample
        self._move_to(sample.pose)

    def move_until(self, time: float) -> None:
        """Predict to ``time`` [s] at the twist of the last sample."""
        last = self._last
        if last is not None and time > last.time:
            gap, twist = time - last.time, last.twist
            self._move_to(last.pose @ Pose2(twist.vx * gap, twist.vy * gap, twist.wz * gap))

    def correct(self, points: Floats, laser: Laser) -> None:
        """Match ``points`` (n, 2), the returns of a laser in the map as seen from the pose."""
        self._spread()
        covariance, pose = self._covariance, self.pose
        unsure = math.sqrt(covariance[0, 0] + covariance[1, 1])
        unsure += _LEVER * math.sqrt(covariance[2, 2])
        sigma = math.sqrt((laser.noise**2 + _RASTER**2) * _ALIKE)
        eye = pose.apply((laser.mount.x, laser.mount.y))
        mean, width = (pose.x, pose.y, pose.yaw), min(_WIDE, _NARROW + unsure)
        x, y, yaw = self._match(self._field, points, mean, eye, sigma, covariance, width)
        self.pose = self._spread_at = Pose2(x, y, wrap_angle(yaw))

    def _move_to(self, odometry: Pose2) -> None:
        step = self._odometry.inverse() @ odometry
        self._odometry, self.pose = odometry, self.pose @ step
        self._distance += math.hypot(step.x, step.y)
        self._turn += abs(step.yaw)

    def _spread(self) -> None:
        """Let the covariance grow by the way since its last growth."""
        noise, previous, covariance = self._noise, self._spread_at, self._covariance
        along = (_CAUTION * noise.translation**2 + _LEAST_NOISE) * self._distance
        around = (_CAUTION * noise.rotation**2 + _LEAST_NOISE) * self._turn
        around += (_CAUTION * noise.drift**2 + _LEAST_NOISE) * self._distance
        # An error of the heading moves the base across the way.
        lever = np.array((previous.y - self.pose.y, self.pose.x - previous.x, 0.0))
        across = np.outer(lever, covariance[:, 2])
        covariance += across + across.T
        covariance += np.outer(lever, lever) * covariance[2, 2]
        covariance += np.diag((along, along, around))
        self._spread_at, self._distance, self._turn = self.pose, 0.0, 0.0


class Surroundings(NamedTuple):
    """Points around the base: ``points`` (n, 2) in the map.

    The first m are the returns of the latest scan of each laser; ``is_wall`` (m,) flags those on
    walls of the map. The others are remembered obstacles.
    """

    points: Floats
    is_wall: npt.NDArray[np.uint8]


class Sensing:
    """State of the pose, the latest scan of each laser and the obstacles.

    All lasers see obstacles. The map is drawn at the height of the first laser. Only lasers at
    that height also correct the pose, because other heights may have other walls.

    Attributes:
        localiser: the estimate of the pose.
        obstacles: the obstacles that the map lacks.
        around: the surroundings at the latest scan.
    """

    def __init__(self, briefing: Briefing, field: MapField, parameters: PilotParameters) -> None:
        robot = briefing.robot
        self._lasers = {laser.name: laser for laser in robot.lasers}
        self._map_height = robot.laser.z
        scan = np.empty(0, dtype=np.float32), (0.0,) * 3, (0.0,) * 4
        self._project = machine_code(project, field, scan)
        self.localiser = Localiser(field, robot.odometry, briefing.start, parameters)
        self._field = field
        scans = parameters.obstacle_memory * sum(laser.rate for laser in robot.lasers)
        self.obstacles = UnmappedObstacles(field, max(1, round(scans)))
        nothing = np.empty((0, 2)), np.empty(0, dtype=np.uint8)
        self._returns = dict.fromkeys(self._lasers, nothing)
        self.around = Surroundings(*nothing)

    def take(self, observation: Observation) -> Estimate | None:
        """Take a new observation; return a new estimate when it has a scan."""
        localiser = self.localiser
        samples = list(observation.odometry)
        for scan in observation.scans:
            while samples and samples[0].time <= scan.time:
                localiser.move(samples.pop(0))
            localiser.move_until(scan.time)
            self._look(scan)
        for sample in samples:
            localiser.move(sample)
        localiser.move_until(observation.time)
        return localiser.estimate(observation.time) if observation.scans else None

    def _look(self, scan: LaserScan) -> None:
        """Correct the pose by a scan, then update the obstacles and the surroundings."""
        laser = self._lasers[scan.laser]
        if laser.z == self._map_height:
            _, _, sure = self._project(self._field, self._placed(scan, laser))
            self.localiser.correct(sure, laser)
        placed = self._placed(scan, laser)
        points, is_wall, _ = self._project(self._field, placed)
        self.obstacles.update(placed, points, is_wall)
        self._returns[scan.laser] = points, is_wall
        returns, flags = zip(*self._returns.values(), strict=True)
        everything = np.concatenate((*returns, self.obstacles.centres))
        self.around = Surroundings(everything, np.concatenate(flags))

    def _placed(self, scan: LaserScan, laser: Laser) -> Scan:
        """Return a scan at the pose; raises ``ValueError`` for a wrong number of rays."""
        if scan.ranges.shape != (laser.rays,):
            raise ValueError(f"a scan of {scan.ranges.size} rays from a laser of {laser.rays}")
        at = self.localiser.pose @ laser.mount
        reach = laser.range_min, laser.range_max
        angles = laser.angle_min, laser.angle_increment
        return scan.ranges, (at.x, at.y, at.yaw), (*angles, *reach)
