"""Movers: walking objects as links on a virtual planar chain, and their routes.

The body of a mover hangs on three joints: ``x`` and ``y`` (prismatic, along the axes of the object
frame) and ``yaw`` (revolute, about the origin of the body). Two carrier links without shape and
mass are in between (a planar joint in URDF). So joint states, forward kinematics, traces and
pictures treat a walking person like any other object.

Routes are exact: a polyline by arc length, and the trapezoidal profile of speed (constant
acceleration, cruise, constant deceleration; Lynch and Park, Modern Robotics, section 9.2.2.2).
"""

from __future__ import annotations

import bisect
import itertools
import math
from dataclasses import dataclass
from typing import Final

from grammars.model.behaviour import Walk
from grammars.model.geometry import Point2, Pose2, wrap_angle
from grammars.model.kinematics import WORLD
from grammars.model.scene import Joint, Link, SceneObject

PLANAR_JOINTS: Final = ("x", "y", "yaw")
_CARRIERS: Final = ("x_carrier", "y_carrier")
JOINT_LIMIT: Final = 1e4
"""Limit of all three joints [m, rad]: more than any building and any number of turns."""


def with_planar_chain(
    links: tuple[Link, ...], joints: tuple[Joint, ...], body: str
) -> tuple[tuple[Link, ...], tuple[Joint, ...]]:
    """Return links and joints of an object with the link ``body`` on the planar chain."""
    carriers = tuple(Link(name, (), 0.0, 0.0, 0.0) for name in _CARRIERS)
    first, second = _CARRIERS
    chain = (
        _slide("x", WORLD, first, (1.0, 0.0)),
        _slide("y", first, second, (0.0, 1.0)),
        Joint("yaw", "revolute", second, body, (0.0, 0.0), (0.0, 0.0), -JOINT_LIMIT, JOINT_LIMIT),
    )
    return (*carriers, *links), (*chain, *joints)


def _slide(name: str, parent: str, child: str, axis: Point2) -> Joint:
    return Joint(name, "prismatic", parent, child, (0.0, 0.0), axis, -JOINT_LIMIT, JOINT_LIMIT)


def is_mover(joints: tuple[Joint, ...]) -> bool:
    """Return whether an object with these joints hangs on the planar chain."""
    if tuple(joint.name for joint in joints[:3]) != PLANAR_JOINTS:
        return False
    _, (x, y, yaw) = with_planar_chain((), (), joints[2].child)
    return joints[:3] == (x, y, yaw)


def own_joints(joints: tuple[Joint, ...]) -> tuple[Joint, ...]:
    """Return the joints that behaviours may move: neither fixed ones nor the planar chain."""
    rest = joints[3:] if is_mover(joints) else joints
    return tuple(joint for joint in rest if not is_fixed(joint))


def is_fixed(joint: Joint) -> bool:
    """Return whether the joint cannot move."""
    return joint.lower == joint.upper == 0.0


def chain_positions(mover: SceneObject, pose: Pose2, turn: float) -> tuple[float, float, float]:
    """Return the joint positions that put the body's frame at ``pose`` in the world.

    ``turn`` [rad] is the heading in the world, not wrapped; ``pose.yaw`` is not used.
    """
    x, y = mover.pose.inverse().apply((pose.x, pose.y))
    return (x, y, turn - mover.pose.yaw)


CORNER: Final = 0.3
"""Distance before and after a corner [m] within which a mover turns to its new direction."""
TURN_RATE: Final = math.pi
"""Turning speed at the ends of the route [rad/s]."""


