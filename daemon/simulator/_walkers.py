"""Walking movers: each follows its route and makes way for the robot.

Between stops for the robot, the place of a walk has a closed form, to which the kinematic body of
the mover is driven.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
import pymunk

from daemon.model.sut import TICK_RATE
from daemon.simulator import _chipmunk as chipmunk
from daemon.simulator._mobile_base import MobileBase
from daemon.simulator._physics import DT, convex_distance, ring_array, transform_array
from grammars.model.behaviour import Walk
from grammars.model.geometry import Floats, Pose2, Ring
from grammars.model.movers import TURN_RATE, Profile, Route

SQUEEZED_DEPTH: Final = 0.02
"""Penetration depth of a touched robot at which a mover stops [m]: the robot has no way out."""

CLEAR_AGAIN: Final = 0.05
"""Additional distance of the robot before the mover continues [m]. Otherwise a robot that creeps
along the limit would make it stop and go at every tick."""

YIELD_ANGLE: Final = math.radians(60.0)
"""Half angle of the sector ahead in which a mover yields to robots [rad]."""

_NEAR: Final = 1e-9


@dataclass(frozen=True, slots=True)
class _Leg:
    """Leg between two stops: arc length at its begin, direction (1 or -1), length [m].

    ``turned`` is an offset to the heading of the route [rad], ``goal`` the number of the stop at
    its end.
    """

    origin: float
    way: float
    length: float
    turned: float
    goal: int


class RouteFollower:
    """Place of a walk as an exact function of time, until it has to stop for the robot.

    ``done`` is true after its end. Times are seconds since its begin and must not decrease from
    call to call.
    """

    def __init__(self, walk: Walk) -> None:
        self._walk, self.route = walk, Route(walk)
        self._leg = self._first_leg()
        self.done = self._stopped = False
        self._braked_from = 0.0
        self._rest_until = 0.0
        self._turn_from = 0.0
        self._arrived = 0.0
        self._set_out(0.0, 0.0, 0.0)

    def _first_leg(self) -> _Leg:
        route, walk = self.route, self._walk
        endless = walk.manner == "round" and walk.pause == 0.0
        length = math.inf if endless else route.stops[1]
        return _Leg(0.0, 1.0, length, 0.0, 1)

    def _next_leg(self) -> _Leg | None:
        """Return the leg after the present one, or ``None`` at the end of a single walk."""
        leg, stops, manner = self._leg, self.route.stops, self._walk.manner
        at, last = leg.goal, len(stops) - 1
        if manner == "once" and at == last:
            return None
        if manner == "round" and at == last:
            at = 0
        way, turned = leg.way, leg.turned
        if manner == "back-and-forth" and at == (last if way > 0.0 else 0):
            way = -way
            if self._walk.facing == "ahead":
                turned = math.pi if turned == 0.0 else 0.0
        following = at + (1 if way > 0.0 else -1)
        length = abs(stops[following] - stops[at])
        return _Leg(leg.origin + leg.way * leg.length, way, length, turned, following)

    def _set_out(self, time: float, way: float, speed: float) -> None:
        """Continue from ``way`` of the present leg at ``speed``."""
        walk = self._walk
        self._profile = Profile.plan(self._leg.length - way, speed, walk.speed, walk.acceleration)
        self._begin, self._from = time, way

    def _roll(self, time: float) -> None:
        """Advance to the leg at ``time``, or to the rest before it."""
        while not (self.done or self._stopped):
            arrival = self._begin + self._profile.duration
            if time < arrival:
                return
            following = self._next_leg()
            if following is None:
                self.done = True
                return
            # A pause lasts at least as long as the turn.
            self._arrived, self._turn_from = arrival, self._leg.turned
            turn = abs(following.turned - self._leg.turned) / TURN_RATE
            self._rest_until = arrival + max(self._walk.pause, turn)
            self._leg = following
            self._set_out(self._rest_until, 0.0, 0.0)

    def at(self, time: float) -> tuple[float, float, float]:
        """Return x, y [m] and yaw [rad, not wrapped] at ``time``."""
        self._roll(time)
        way, _ = self._state(time)
        leg = self._leg
        along = leg.origin + leg.way * way
        turned = leg.turned
        if time < self._rest_until and turned != self._turn_from:
            step = math.copysign((time - self._arrived) * TURN_RATE, turned - self._turn_from)
            # Never more than half a turn, in spite of rounding.
            turned = self._turn_from + (step if abs(step) < math.pi else turned - self._turn_from)
        x, y = self.route.point(along)
        return x, y, self.route.yaw(along) + turned

    def _state(self, time: float) -> tuple[float, float]:
        """Return the way on the present leg and the speed."""
        # Closed form since the last change instead of a sum over ticks: the place of a walk does
        # not depend on the number of calls.
        passed = max(0.0, time - self._begin)
        if self._stopped:
            a, v = self._walk.acceleration, self._braked_from
            braking = min(passed, v / a)
            return self._from + v * braking - a * braking * braking / 2.0, v - a * braking
        way, speed = self._profile.at(min(passed, self._profile.duration))
        return self._from + way, speed

    def heading(self, time: float) -> tuple[float, float] | None:
        """Return the unit vector of the present or intended direction, ``None`` while at rest."""
        self._roll(time)
        if self.done or time < self._rest_until:
            return None
        leg = self._leg
        x, y = self.route.direction(leg.origin + leg.way * self._state(time)[0])
        return (leg.way * x, leg.way * y)

    def stop(self, time: float, *, dead: bool = False) -> None:
        """Brake from now on; with ``dead`` stop at once."""
        way, speed = self._state(time)
        self._stopped, self._begin, self._from = True, time, way
        self._braked_from = 0.0 if dead else speed

    def resume(self, time: float) -> None:
        """Set out again from the present place."""
        way, speed = self._state(time)
        self._stopped = False
        self._set_out(time, way, speed)


class _RobotInTheWay(Enum):
    """Reaction of a walker to the robot; values are the words of its events."""

    NO = ""
    YIELDS = "yields to"
    BLOCKED = "blocked by"


class Walker:
    """One mover of the world."""

    def __init__(
        self,
        walk: Walk,
        body: pymunk.Body,
        rings: list[Ring],
        base: MobileBase,
        footprint: Floats,
        report: Callable[[str, str], None],
    ) -> None:
        self._walk, self._report = walk, report
        self._body = chipmunk.handle(body)
        self._base, self._footprint = base, footprint
        self._follower = RouteFollower(walk)
        self._rings = [ring_array(ring) for ring in rings]
        levers = [float(np.hypot(*ring.T).max()) for ring in (*self._rings, footprint)]
        self._reach = max(levers[:-1], default=0.0) + levers[-1] + CLEAR_AGAIN
        self._home = (body.position.x, body.position.y)
        self._began: float | None = None if walk.event else walk.start
        self._on_the_way = self._still = False
        self._obstacle = _RobotInTheWay.NO

    def moved(self) -> float:
        """Return the distance from the start [m]."""
        position = chipmunk.position(self._body)
        return math.hypot(position.x - self._home[0], position.y - self._home[1])

    def set_out(self, tick: int) -> None:
        """Set out now, because the event of the walk has happened."""
        if self._began is None:
            self._began = tick / TICK_RATE

    @property
    def due(self) -> float:
        """Tick before which :meth:`update` changes nothing; infinite while it stands for good."""
        if self._began is None or self._still:
            return math.inf
        # Two ticks early: rounding must not make the first step late.
        return -math.inf if self._on_the_way else math.floor(self._began * TICK_RATE) - 2

    def update(self, tick: int) -> None:
        """Set the velocity for the tick that starts now."""
        if self._began is None or self._still:
            return
        now, then = tick * DT - self._began, (tick + 1) * DT - self._began
        if then <= 0.0:
            return
        if not self._on_the_way:
            self._on_the_way = True
            self._report(self._walk.object, "sets out")
        self._make_way(max(0.0, now))
        x, y, yaw = self._follower.at(then)
        body = self._body
        position, angle = chipmunk.position(body), chipmunk.angle(body)
        px, py = position.x, position.y
        if self._follower.done and abs(x - px) + abs(y - py) + abs(yaw - angle) < _NEAR:
            chipmunk.set_velocity(body, (0.0, 0.0))
            chipmunk.set_angular_velocity(body, 0.0)
            self._still = True
            self._report(self._walk.object, "has arrived")
            return
        # Start from the actual place of the body, so that rounding never adds up.
        chipmunk.set_velocity(body, ((x - px) * TICK_RATE, (y - py) * TICK_RATE))
        chipmunk.set_angular_velocity(body, (yaw - angle) * TICK_RATE)

    def _make_way(self, now: float) -> None:
        before, self._obstacle = self._obstacle, self._look(now)
        if self._obstacle == before:
            return
        if self._obstacle is not _RobotInTheWay.NO:
            self._follower.stop(now, dead=self._obstacle is _RobotInTheWay.BLOCKED)
            self._report(self._walk.object, f"{self._obstacle.value} the robot")
        else:
            self._follower.resume(now)
            self._report(self._walk.object, "walks on")

    def _look(self, now: float) -> _RobotInTheWay:
        """Return the reaction to the robot."""
        here, robot = chipmunk.position(self._body), chipmunk.position(self._base.handle)
        dx, dy = robot.x - here.x, robot.y - here.y
        yielding = self._walk.yielding or 0.0
        # The robot is usually far away: skip the polygons.
        if dx * dx + dy * dy > (yielding + self._reach) ** 2:
            return _RobotInTheWay.NO
        # Only a robot ahead is in the way: a mover does not wait for one that it passes.
        heading = self._follower.heading(now)
        ahead = 0.0 if heading is None else dx * heading[0] + dy * heading[1]
        if ahead <= 0.0:
            return _RobotInTheWay.NO
        gap = self._gap()
        # A touch alone does not stop a mover that never yields: it pushes the robot until the robot
        # is pressed into something.
        squeezed = gap <= 0.0 and self._base.penetration_depth() > SQUEEZED_DEPTH
        if squeezed or (self._obstacle is _RobotInTheWay.BLOCKED and gap < CLEAR_AGAIN):
            return _RobotInTheWay.BLOCKED
        in_sight = ahead > math.cos(YIELD_ANGLE) * math.hypot(dx, dy)
        stopped = self._obstacle is not _RobotInTheWay.NO
        enough = yielding + CLEAR_AGAIN if stopped and yielding > 0.0 else yielding
        return _RobotInTheWay.YIELDS if in_sight and gap < enough else _RobotInTheWay.NO

    def _gap(self) -> float:
        """Return the distance between the mover and the robot [m]."""
        outline = transform_array(self._base.pose(), self._footprint)
        position = chipmunk.position(self._body)
        pose = Pose2(position.x, position.y, chipmunk.angle(self._body))
        gaps = (convex_distance(transform_array(pose, ring), outline) for ring in self._rings)
        return float(min(gaps, default=math.inf))
