"""What the robot does within tolerance of the goal: stop, then turn."""

from __future__ import annotations

import math
from collections.abc import Callable

from daemon.navigation.ros.dwa._parameters import DwaParameters
from grammars.values import Pose2, Twist2, wrap_angle


class StopRotate:
    """base_local_planner ``LatchedStopRotateController``.

    ``latch`` keeps a goal position once reached until the next plan, though the estimate moves on.
    """

    def __init__(
        self, parameters: DwaParameters, period: float, *, latch: bool, raise_to_minimum: bool
    ) -> None:
        self._p = parameters
        self._period = period
        self._latch = latch
        self._raise_to_minimum = raise_to_minimum
        self._latched = False
        self._rotating = False

    def reset_latch(self) -> None:
        """Forget that the position was reached."""
        self._latched = False

    def position_reached(self, pose: Pose2, goal: Pose2) -> bool:
        """Whether ``pose`` is within ``xy_goal_tolerance`` of ``goal``, or was if latched."""
        near = math.hypot(goal.x - pose.x, goal.y - pose.y) <= self._p.xy_goal_tolerance
        reached = near or (self._latch and self._latched)
        self._latched = self._latched or reached
        return reached

    def goal_reached(self, pose: Pose2, twist: Twist2, goal: Pose2) -> bool:
        """Whether the robot stands at ``goal`` with its heading."""
        return (
            self.position_reached(pose, goal)
            and abs(wrap_angle(goal.yaw - pose.yaw)) <= self._p.yaw_goal_tolerance
            and self._stopped(twist)
        )

    def command(
        self, pose: Pose2, twist: Twist2, goal: Pose2, legal: Callable[[Twist2], bool]
    ) -> Twist2 | None:
        """Return the next command, ``None`` when it is not ``legal``."""
        error = wrap_angle(goal.yaw - pose.yaw)
        if abs(error) <= self._p.yaw_goal_tolerance:
            self._rotating = False
            return Twist2()
        if self._rotating or self._stopped(twist):
            self._rotating = True
            command = Twist2(0.0, 0.0, self._turn(error, twist.wz))
        else:
            command = self._slow_down(twist)
        return command if legal(command) else None

    def _stopped(self, twist: Twist2) -> bool:
        still = max(abs(twist.vx), abs(twist.vy)) <= self._p.trans_stopped_vel
        return still and abs(twist.wz) <= self._p.theta_stopped_vel

    def _slow_down(self, twist: Twist2) -> Twist2:
        def slower(speed: float, limit: float) -> float:
            return math.copysign(max(0.0, abs(speed) - limit * self._period), speed)

        p = self._p
        return Twist2(
            slower(twist.vx, p.acc_lim_x),
            slower(twist.vy, p.acc_lim_y),
            slower(twist.wz, p.acc_lim_theta),
        )

    def _turn(self, error: float, wz: float) -> float:
        p = self._p
        change = p.acc_lim_theta * self._period
        speed = min(p.max_vel_theta, max(p.min_vel_theta, abs(error)))
        speed = min(max(speed, abs(wz) - change), abs(wz) + change)
        speed = min(math.sqrt(2.0 * p.acc_lim_theta * abs(error)), speed)
        if self._raise_to_minimum:
            speed = max(p.min_vel_theta, speed)
        return math.copysign(min(p.max_vel_theta, speed), error)
