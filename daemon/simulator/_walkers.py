"""Movers that walk: the kinematic body of each follows its route and makes way for the robot."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, Literal, TypeAlias

import numpy as np
import pymunk

from daemon.simulator._base import Base
from daemon.simulator._follower import Follower
from daemon.simulator._geometry import convex_distance, ring_array, transform_array
from daemon.simulator._layers import DT, TICK_RATE
from grammars.behaviour import Walk
from grammars.values import Floats, Pose2, Ring

SQUEEZE: Final = 0.02
"""A mover stops dead when the robot it touches is this deep in anything [m]: it has no way out."""

FREE: Final = 0.05
"""It goes on when the robot is this much farther away than where it stopped for it [m]."""

SIGHT: Final = math.radians(60.0)
"""A mover yields to robots this far to the left and right of the way it goes [rad]."""

_NEAR: Final = 1e-9
_Obstacle: TypeAlias = Literal["", "yields to", "blocked by"]


class Walker:
    """One mover of the world."""

    def __init__(
        self,
        walk: Walk,
        body: pymunk.Body,
        rings: list[Ring],
        base: Base,
        footprint: Floats,
        report: Callable[[str, str], None],
    ) -> None:
        self._walk, self._body, self._report = walk, body, report
        self._base, self._footprint = base, footprint
        self._follower = Follower(walk)
        self._rings = [ring_array(ring) for ring in rings]
        levers = [float(np.hypot(*ring.T).max()) for ring in (*self._rings, footprint)]
        self._reach = max(levers[:-1], default=0.0) + levers[-1] + FREE
        self._home = (body.position.x, body.position.y)
        self._began: float | None = None if walk.event else walk.start
        self._on_the_way = self._still = False
        self._obstacle: _Obstacle = ""

    def moved(self) -> float:
        """Return how far it is from where it started [m]."""
        x, y = self._body.position
        return math.hypot(x - self._home[0], y - self._home[1])

    def begin(self, tick: int) -> None:
        """Set out now: what the walk waited for has happened."""
        if self._began is None:
            self._began = tick / TICK_RATE

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
        px, py = body.position
        if self._follower.done and abs(x - px) + abs(y - py) + abs(yaw - body.angle) < _NEAR:
            body.velocity, body.angular_velocity = (0.0, 0.0), 0.0
            self._still = True
            self._report(self._walk.object, "has arrived")
            return
        # From where the body is, so that rounding never adds up.
        body.velocity = ((x - px) * TICK_RATE, (y - py) * TICK_RATE)
        body.angular_velocity = (yaw - body.angle) * TICK_RATE

    def _make_way(self, now: float) -> None:
        before, self._obstacle = self._obstacle, self._look(now)
        if self._obstacle == before:
            return
        if self._obstacle:
            self._follower.stop(now, dead=self._obstacle == "blocked by")
            self._report(self._walk.object, f"{self._obstacle} the robot")
        else:
            self._follower.go_on(now)
            self._report(self._walk.object, "walks on")

    def _look(self, now: float) -> _Obstacle:
        """Return whether the robot is in the way, and how much."""
        (x, y), robot = self._body.position, self._base.body.position
        dx, dy = robot.x - x, robot.y - y
        yielding = self._walk.yielding or 0.0
        if dx * dx + dy * dy > (yielding + self._reach) ** 2:
            return ""
        heading = self._follower.heading(now)
        ahead = 0.0 if heading is None else dx * heading[0] + dy * heading[1]
        if ahead <= 0.0:
            return ""
        gap = self._gap()
        squeezed = gap <= 0.0 and self._base.depth() > SQUEEZE
        if squeezed or (self._obstacle == "blocked by" and gap < FREE):
            return "blocked by"
        in_sight = ahead > math.cos(SIGHT) * math.hypot(dx, dy)
        enough = yielding + FREE if self._obstacle and yielding > 0.0 else yielding
        return "yields to" if in_sight and gap < enough else ""

    def _gap(self) -> float:
        """Return the distance between the mover and the robot [m]."""
        outline = transform_array(self._base.pose(), self._footprint)
        pose = Pose2(*self._body.position, self._body.angle)
        gaps = (convex_distance(transform_array(pose, ring), outline) for ring in self._rings)
        return float(min(gaps, default=math.inf))
