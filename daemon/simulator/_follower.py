"""Where a walk is at any time, in closed form between the moments the robot makes it stop."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grammars.behaviour import Walk
from grammars.route import TURN_RATE, Profile, Route


@dataclass(frozen=True, slots=True)
class _Leg:
    """From one stop to the next: arc length at its begin, which way (1 or -1), how far [m].

    ``turned`` is what is added to the heading of the route [rad], ``goal`` the number of the stop
    at its end.
    """

    origin: float
    way: float
    length: float
    turned: float
    goal: int


class Follower:
    """Where a walk is at any time: an exact function of time until it has to stop for the robot.

    Times are seconds since the walk began and must not decrease from call to call.
    """

    def __init__(self, walk: Walk) -> None:
        self._walk, self.route = walk, Route(walk)
        self._leg = self._first_leg()
        self._done = self._stopped = False
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
        """Return the leg after the present one, or ``None`` at the end of a walk done once."""
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
        """Go on from ``way`` of the present leg at ``speed``."""
        walk = self._walk
        self._profile = Profile.plan(self._leg.length - way, speed, walk.speed, walk.acceleration)
        self._begin, self._from = time, way

    def _roll(self, time: float) -> None:
        """Go on to the leg that is under way at ``time``, or to the rest before it."""
        while not (self._done or self._stopped):
            arrival = self._begin + self._profile.duration
            if time < arrival:
                return
            following = self._next_leg()
            if following is None:
                self._done = True
                return
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
            turned = self._turn_from + (step if abs(step) < math.pi else turned - self._turn_from)
        x, y = self.route.point(along)
        return x, y, self.route.yaw(along) + turned

    def _state(self, time: float) -> tuple[float, float]:
        """Return the way on the present leg and the speed."""
        passed = max(0.0, time - self._begin)
        if self._stopped:
            a, v = self._walk.acceleration, self._braked_from
            braking = min(passed, v / a)
            return self._from + v * braking - a * braking * braking / 2.0, v - a * braking
        way, speed = self._profile.at(min(passed, self._profile.duration))
        return self._from + way, speed

    @property
    def stopped(self) -> bool:
        """Whether it makes way for the robot: it brakes or stands."""
        return self._stopped

    @property
    def done(self) -> bool:
        """Whether the walk is over."""
        return self._done

    def heading(self, time: float) -> tuple[float, float] | None:
        """Return the unit vector of the way it goes or is to go, ``None`` while at rest."""
        self._roll(time)
        if self._done or time < self._rest_until:
            return None
        leg = self._leg
        x, y = self.route.direction(leg.origin + leg.way * self._state(time)[0])
        return (leg.way * x, leg.way * y)

    def stop(self, time: float, *, dead: bool = False) -> None:
        """Brake from now on; ``dead`` at once."""
        way, speed = self._state(time)
        self._stopped, self._begin, self._from = True, time, way
        self._braked_from = 0.0 if dead else speed

    def go_on(self, time: float) -> None:
        """Set out again from where it is."""
        way, speed = self._state(time)
        self._stopped = False
        self._set_out(time, way, speed)
