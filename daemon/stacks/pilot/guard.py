"""The guard: no command that could not be stopped before the footprint meets something.

The footprint is swept along the arc of the command. What it must not meet are the scan's
returns, remembered obstacles beside and behind the robot (the laser does not look there) and the
walls of the map. A point already closer than the margin only stops motion that brings it closer
still, so that a robot can always back out of a tight spot.

From a wanted velocity to a command: acceleration limits, the stop zone, room to the sides; and
ways out of a tight spot: short slow motions, the freest one first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles, interpolate_at
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.map_field import MapField
from daemon.stacks.pilot.pursuit import DriveLimits
from grammars.model.geometry import Floats, Pose2, Ring, Twist2
from grammars.model.robot import Robot


def half_planes(footprint: Ring) -> Floats:
    """Return the edges of a convex ring as (m, 3): outward unit normal and offset [m].

    A point is outside by ``max(normal . p - offset)`` metres (exact beside edges, less at
    corners). Works for either orientation of the ring.
    """
    corners = np.asarray(footprint, dtype=np.float64)
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    corners, edges, lengths = corners[lengths > 0], edges[lengths > 0], lengths[lengths > 0]
    normals = np.column_stack((edges[:, 1], -edges[:, 0])) / lengths[:, None]
    offsets = np.einsum("ij,ij->i", normals, corners)
    centre = corners.mean(axis=0)
    flip = np.where(normals @ centre > offsets, -1.0, 1.0)
    return np.column_stack((normals * flip[:, None], offsets * flip))


def outline(footprint: Ring, spacing: float = 0.1) -> Floats:
    """Return points (n, 2) on the ring, corners included, at most ``spacing`` [m] apart."""
    points: list[tuple[float, float]] = []
    for (ax, ay), (bx, by) in zip(footprint, footprint[1:] + footprint[:1], strict=True):
        steps = max(1, math.ceil(math.hypot(bx - ax, by - ay) / spacing))
        points += [(ax + (bx - ax) * k / steps, ay + (by - ay) * k / steps) for k in range(steps)]
    return np.array(points)


@kernel
def _distance_outside(planes: Floats, x: float, y: float) -> float:
    """Return by how much a point of the base frame lies outside the footprint [m]."""
    most = -1e9
    for k in range(planes.shape[0]):
        most = max(most, planes[k, 0] * x + planes[k, 1] * y - planes[k, 2])
    return most


@kernel
def free_time(
    planes: Floats,
    rim: Floats,
    points: Floats,
    known: np.ndarray,
    count: int,
    surface: Singles,
    x0: float,
    y0: float,
    resolution: float,
    pose: Floats,
    vx: float,
    vy: float,
    wz: float,
    horizon: float,
    step: float,
    margin: float,
) -> tuple[float, float, float]:
    """Return how long the body-frame command (vx, vy, wz) keeps clear, and the room beside it.

    The three results are the time until something the map shows comes within ``margin`` [m] of
    the footprint, the same for everything else (``known[i]`` is 0), both at most ``horizon`` [s],
    and the least room [m] to points that are passed without being met. ``rim`` (n, 2) are
    points on the footprint that are looked up in ``surface``. The sweep advances ``step`` [s].
    """
    # One kernel: the sweep is reckoned once and serves points and walls; apart they would sweep
    # twice.
    steps = max(1, math.ceil(horizon / step))
    walls = others = horizon
    room = 1e9
    reach = math.hypot(vx, vy) * horizon + 0.5
    farthest = 0.0
    for k in range(rim.shape[0]):
        farthest = max(farthest, math.hypot(rim[k, 0], rim[k, 1]))
    reach += farthest
    sweep = np.empty((steps, 4))
    for k in range(steps):
        x, y, yaw = _displacement(vx, vy, wz, (k + 1) * step)
        sweep[k, 0], sweep[k, 1] = x, y
        sweep[k, 2], sweep[k, 3] = math.cos(yaw), math.sin(yaw)
    for i in range(count):
        px, py = points[i, 0], points[i, 1]
        if px * px + py * py > reach * reach:
            continue
        before = _distance_outside(planes, px, py)
        # Closer than the margin already: only coming closer still, by more than 2 mm, is in the
        # way, or the robot could never leave a tight spot.
        limit = min(margin, before - 0.002)
        end = walls if known[i] else others
        nearest, away, met, closing = before, before, False, False
        for k in range(steps):
            if (k + 1) * step > end:
                break
            dx, dy = px - sweep[k, 0], py - sweep[k, 1]
            c, s = sweep[k, 2], sweep[k, 3]
            previous, away = away, _distance_outside(planes, c * dx + s * dy, c * dy - s * dx)
            closing = away < previous - 1e-6
            if away < limit:
                if known[i]:
                    walls = k * step
                else:
                    others = k * step
                met = True
                break
            nearest = min(nearest, away)
        # What is still ahead at the end of the sweep, or left behind by it, is not beside the way.
        left = nearest >= before and away > before + 0.01
        if not met and not closing and not left:
            room = min(room, nearest)
    c0, s0 = math.cos(pose[2]), math.sin(pose[2])
    for i in range(rim.shape[0]):
        rx, ry = rim[i, 0], rim[i, 1]
        before = interpolate_at(
            surface, x0, y0, resolution,
            pose[0] + c0 * rx - s0 * ry, pose[1] + s0 * rx + c0 * ry,
        )  # fmt: skip
        limit = min(margin, before - 0.002)
        for k in range(steps):
            if (k + 1) * step > walls:
                break
            c, s = sweep[k, 2], sweep[k, 3]
            bx, by = sweep[k, 0] + c * rx - s * ry, sweep[k, 1] + s * rx + c * ry
            away = interpolate_at(
                surface, x0, y0, resolution,
                pose[0] + c0 * bx - s0 * by, pose[1] + s0 * bx + c0 * by,
            )  # fmt: skip
            if away < limit:
                walls = k * step
                break
    return walls, others, room


@kernel
def nearest_other(planes: Floats, points: Floats, known: np.ndarray, count: int) -> float:
    """Return the distance from the footprint to the nearest point the map does not show [m]."""
    nearest = 1e9
    for i in range(count):
        if not known[i]:
            nearest = min(nearest, _distance_outside(planes, points[i, 0], points[i, 1]))
    return nearest


@kernel
def _displacement(vx: float, vy: float, wz: float, t: float) -> tuple[float, float, float]:
    """Return the base's displacement after ``t`` seconds of a constant body-frame command."""
    turn = wz * t
    if abs(turn) < 1e-6:
        return vx * t, vy * t, turn
    s, c = math.sin(turn), math.cos(turn)
    return (vx * s - vy * (1.0 - c)) / wz, (vx * (1.0 - c) + vy * s) / wz, turn


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

    The first ``seen`` are returns of the latest scan of each laser, the others are remembered.
    """

    points: Floats
    known: npt.NDArray[np.uint8]
    seen: int
    count: int


class CollisionGuard:
    """Lets no command through that could not be stopped before the footprint meets something."""

    def __init__(
        self, robot: Robot, field: MapField, limits: DriveLimits, parameters: PilotParameters
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
            _ramp_axis(last.vx, wanted.vx, speeding, braking),
            _ramp_axis(last.vy, wanted.vy, speeding, braking),
            _ramp_axis(last.wz, wanted.wz, turning, 2.0 * turning),
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


def _ramp_axis(last: float, wanted: float, speeding: float, braking: float) -> float:
    """Move ``last`` towards ``wanted``: towards zero by ``braking``, away by ``speeding``."""
    change = wanted - last
    most = braking if last * change < 0.0 else speeding
    return last + max(-most, min(most, change))


_SHORTEST = 0.4
"""A way out must be free for at least this long [s]."""
_MARGIN = 0.02
"""What is kept around the footprint [m]."""
_SPEED, _SIDEWAYS, _TURN = 0.15, 0.12, 0.5


@dataclass(frozen=True, slots=True)
class EscapeMotion:
    """A motion to keep up until a time [s]; ``name`` completes "stuck, ..."."""

    name: str
    command: Twist2
    until: float


def find_escape(
    guard: CollisionGuard,
    limits: DriveLimits,
    pose: Pose2,
    around: Surroundings,
    now: float,
    *,
    longest: float = 2.5,
    hurry: float = 1.0,
    turns: bool = True,
) -> EscapeMotion | None:
    """Return the motion that stays free longest, backing off first among equals, or ``None``.

    It lasts up to ``longest`` [s] and is ``hurry`` times as fast as usual. Turns on the
    spot count unless ``turns`` is false.
    """
    choices = [("backing off", Twist2(-_SPEED, 0.0, 0.0))]
    if limits.holonomic:
        choices.append(("stepping left", Twist2(0.0, _SIDEWAYS, 0.0)))
        choices.append(("stepping right", Twist2(0.0, -_SIDEWAYS, 0.0)))
    if turns:
        choices.append(("turning left", Twist2(0.0, 0.0, _TURN)))
        choices.append(("turning right", Twist2(0.0, 0.0, -_TURN)))
    best: EscapeMotion | None = None
    best_time = _SHORTEST
    for name, usual in choices:
        command = Twist2(hurry * usual.vx, hurry * usual.vy, hurry * usual.wz)
        walls, others, _ = guard.free(command, pose, around, longest, _MARGIN)
        free = min(walls, others)
        if free > best_time:
            best, best_time = EscapeMotion(name, command, now + free), free
    return best
