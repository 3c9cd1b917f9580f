"""From a wanted velocity to a command: acceleration limits, the stop zone, room to the sides."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daemon.navigation.pilot._field import MapField
from daemon.navigation.pilot._guard import free_time, half_planes, nearest_other, outline
from daemon.navigation.pilot._parameters import PilotParameters
from daemon.navigation.pilot._pursuit import Limits
from grammars.robot import Robot
from grammars.values import Floats, Pose2, Twist2

STILL = Twist2()
_REACTION = 0.15
"""Time from a scan to the brakes [s]."""
_STRIDE = 0.04
"""Farthest a point of the footprint moves between two checks of the sweep [m]."""
_TIGHT = 0.3
"""Part of the safety margin that is kept when creeping through a tight spot."""
_LONGEST = 3.0
"""Longest look ahead [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What is around the base: ``points[:count]`` (n, 2) in its frame, ``known`` ones are walls.

    The first ``seen`` are returns of the latest scan, the others are remembered.
    """

    points: Floats
    known: npt.NDArray[np.uint8]
    seen: int
    count: int


class Guard:
    """Lets no command through that could not be stopped before the footprint meets something."""

    def __init__(
        self, robot: Robot, field: MapField, limits: Limits, parameters: PilotParameters
    ) -> None:
        self._planes, self._rim = half_planes(robot.footprint), outline(robot.footprint)
        self._radius = float(np.hypot(self._rim[:, 0], self._rim[:, 1]).max())
        self._field, self._limits, self._parameters = field, limits, parameters
        self._pose = np.zeros(3)

    @property
    def front(self) -> float:
        """How far the footprint reaches ahead of the base's origin [m]."""
        return float(self._rim[:, 0].max())

    def nearest(self, around: Surroundings) -> float:
        """Return the distance to the nearest thing in the scan that the map does not show [m]."""
        return nearest_other(self._planes, around.points, around.known, around.seen)

    def ramp(self, last: Twist2, wanted: Twist2, period: float) -> Twist2:
        """Return ``wanted`` as far as accelerations allow within ``period`` [s] of ``last``."""
        limits = self._limits
        speeding = limits.acceleration * period
        braking = limits.braking * period
        turning = limits.turn_acceleration * period
        return Twist2(
            _towards(last.vx, wanted.vx, speeding, braking),
            _towards(last.vy, wanted.vy, speeding, braking),
            _towards(last.wz, wanted.wz, turning, 2.0 * turning),
        )

    def limit(self, command: Twist2, pose: Pose2, around: Surroundings) -> Twist2:
        """Return ``command`` slowed down on its own arc until it is safe; ``STILL`` if it is not.

        The base can always stop before walls of the map. Before anything else it keeps a distance
        besides that grows with its speed, to ``stop_distance`` at full speed: what the map does
        not show may move. With little room beside it, it slows down.
        """
        speed, turn = math.hypot(command.vx, command.vy), abs(command.wz)
        if speed < 1e-3 and turn < 1e-3:
            return command
        margin = self._parameters.safety_margin
        safe = self._slowed(command, pose, around, margin)
        creep = min(self._parameters.creep_speed, self._limits.speed)
        pace = speed + self._radius * turn
        if self._pace(safe) >= min(creep, pace) - 1e-6:
            return safe
        # A tight spot may be passed with less room, as slowly as it can be watched.
        slow = _scaled(command, min(1.0, creep / pace))
        tight = self._slowed(slow, pose, around, _TIGHT * margin)
        return max(safe, tight, key=self._pace)

    def _pace(self, command: Twist2) -> float:
        """Return how fast the fastest point of the footprint may move [m/s]."""
        return math.hypot(command.vx, command.vy) + self._radius * abs(command.wz)

    def _slowed(self, command: Twist2, pose: Pose2, around: Surroundings, margin: float) -> Twist2:
        """Return ``command`` scaled down so that it keeps ``margin`` [m] around the footprint."""
        speed, turn = math.hypot(command.vx, command.vy), abs(command.wz)
        braking = self._limits.braking
        horizon = _LONGEST
        if speed > 1e-3:
            spare = self._parameters.stop_distance + 0.1
            horizon = min(_LONGEST, speed / braking + _REACTION + spare / speed)
        walls, others, room = self.free(command, pose, around, horizon, margin)
        if speed > 0.02:
            allowed = self._cap(room, speed)
            if walls < horizon:
                allowed = min(allowed, _stoppable(speed * (walls - _REACTION), braking))
            if others < horizon:
                allowed = min(allowed, self._keeping_off(speed * (others - _REACTION)))
            return _scaled(command, allowed / speed)
        if turn < 1e-3 or min(walls, others) >= horizon:
            return command
        angle = turn * (min(walls, others) - _REACTION)
        return _scaled(command, min(1.0, _stoppable(angle, self._limits.turn_acceleration) / turn))

    def free(
        self, command: Twist2, pose: Pose2, around: Surroundings, horizon: float, margin: float
    ) -> tuple[float, float, float]:
        """Return times [s] until walls and others come within ``margin``, and the room beside."""
        field = self._field
        self._pose[:] = pose.x, pose.y, pose.yaw
        pace = math.hypot(command.vx, command.vy) + self._radius * abs(command.wz)
        return free_time(
            self._planes, self._rim, around.points, around.known, around.count,
            field.surface, field.x, field.y, field.resolution, self._pose,
            command.vx, command.vy, command.wz, horizon, _STRIDE / max(pace, 0.02),
            margin,
        )  # fmt: skip

    def _keeping_off(self, distance: float) -> float:
        """Return the speed v that fits ``distance``: braking from v and stop_distance * v / top."""
        if distance <= 0.0:
            return 0.0
        braking = self._limits.braking
        spare = self._parameters.stop_distance / self._limits.speed
        return braking * (math.sqrt(spare * spare + 2.0 * distance / braking) - spare)

    def _cap(self, room: float, speed: float) -> float:
        """Return the highest speed with so much room beside the base."""
        parameters = self._parameters
        margin, ample = parameters.safety_margin, parameters.slow_clearance
        if room >= ample:
            return speed
        share = max(0.0, room - margin) / max(1e-6, ample - margin)
        creep = min(parameters.creep_speed, self._limits.speed)
        return min(speed, creep + share * (self._limits.speed - creep))


def _scaled(command: Twist2, scale: float) -> Twist2:
    return Twist2(command.vx * scale, command.vy * scale, command.wz * scale)


def _stoppable(distance: float, braking: float) -> float:
    """Return the speed from which one can stop within ``distance``."""
    return math.sqrt(2.0 * braking * distance) if distance > 0.0 else 0.0


def _towards(last: float, wanted: float, speeding: float, braking: float) -> float:
    """Move ``last`` towards ``wanted``: towards zero by ``braking``, away by ``speeding``."""
    change = wanted - last
    most = braking if last * change < 0.0 else speeding
    return last + max(-most, min(most, change))
