"""map -> odom as it follows from pose estimates and odometry, for those who write transforms."""

from __future__ import annotations

import math
from collections import deque
from typing import TypeAlias

from daemon.model import ros_messages as ros
from daemon.model.sut import Estimate, Odometry
from grammars.model.geometry import Pose2

Correction: TypeAlias = tuple[float, float, float, float]
"""x, y [m], qz, qw of odom in map."""


class MapCorrection:
    """Keeps the latest odometry, and says where odom lies in map.

    ``start`` is where the mission starts: it holds until there is an estimate.
    """

    def __init__(self, start: Pose2) -> None:
        self._start = start
        # Three seconds at 20 Hz: an estimate has the stamp of its scan, a few samples back.
        self._odometers: deque[Odometry] = deque(maxlen=64)
        self._localised = False

    def odometry(self, sample: Odometry) -> Correction | None:
        """Take a sample; return what follows from it, ``None`` but for the first one."""
        self._odometers.append(sample)
        if self._localised:
            return None
        return self._correct(self._start, sample.pose)

    def estimate(self, estimate: Estimate) -> Correction | None:
        """Return what follows from an estimate and odometry at that time.

        A pose that is not a number has no frame (``None``); viewers keep the one before.
        """
        return self._correct(estimate.pose, self._odometer_at(estimate.time))

    def _odometer_at(self, time: float) -> Pose2:
        """Return base_link in odom, carried on by its twist since the last sample."""
        for sample in reversed(self._odometers):
            if sample.time <= time:
                since, twist = time - sample.time, sample.twist
                way = Pose2(since * twist.vx, since * twist.vy, since * twist.wz)
                return sample.pose @ way if since > 0.0 else sample.pose
        return Pose2()

    def _correct(self, pose: Pose2, odometry: Pose2) -> Correction | None:
        """Return map -> odom such that ``odometry`` (base in odom) lies at ``pose`` in map."""
        self._localised = True
        turn = pose.yaw - odometry.yaw
        if not math.isfinite(turn):
            return None
        qz, qw = ros.yaw_quaternion(math.remainder(turn, math.tau))
        c, s = qw * qw - qz * qz, 2.0 * qz * qw
        x = pose.x - c * odometry.x + s * odometry.y
        y = pose.y - s * odometry.x - c * odometry.y
        return x, y, qz, qw
