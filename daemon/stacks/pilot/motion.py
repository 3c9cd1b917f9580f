"""Motion: pure pursuit of a path (Coulter 1992), a guard behind it, ways out of a tight spot.

The guard passes a command only if the robot can stop before the footprint meets something. It
sweeps the footprint along the arc of the command. Obstacles are returns of the lasers, remembered
obstacles and the walls of the map. A point closer than the margin only stops motion that brings
it closer still, so that a robot can always back out of a tight spot.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from daemon.model.kernels import kernel, machine_code
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.localisation import Surroundings
from daemon.stacks.pilot.maps import MapField, PlannedPath, interpolate
from grammars.model.geometry import Floats, Point2, Pose2, Ring, Twist2, wrap_angle
from grammars.model.robot import Drive

STILL: Final = Twist2()
ESCAPES: Final = (
    ("backing off", Twist2(-0.15, 0.0, 0.0)),
    ("turning left", Twist2(0.0, 0.0, 0.5)),
    ("turning right", Twist2(0.0, 0.0, -0.5)),
)
"""Motions out of a tight spot by name."""
_TURN_IN_PLACE, _TURNED = 0.9, 0.25
"""Bearing of the target where turning on the spot begins and ends [rad]."""
_GAIN: Final = 2.0
"""Turn rate per bearing error [1/s]."""
_TURN_ACCELERATION: Final = 1.5
"""Highest acceleration of turns, also bounded by the drive [rad/s^2]."""
_LATERAL: Final = 0.6
"""Highest lateral acceleration in a bend [m/s^2]."""
_LOOKAHEAD_TIME: Final = 0.6
"""Driving time that extends the lookahead [s]."""


class DriveLimits:
    """Limits of the drive and the parameters together: m/s, rad/s, m/s^2, rad/s^2."""

    def __init__(self, drive: Drive, parameters: PilotParameters) -> None:
        self.speed = min(drive.max_vx, parameters.max_speed)
        self.turn = min(drive.max_wz, parameters.max_turn)
        self.acceleration = min(drive.max_ax, parameters.acceleration)
        self.braking = min(drive.max_ax, max(1.0, parameters.acceleration))
        self.turn_acceleration = min(drive.max_az, _TURN_ACCELERATION)

    def towards(self, bearing: float) -> float:
        """Return the turn rate that reduces a bearing error [rad]."""
        rate = math.sqrt(1.6 * self.turn_acceleration * abs(bearing))
        return math.copysign(min(self.turn, _GAIN * abs(bearing), rate), bearing)

    def ramp(self, last: Twist2, target: Twist2, period: float) -> Twist2:
        """Return the velocity towards ``target`` that is possible ``period`` [s] after ``last``."""
        turning = self.turn_acceleration * period
        speeding, braking = self.acceleration * period, self.braking * period
        return Twist2(
            _ramp_axis(last.vx, target.vx, speeding, braking), 0.0,
            _ramp_axis(last.wz, target.wz, turning, 2.0 * turning),
        )  # fmt: skip


def _ramp_axis(last: float, target: float, speeding: float, braking: float) -> float:
    """Move ``last`` towards ``target``: towards zero by ``braking``, away by ``speeding``."""
    change = target - last
    most = braking if last * change < 0.0 else speeding
    return last + max(-most, min(most, change))


def scaled(command: Twist2, scale: float) -> Twist2:
    """Return a command on the same arc, faster or slower."""
    return Twist2(command.vx * scale, 0.0, command.wz * scale)


def stoppable(distance: float, braking: float) -> float:
    """Return the highest speed that still allows a stop within ``distance``."""
    return math.sqrt(2.0 * braking * max(0.0, distance))


class Pursuit:
    """Pursuit of one path, with the progress along it and whether the robot turns on the spot.

    Attributes:
        index: the point of the path nearest to the base.
    """

    def __init__(self, path: PlannedPath, limits: DriveLimits, lookahead: float) -> None:
        self.path, self.index = path, 0
        self._points: list[Point2] = path.points.tolist()
        self._limits, self._lookahead = limits, lookahead
        self._turning = False

    @property
    def remaining(self) -> float:
        """Distance left along the path [m]."""
        return (len(self._points) - 1 - self.index) * self.path.spacing

    def locate(self, pose: Pose2) -> float:
        """Advance while the path comes nearer to ``pose``; return the distance to it [m]."""
        here = (pose.x, pose.y)
        away = math.dist(self._points[self.index], here)
        for point in self._points[self.index + 1 :]:
            if math.dist(point, here) > away:
                break
            away = math.dist(point, here)
            self.index += 1
        return away

    def steer(self, pose: Pose2, speed: float) -> Twist2:
        """Return the body-frame velocity to aim at, at ``pose`` and ``speed`` [m/s]."""
        limits = self._limits
        ahead = math.ceil((self._lookahead + _LOOKAHEAD_TIME * speed) / self.path.spacing)
        x, y = self._points[min(len(self._points) - 1, self.index + ahead)]
        bearing = wrap_angle(math.atan2(y - pose.y, x - pose.x) - pose.yaw)
        self._turning = abs(bearing) > (_TURNED if self._turning else _TURN_IN_PLACE)
        if self._turning:
            return Twist2(0.0, 0.0, limits.towards(bearing))
        curvature = 2.0 * math.sin(bearing) / max(0.1, math.hypot(x - pose.x, y - pose.y))
        top = min(limits.speed, stoppable(max(self.remaining, 0.02), limits.acceleration))
        if abs(curvature) > 1e-6:
            top = min(top, limits.turn / abs(curvature), math.sqrt(_LATERAL / abs(curvature)))
        top *= max(0.3, math.cos(bearing))
        return Twist2(top, 0.0, top * curvature)


class Hull(NamedTuple):
    """A convex footprint: its edges ``planes`` (m, 3) and points ``rim`` (n, 2) on them [m].

    An edge is its outward unit normal and offset. A point is outside by
    ``max(normal . p - offset)`` metres: exact beside edges, less at corners.
    """

    planes: Floats
    rim: Floats


def hull_of(footprint: Ring) -> Hull:
    """Return the hull of a ring, counter-clockwise, with points at most 0.1 m apart."""
    planes, rim = [], []
    for (ax, ay), (bx, by) in zip(footprint, footprint[1:] + footprint[:1], strict=True):
        length = math.hypot(bx - ax, by - ay)
        nx, ny = (by - ay) / length, (ax - bx) / length
        planes.append((nx, ny, nx * ax + ny * ay))
        steps = math.ceil(length / 0.1)
        rim += [(ax + (bx - ax) * k / steps, ay + (by - ay) * k / steps) for k in range(steps)]
    return Hull(np.array(planes), np.array(rim))


@kernel
def _distance_outside(planes: Floats, x: float, y: float) -> float:
    """Return the distance of a point of the base frame outside the footprint [m]."""
    most = -1e9
    for k in range(planes.shape[0]):
        most = max(most, planes[k, 0] * x + planes[k, 1] * y - planes[k, 2])
    return most


@kernel
def keep_clear(
    hull: Hull,
    around: Surroundings,
    field: MapField,
    pose: tuple[float, float, float],
    command: tuple[float, float],
    look: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    """Return two times [s] and two distances [m] for the command (vx, wz).

    The times pass until a wall of the map, and until anything else, comes too near. The distances
    are the least one to points beside the way, and the one to the nearest return off walls.

    ``look`` holds the horizon of the times [s], the step of the sweep [s], the margin around the
    footprint [m] and the greatest distance of points from the base that matter [m].
    """
    # One kernel, because the same sweep serves points and walls.
    (vx, wz), (horizon, step, margin, reach) = command, look
    planes, rim, points = hull.planes, hull.rim, around.points
    steps = max(1, math.ceil(horizon / step))
    sweep = np.empty((steps + 1, 4))
    x = y = 0.0
    for k in range(steps + 1):
        sweep[k, 0], sweep[k, 1] = x, y
        sweep[k, 2], sweep[k, 3] = math.cos(k * step * wz), math.sin(k * step * wz)
        c, s = math.cos((k + 0.5) * step * wz), math.sin((k + 0.5) * step * wz)
        x, y = x + step * (c * vx), y + step * (s * vx)
    walls = others = horizon
    room = nearest = 1e9
    c0, s0 = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        x, y = points[i, 0] - pose[0], points[i, 1] - pose[1]
        if x * x + y * y > reach * reach:
            continue
        x, y = c0 * x + s0 * y, c0 * y - s0 * x
        before = _distance_outside(planes, x, y)
        wall = i < around.is_wall.shape[0] and around.is_wall[i] != 0
        if i < around.is_wall.shape[0] and not wall:
            nearest = min(nearest, before)
        # A point within the margin only counts if it comes closer by more than 2 mm. Otherwise the
        # robot could never leave a tight spot.
        limit = min(margin, before - 0.002)
        end = walls if wall else others
        least, away, is_met, is_closing = before, before, False, False
        for k in range(1, steps + 1):
            if k * step > end:
                break
            dx, dy, c, s = x - sweep[k, 0], y - sweep[k, 1], sweep[k, 2], sweep[k, 3]
            previous, away = away, _distance_outside(planes, c * dx + s * dy, c * dy - s * dx)
            is_closing = away < previous - 1e-6
            least = min(least, away)
            if away < limit:
                is_met = True
                if wall:
                    walls = (k - 1) * step
                else:
                    others = (k - 1) * step
                break
        # Points ahead of the end of the sweep, and points behind it, are not beside the way.
        is_behind = least >= before and away > before + 0.01
        if not is_met and not is_closing and not is_behind:
            room = min(room, least)
    for i in range(rim.shape[0]):
        limit = margin
        for k in range(steps + 1):
            if k * step > walls:
                break
            rx, ry, c, s = rim[i, 0], rim[i, 1], sweep[k, 2], sweep[k, 3]
            x, y = sweep[k, 0] + c * rx - s * ry, sweep[k, 1] + s * rx + c * ry
            u = (pose[0] + c0 * x - s0 * y - field.x) / field.resolution - 0.5
            v = (pose[1] + s0 * x + c0 * y - field.y) / field.resolution - 0.5
            away = interpolate(field.surface, u, v)
            if k == 0:
                limit = min(margin, away - 0.002)
            elif away < limit:
                walls = (k - 1) * step
                break
    return walls, others, room, nearest


_REACTION: Final = 0.15
"""Time from a scan to the brakes [s]."""
_STRIDE: Final = 0.04
"""Farthest motion of a point of the footprint between two checks of the sweep [m]."""
_AMPLE: Final = 0.35
"""Room beside the robot below which it slows down [m]."""
_KEPT_OFF: Final = 0.02
"""Margin around the footprint on a way out [m]."""
_BESIDE: Final = 0.5
"""Greatest distance of points from the swept footprint that matter [m]."""
_TIGHT: Final = 0.3
"""Part of the safety margin that remains in a tight spot."""
_LONGEST: Final = 3.0
"""Longest look ahead [s]."""
_CREEP: Final = 0.12
"""Speed in tight spots [m/s]."""


class CollisionGuard:
    """Guard that slows commands down so that the footprint meets nothing.

    Attributes:
        nearest: the distance to the nearest return that is not a wall of the map [m].
    """

    def __init__(
        self, hull: Hull, field: MapField, limits: DriveLimits, parameters: PilotParameters
    ) -> None:
        self._hull, self._field, self._limits = hull, field, limits
        self._margin, self._spare = parameters.safety_margin, parameters.stop_distance
        self._radius = float(np.hypot(hull.rim[:, 0], hull.rim[:, 1]).max())
        self._creep = min(_CREEP, limits.speed)
        self.nearest = math.inf
        nothing = Surroundings(np.empty((0, 2)), np.empty(0, dtype=np.uint8))
        sample = hull, nothing, field, (0.0,) * 3, (0.0,) * 2, (0.0,) * 4
        self._keep_clear = machine_code(keep_clear, *sample)

    def limit(self, command: Twist2, pose: Pose2, around: Surroundings) -> Twist2:
        """Return ``command`` slowed down on its own arc until it is safe, down to ``STILL``.

        The base can always stop before walls of the map. Other things may move, so it also keeps
        a distance to them that grows with its speed, up to ``stop_distance``. With little room
        beside it, it slows down.
        """
        pace = self._pace(command)
        if pace < 1e-3:
            self._look(command, pose, around, _LONGEST, self._margin)
            return command
        safe = self._slowed(command, pose, around, self._margin)
        if self._pace(safe) >= min(self._creep, pace) - 1e-6:
            return safe
        # The robot may pass a tight spot with less room if it creeps.
        slow = scaled(command, min(1.0, self._creep / pace))
        tight = self._slowed(slow, pose, around, _TIGHT * self._margin)
        return max(safe, tight, key=self._pace)

    def _pace(self, command: Twist2) -> float:
        """Return a bound of the speed of any point of the footprint [m/s]."""
        return abs(command.vx) + self._radius * abs(command.wz)

    def _slowed(self, command: Twist2, pose: Pose2, around: Surroundings, margin: float) -> Twist2:
        """Return ``command`` scaled down so that it keeps ``margin`` [m] around the footprint."""
        speed, turn = abs(command.vx), abs(command.wz)
        limits, horizon = self._limits, _LONGEST
        if speed > 0.02:
            brakes = speed / limits.braking + _REACTION + (self._spare + 0.1) / speed
            horizon = min(_LONGEST, brakes)
        walls, others, room = self._look(command, pose, around, horizon, margin)
        if speed > 0.02:
            ample = max(1e-6, _AMPLE - self._margin)
            share = max(0.0, min(1.0, (room - self._margin) / ample))
            allowed = self._creep + share * (limits.speed - self._creep)
            if walls < horizon:
                way = speed * (walls - _REACTION)
                allowed = min(allowed, stoppable(way, limits.braking))
            if others < horizon:
                # The highest speed v so that braking and stop_distance * v / top fit into the way.
                way = max(0.0, speed * (others - _REACTION))
                spare, braking = self._spare / limits.speed, limits.braking
                keeping_off = math.sqrt(spare * spare + 2.0 * way / braking) - spare
                allowed = min(allowed, braking * keeping_off)
            return scaled(command, min(1.0, allowed / speed))
        free = min(walls, others)
        if turn < 1e-3 or free >= horizon:
            return command
        fast = stoppable(turn * (free - _REACTION), limits.turn_acceleration)
        return scaled(command, min(1.0, fast / turn))

    def free(self, command: Twist2, pose: Pose2, around: Surroundings, horizon: float) -> float:
        """Return the time [s], at most ``horizon``, for which a way out stays free."""
        walls, others, _ = self._look(command, pose, around, horizon, _KEPT_OFF)
        return min(walls, others)

    def _look(
        self, command: Twist2, pose: Pose2, around: Surroundings, horizon: float, margin: float
    ) -> tuple[float, float, float]:
        """Return the times [s], at most ``horizon``, and the room [m] of a command."""
        pace = max(self._pace(command), 0.02)
        reach = self._radius + _BESIDE + abs(command.vx) * horizon
        at, twist = (pose.x, pose.y, pose.yaw), (command.vx, command.wz)
        look = (horizon, _STRIDE / pace, margin, reach)
        walls, others, room, self.nearest = self._keep_clear(
            self._hull, around, self._field, at, twist, look
        )
        return walls, others, room
