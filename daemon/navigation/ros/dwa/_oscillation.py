"""The memory that keeps the robot from going back and forth on the spot."""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import Integers
from grammars.values import Pose2, Twist2

_VX, _VY, _WZ = 0, 2, 4


class Oscillation:
    """Directions ruled out (base_local_planner ``OscillationCostFunction``).

    ``banned`` (6,) holds a flag each for negative and positive vx, vy, wz: after a change of sign
    the old sign is ruled out until the robot has moved or turned far enough.
    """

    def __init__(self, distance: float, angle: float) -> None:
        self.banned: Integers = np.zeros(6, dtype=np.int32)
        self._last_signs = [0, 0, 0]
        self._distance, self._angle = distance, angle
        self._turned_at = Pose2()

    def reset(self) -> None:
        """Forget everything."""
        self.banned[:] = 0
        self._last_signs = [0, 0, 0]

    def chosen(self, pose: Pose2, twist: Twist2, min_vel_trans: float) -> None:
        """Take in what was commanded at ``pose``; sideways and turning count only when slow."""
        flipped = self._take(_VX, twist.vx)
        if abs(twist.vx) <= min_vel_trans:
            flipped |= self._take(_VY, twist.vy)
            flipped |= self._take(_WZ, twist.wz)
        if flipped:
            self._turned_at = pose
        if self.banned.any() and self._moved(pose):
            self.reset()

    def _take(self, place: int, speed: float) -> bool:
        """Remember the sign of ``speed`` and rule out the other one when it changed."""
        sign = (speed > 0.0) - (speed < 0.0)
        if sign == 0:
            return False
        last, self._last_signs[place // 2] = self._last_signs[place // 2], sign
        if last != -sign:
            return False
        self.banned[place if sign > 0 else place + 1] = 1
        return True

    def _moved(self, pose: Pose2) -> bool:
        dx, dy = pose.x - self._turned_at.x, pose.y - self._turned_at.y
        far = dx * dx + dy * dy > self._distance * self._distance
        return far or abs(pose.yaw - self._turned_at.yaw) > self._angle
