"""Wheel odometry: the true motion with errors that grow with the way travelled."""

from __future__ import annotations

import math

import numpy as np

from daemon.sut import Odometry
from grammars.robot import OdometryNoise
from grammars.values import Pose2, Twist2, wrap_angle


class OdometrySensor:
    """Integrates noisy motion in the odom frame, from the start pose or the map's origin.

    Per update over a way d [m] and a turn a [rad] the distance gets an error of standard
    deviation translation * sqrt(d), the turn one of sqrt(rotation^2 |a| + drift^2 d): the
    variances grow linearly, so the statistics do not depend on the update rate.
    """

    def __init__(self, noise: OdometryNoise, start: Pose2, generator: np.random.Generator) -> None:
        self._noise = noise
        frame = start if noise.origin == "start" else Pose2()
        self._to_odom = frame.inverse()
        self._exact = noise.translation == noise.rotation == noise.drift == 0.0
        self._generator = generator
        self._truth, self._pose, self._time = start, self._to_odom @ start, 0.0

    def sample(self, time: float, truth: Pose2, twist: Twist2) -> Odometry:
        """Return the odometry at ``time`` [s]; draws two numbers per call unless noise free."""
        last, elapsed = self._pose, time - self._time
        if self._exact:
            self._pose = self._to_odom @ truth
        else:
            twist = self._err(truth, twist, elapsed)
        if self._noise.twist == "mean":
            twist = _mean(last, self._pose, elapsed)
        self._truth, self._time = truth, time
        return Odometry(time, self._pose, twist)

    def _err(self, truth: Pose2, twist: Twist2, elapsed: float) -> Twist2:
        """Add the way since the last sample to the pose, with errors; return the measured twist."""
        forward, turning = self._generator.standard_normal(2).tolist()
        noise, last, pose = self._noise, self._truth, self._pose
        dx, dy, turn = truth.x - last.x, truth.y - last.y, wrap_angle(truth.yaw - last.yaw)
        way = math.hypot(dx, dy)
        stretch = 1.0 + (forward * noise.translation / math.sqrt(way) if way > 0.0 else 0.0)
        error = turning * math.sqrt(noise.rotation**2 * abs(turn) + noise.drift**2 * way)
        # The step turned from the true world into the drifted odom frame.
        c, s = math.cos(pose.yaw - last.yaw), math.sin(pose.yaw - last.yaw)
        x, y = pose.x + stretch * (c * dx - s * dy), pose.y + stretch * (s * dx + c * dy)
        self._pose = Pose2(x, y, wrap_angle(pose.yaw + turn + error))
        spin = error / elapsed if elapsed > 0.0 else 0.0
        return Twist2(twist.vx * stretch, twist.vy * stretch, twist.wz + spin)


def _mean(before: Pose2, after: Pose2, elapsed: float) -> Twist2:
    """Return the mean velocity between two poses, in the frame of the later one."""
    if elapsed <= 0.0:
        return Twist2()
    vx, vy = (after.x - before.x) / elapsed, (after.y - before.y) / elapsed
    c, s = math.cos(after.yaw), math.sin(after.yaw)
    wz = wrap_angle(after.yaw - before.yaw) / elapsed
    return Twist2(c * vx + s * vy, c * vy - s * vx, wz)
