"""Shared parts of the controllers: answer, period, and the turn at the goal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from grammars.model.geometry import Floats, Twist2

NO_POINTS: Final[Floats] = np.empty((0, 2))


@dataclass(frozen=True, slots=True, eq=False)
class ControllerAnswer:
    """Result of one control cycle.

    ``twist`` is zero unless ``ok``. ``local_plan`` (points, 2) is its trajectory in odom, empty if
    the robot stops or turns at the goal.
    """

    ok: bool
    twist: Twist2
    local_plan: Floats


NO_VELOCITY: Final = ControllerAnswer(False, Twist2(), NO_POINTS)


def sim_period(frequency: float | None, default: float) -> float:
    """Return the period [s] of the dynamic window; 0.05 if ``frequency`` is not positive."""
    if frequency is None:
        return float(default)
    return 1.0 / frequency if frequency > 0.0 else 0.05


def slow_down(twist: Twist2, limits: tuple[float, float, float], period: float) -> Twist2:
    """Return the ``twist`` after one period of braking (``stopWithAccLimits``).

    ``limits`` are the accelerations ahead, sideways [m/s^2] and of turning [rad/s^2].
    """

    def slower(speed: float, limit: float) -> float:
        return math.copysign(max(0.0, abs(speed) - limit * period), speed)

    x, y, theta = limits
    return Twist2(slower(twist.vx, x), slower(twist.vy, y), slower(twist.wz, theta))


def turn_towards(
    error: float, wz: float, limits: tuple[float, float], acceleration: float, period: float,
    *, raised: bool,
) -> Twist2:  # fmt: skip
    """Return a turn on the spot by ``error`` [rad] (``rotateToGoal``).

    ``wz`` is the present turning speed, ``limits`` the slowest and the fastest [rad/s]. The robot
    can stop in time, unless ``raised`` lifts the speed to the slowest again.
    """
    (slowest, fastest), change = limits, acceleration * period
    speed = min(fastest, max(slowest, abs(error)))
    speed = min(max(speed, abs(wz) - change), abs(wz) + change)
    speed = min(math.sqrt(2.0 * acceleration * abs(error)), speed)
    if raised:
        speed = max(slowest, speed)
    return Twist2(0.0, 0.0, math.copysign(min(fastest, speed), error))
