"""Pure pursuit (Coulter 1992) of a path, for differential and omnidirectional bases."""

from __future__ import annotations

import math
from dataclasses import dataclass

from daemon.model.kernels import kernel
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.planner import SPACING, PlannedPath
from grammars.model.geometry import Floats, Pose2, Twist2, wrap_angle
from grammars.model.robot import Drive

_TURN_IN_PLACE, _TURNED = 0.9, 0.25
"""Bearing of the target at which turning on the spot begins and ends [rad]."""
_SIDEWAYS = 0.15
"""Speed of an omnidirectional base in directions its laser does not look [m/s]."""
_CLOSE = 0.35
"""Within this distance of a waypoint the base heads for the point itself, not the path [m]."""
_GAIN = 2.0
"""Turn rate per bearing error [1/s]."""
_LATERAL = 0.6
"""Highest lateral acceleration in a bend [m/s^2]."""


@kernel
def nearest_index(points: Floats, begin: int, end: int, x: float, y: float) -> int:
    """Return the index in [begin, end) of the path point nearest to (x, y)."""
    best, least = begin, 1e18
    for i in range(begin, end):
        away = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2
        if away < least:
            best, least = i, away
    return best


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """Speeds and accelerations of the pilot on this base: m/s, rad/s, m/s^2, rad/s^2."""

    speed: float
    sideways: float
    turn: float
    acceleration: float
    braking: float
    turn_acceleration: float
    holonomic: bool

    @staticmethod
    def of(drive: Drive, parameters: PilotParameters) -> DriveLimits:
        """Return what both the drive and the parameters allow."""
        holonomic = drive.kind == "omnidirectional"
        return DriveLimits(
            speed=min(drive.max_vx, parameters.max_speed),
            sideways=min(drive.max_vy, parameters.max_speed) if holonomic else 0.0,
            turn=min(drive.max_wz, parameters.max_turn),
            acceleration=min(drive.max_ax, parameters.acceleration),
            braking=min(drive.max_ax, max(1.0, parameters.acceleration)),
            turn_acceleration=min(drive.max_az, parameters.turn_acceleration),
            holonomic=holonomic,
        )


class Pursuit:
    """Follows one path: remembers how far it has come and whether it turns on the spot."""

    def __init__(self, path: PlannedPath, limits: DriveLimits, parameters: PilotParameters) -> None:
        self.path = path
        self.index = 0
        self._limits, self._parameters = limits, parameters
        self._turning = False

    @property
    def remaining(self) -> float:
        """Distance left along the path [m]."""
        return self.path.length - float(self.path.travelled[self.index])

    def locate(self, pose: Pose2) -> float:
        """Move on to the point of the path nearest to ``pose``; return the distance to it [m]."""
        points = self.path.points
        end = min(len(points), self.index + round(1.0 / SPACING))
        self.index = nearest_index(points, self.index, end, pose.x, pose.y)
        return math.hypot(points[self.index, 0] - pose.x, points[self.index, 1] - pose.y)

    def steer(self, pose: Pose2, speed: float) -> Twist2:
        """Return the wanted body-frame velocity at ``pose`` when driving at ``speed`` [m/s]."""
        limits, last = self._limits, self.path.points[-1]
        to_goal = math.hypot(last[0] - pose.x, last[1] - pose.y)
        if to_goal <= _CLOSE and self.remaining <= 2.0 * _CLOSE:
            return self._approach(pose, float(last[0]), float(last[1]), to_goal)
        ahead = self._parameters.lookahead + self._parameters.lookahead_time * speed
        target = self.path.points[self._index_ahead(ahead)]
        bearing = wrap_angle(math.atan2(target[1] - pose.y, target[0] - pose.x) - pose.yaw)
        if self._turns_in_place(bearing):
            return Twist2(0.0, 0.0, self._turn(bearing))
        top = min(limits.speed, math.sqrt(2.0 * limits.acceleration * max(self.remaining, 0.02)))
        distance = max(0.1, math.hypot(target[0] - pose.x, target[1] - pose.y))
        return self._along(bearing, distance, top)

    def turn_to(self, pose: Pose2, yaw: float) -> Twist2:
        """Return the turn on the spot towards a heading [rad]."""
        return Twist2(0.0, 0.0, self._turn(wrap_angle(yaw - pose.yaw)))

    def _along(self, bearing: float, distance: float, top: float) -> Twist2:
        limits = self._limits
        curvature = 2.0 * math.sin(bearing) / distance
        if abs(curvature) > 1e-6:
            top = min(top, limits.turn / abs(curvature), math.sqrt(_LATERAL / abs(curvature)))
        top *= max(0.3, math.cos(bearing))
        if limits.holonomic:
            sideways = max(-limits.sideways, min(limits.sideways, top * math.sin(bearing)))
            return Twist2(top * math.cos(bearing), 0.5 * sideways, self._turn(bearing))
        return Twist2(top, 0.0, top * curvature)

    def _approach(self, pose: Pose2, x: float, y: float, distance: float) -> Twist2:
        """Go for the goal itself: a holonomic base in any direction, others turn to it first."""
        limits = self._limits
        bearing = wrap_angle(math.atan2(y - pose.y, x - pose.x) - pose.yaw)
        top = min(limits.speed, math.sqrt(limits.acceleration * distance))
        if limits.holonomic:
            if abs(bearing) > _TURNED:
                top = min(top, _SIDEWAYS)
            return Twist2(top * math.cos(bearing), top * math.sin(bearing), 0.0)
        if abs(bearing) > 0.5 * math.pi and distance < 0.2:
            # A short way back is quicker and safer than turning around.
            bearing, top = wrap_angle(bearing + math.pi), -min(top, _SIDEWAYS)
        if self._turns_in_place(bearing):
            return Twist2(0.0, 0.0, self._turn(bearing))
        return Twist2(top, 0.0, self._turn(bearing))

    def _turns_in_place(self, bearing: float) -> bool:
        self._turning = abs(bearing) > (_TURNED if self._turning else _TURN_IN_PLACE)
        return self._turning

    def _turn(self, bearing: float) -> float:
        limits = self._limits
        rate = min(limits.turn, _GAIN * abs(bearing),
                   math.sqrt(1.6 * limits.turn_acceleration * abs(bearing)))  # fmt: skip
        return math.copysign(rate, bearing)

    def _index_ahead(self, distance: float) -> int:
        travelled = self.path.travelled
        wanted = travelled[self.index] + distance
        return min(len(travelled) - 1, int(travelled.searchsorted(wanted)))
