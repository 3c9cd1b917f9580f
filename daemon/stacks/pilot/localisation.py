"""Where the robot is: odometry predicts, scans correct, a covariance says how sure that is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daemon.model.kernels import kernel
from daemon.model.sut import Estimate, Odometry
from daemon.stacks.kernels import wrap_angle_modulo
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.map_field import MapField
from daemon.stacks.pilot.scan_matching import match_scan
from grammars.model.geometry import Floats, Pose2, Twist2
from grammars.model.robot import Laser, OdometryNoise


@kernel
def predict_pose(
    mean: Floats,
    covariance: Floats,
    dx: float,
    dy: float,
    turn: float,
    var_along: float,
    var_turn: float,
) -> None:
    """Move ``mean`` and ``covariance`` in place by a body-frame displacement (dx, dy, turn).

    ``var_along`` [m^2] is the variance of each translation component, ``var_turn`` [rad^2] that
    of the turn.
    """
    c, s = math.cos(mean[2]), math.sin(mean[2])
    wx, wy = c * dx - s * dy, s * dx + c * dy
    mean[0] += wx
    mean[1] += wy
    mean[2] = wrap_angle_modulo(mean[2] + turn)
    pxt, pyt, ptt = covariance[0, 2], covariance[1, 2], covariance[2, 2]
    covariance[0, 0] += -2.0 * wy * pxt + wy * wy * ptt + var_along
    covariance[0, 1] += wx * pxt - wy * pyt - wx * wy * ptt
    covariance[1, 1] += 2.0 * wx * pyt + wx * wx * ptt + var_along
    covariance[0, 2] = pxt - wy * ptt
    covariance[1, 2] = pyt + wx * ptt
    covariance[2, 2] = ptt + var_turn
    covariance[1, 0], covariance[2, 0] = covariance[0, 1], covariance[0, 2]
    covariance[2, 1] = covariance[1, 2]


_ITERATIONS = 12
_LEAST_INLIERS = 8
_NARROW, _WIDE = 0.05, 0.45
"""Kernel widths of the matcher when it is sure of the pose and when it is not [m]."""
_LEVER = 2.0
"""Distance at which an error in heading is felt [m]."""
_FEW = 0.6
"""With a smaller share of returns near walls, the pose is doubted."""
_DOUBT, _YAW_DOUBT = 0.01, 0.01
"""Standard deviations added per scan in doubt [m, rad]."""
_LEARNING = 0.03
"""How fast the depth of walls behind their painted edge is learned, per scan."""
_CAUTION = 1.5
"""Odometry is trusted with this many times the variance its description gives."""
_LEAST_NOISE = 0.002
"""Noise of a displacement beyond what the odometry's description says [m or rad per sqrt]."""


@dataclass(frozen=True, slots=True, eq=False)
class _LaserView:
    """Where a laser sits on the base (x, y, yaw), and the error a return of it counts with [m]."""

    mount: Floats
    sigma: float

    @classmethod
    def of(cls, laser: Laser, parameters: PilotParameters) -> _LaserView:
        """Return the view of a laser, as it is mounted."""
        mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        spread = laser.noise**2 + parameters.range_sigma**2
        return cls(mount, math.sqrt(max(spread, 1e-6) * parameters.independent_rays))


class Localiser:
    """An iterated extended Kalman filter over x, y, yaw in the map frame.

    Odometry noise follows the robot's description. Errors of the map itself do not average out
    over scans; they are added to the covariance that is reported, not to the filter's own.

    Maps differ in which cells a wall paints (those it touches, or those whose centre it covers),
    so walls stand up to a cell behind or before their painted edge. The mean residual of matched
    scans tells how much: between walls on both sides no pose explains it away. It is learned
    slowly.
    """

    def __init__(
        self,
        field: MapField,
        lasers: Sequence[Laser],
        noise: OdometryNoise,
        start: Pose2,
        parameters: PilotParameters,
    ) -> None:
        self._field, self._noise = field, noise
        self._views = {laser.name: _LaserView.of(laser, parameters) for laser in lasers}
        self._mean = np.array([start.x, start.y, start.yaw])
        position, heading = parameters.start_sigma**2, parameters.start_yaw_sigma**2
        self._covariance = np.diag([position, position, heading])
        bias, turned = parameters.map_sigma**2, parameters.map_yaw_sigma**2
        self._bias = np.diag([bias, bias, turned])
        # Where walls paint every cell they touch, this is the mean depth behind the edge.
        self._inset = 0.5 * field.resolution
        self._last: Odometry | None = None
        self._reference: Pose2 | None = None

    @property
    def pose(self) -> Pose2:
        """The best estimate of the base's pose in the map frame."""
        x, y, yaw = self._mean.tolist()
        return Pose2(x, y, yaw)

    def estimate(self, time: float) -> Estimate:
        """Return the estimate with a covariance that includes the map's own error."""
        return Estimate(time, self.pose, self._covariance + self._bias)

    def move(self, sample: Odometry) -> None:
        """Take a wheel odometry sample."""
        self._move_to(sample.pose)
        self._last = sample

    def move_until(self, time: float, following: Odometry | None = None) -> None:
        """Predict to ``time`` [s]: towards the sample ``following``, else at the last twist."""
        last = self._last
        if last is None or time <= last.time:
            return
        if following is not None and following.time > last.time:
            ahead = last.pose.inverse() @ following.pose
            share = min(1.0, (time - last.time) / (following.time - last.time))
            step = Pose2(ahead.x * share, ahead.y * share, ahead.yaw * share)
        else:
            twist: Twist2 = last.twist
            gap = time - last.time
            step = Pose2(twist.vx * gap, twist.vy * gap, twist.wz * gap)
        self._move_to(last.pose @ step)

    def correct(self, points: Floats, count: int, laser: str = "") -> int:
        """Match returns ``points[:count]`` (base frame) to the map; return how many fit.

        ``laser`` is the name of the one that saw them.
        """
        field, covariance, view = self._field, self._covariance, self._views[laser]
        unsure = math.sqrt(covariance[0, 0] + covariance[1, 1])
        unsure += _LEVER * math.sqrt(covariance[2, 2])
        inliers, residual = match_scan(
            field.surface, field.x, field.y, field.resolution, points, count, view.mount,
            self._mean, covariance, self._inset, min(_WIDE, _NARROW + unsure), _NARROW,
            view.sigma, _ITERATIONS, _LEAST_INLIERS,
        )  # fmt: skip
        if inliers >= _LEAST_INLIERS:
            learned = self._inset - _LEARNING * residual
            self._inset = max(-field.resolution, min(field.resolution, learned))
        if inliers < _FEW * count:
            covariance[0, 0] += _DOUBT**2
            covariance[1, 1] += _DOUBT**2
            covariance[2, 2] += _YAW_DOUBT**2
        return inliers

    def _move_to(self, odometry: Pose2) -> None:
        reference, self._reference = self._reference, odometry
        if reference is None:
            return
        step = reference.inverse() @ odometry
        distance, turn = math.hypot(step.x, step.y), abs(step.yaw)
        noise = self._noise
        along = (_CAUTION * noise.translation**2 + _LEAST_NOISE**2) * distance
        around = (_CAUTION * noise.rotation**2 + _LEAST_NOISE**2) * turn
        around += (_CAUTION * noise.drift**2 + _LEAST_NOISE**2) * distance
        predict_pose(self._mean, self._covariance, step.x, step.y, step.yaw, along, around)