class Route:
    """The polyline of a walk, by arc length from its first point [m].

    Attributes:
        length: length of the route, including the way back to the first point if closed [m].
        stops: arc lengths at which the walk may stop, from 0 to ``length``.
    """

    def __init__(self, walk: Walk) -> None:
        self.closed = walk.manner == "round"
        points = [*walk.route, walk.route[0]] if self.closed else list(walk.route)
        self._points = points
        legs = list(itertools.pairwise(points))
        self._lengths = [math.dist(a, b) for a, b in legs]
        self._begins = [0.0, *itertools.accumulate(self._lengths)]
        self.length = self._begins[-1]
        self.stops = self._begins if walk.stops == "points" else [0.0, self.length]
        self._ways = [((b[0] - a[0]) / d, (b[1] - a[1]) / d)
                      for (a, b), d in zip(legs, self._lengths, strict=True)]  # fmt: skip
        self._headings = _unwrap([math.atan2(y, x) for x, y in self._ways])
        self._facing, self._yaw = walk.facing, walk.yaw
        last = wrap_angle(self._headings[0] - self._headings[-1])
        self._lap_turn = self._headings[-1] + last - self._headings[0]
        self._corners = self._find_corners(last)

    def _find_corners(self, last: float) -> list[tuple[float, float, float]]:
        """Return (arc length, half width, turn) of every corner on the way."""
        lengths, headings = self._lengths, self._headings
        corners = [
            (
                self._begins[i],
                _corner_half_width(lengths[i - 1], lengths[i]),
                headings[i] - headings[i - 1],
            )
            for i in range(1, len(lengths))
        ]
        if self.closed:
            # The corner between two laps appears once for each of its halves.
            width = _corner_half_width(lengths[-1], lengths[0])
            corners = [(0.0, width, last), *corners, (self.length, width, last)]
        return corners

    def _lap(self, way: float) -> tuple[int, float]:
        if not self.closed:
            return 0, min(max(way, 0.0), self.length)
        # The quotient may round up to the next lap.
        lap = math.floor(way / self.length)
        return lap, max(0.0, way - lap * self.length)

    def _leg(self, way: float) -> int:
        leg = bisect.bisect_right(self._begins, way) - 1
        return min(max(leg, 0), len(self._lengths) - 1)

    def point(self, way: float) -> Point2:
        """Return the point after ``way`` [m]; a closed route never ends."""
        _, rest = self._lap(way)
        leg = self._leg(rest)
        (x, y), (dx, dy) = self._points[leg], self._ways[leg]
        along = rest - self._begins[leg]
        return (x + along * dx, y + along * dy)

    def direction(self, way: float) -> Point2:
        """Return the unit vector of the route after ``way`` [m], in forward direction."""
        return self._ways[self._leg(self._lap(way)[1])]

    def yaw(self, way: float) -> float:
        """Return the heading [rad, not wrapped] after ``way`` [m], in forward direction."""
        if self._facing == "fixed":
            return self._yaw
        lap, rest = self._lap(way)
        yaw = self._headings[self._leg(rest)] + lap * self._lap_turn
        # The first lap starts in the middle of its first corner and skips its second half.
        for at, width, turn in self._corners:
            if abs(rest - at) < width and (at > 0.0 or lap > 0):
                entry = yaw if rest < at else yaw - turn
                yaw = entry + turn * (rest - at + width) / (2.0 * width)
                break
        return yaw + (math.pi / 2.0 if self._facing == "sideways" else 0.0)


def _corner_half_width(first: float, second: float) -> float:
    return min(CORNER, first / 2.0, second / 2.0)


def _unwrap(headings: list[float]) -> list[float]:
    unwrapped = headings[:1]
    for heading in headings[1:]:
        unwrapped.append(unwrapped[-1] + wrap_angle(heading - unwrapped[-1]))
    return unwrapped


@dataclass(frozen=True, slots=True)
class Profile:
    """Trapezoidal speed profile from speed ``entry`` to rest after ``length`` [m] (may be inf).

    ``peak`` is the cruise speed; ``rise``, ``cruise`` and ``fall`` are the durations of the three
    parts [s].
    """

    length: float
    entry: float
    acceleration: float
    peak: float
    rise: float
    cruise: float
    fall: float

    @classmethod
    def plan(cls, length: float, entry: float, speed: float, acceleration: float) -> Profile:
        """Return the fastest profile within ``speed`` and ``acceleration``.

        ``entry`` must not exceed ``speed`` and must allow a stop within ``length``.
        """
        length = max(0.0, length)
        # From entry up to v and down to rest takes (v^2 - entry^2) / 2a + v^2 / 2a; solve for v.
        top = math.sqrt(acceleration * length + entry * entry / 2.0)
        peak = max(entry, min(speed, top))
        ramps = (2.0 * peak * peak - entry * entry) / (2.0 * acceleration)
        return cls(
            length,
            entry,
            acceleration,
            peak,
            (peak - entry) / acceleration,
            max(0.0, length - ramps) / peak if peak > 0.0 else 0.0,
            peak / acceleration,
        )

    @property
    def duration(self) -> float:
        """Seconds until rest."""
        return self.rise + self.cruise + self.fall

    def at(self, time: float) -> tuple[float, float]:
        """Return the distance [m] and speed [m/s] after ``time`` [s]."""
        a = self.acceleration
        if time <= self.rise:
            return self.entry * time + a * time * time / 2.0, self.entry + a * time
        ramp = (self.entry + self.peak) / 2.0 * self.rise
        if time <= self.rise + self.cruise:
            return ramp + self.peak * (time - self.rise), self.peak
        # Computed from the end, so that a walk stops exactly at the end of its route.
        remaining = max(0.0, self.duration - time)
        return self.length - a * remaining * remaining / 2.0, a * remaining
