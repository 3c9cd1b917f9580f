"""A base whose velocity is imposed, as Gazebo's planar-move plugin does it.

The velocity is written into the body once a tick, before it moves. That alone would press the
body through walls; so while anything touches it, the velocity is written where Gazebo's plugin
writes it in effect: after the step has found the contacts and before their forces are solved.
"""

from __future__ import annotations

import math
from typing import Final

import pymunk

from daemon.simulator._base import Base, MotorBase
from daemon.simulator._layers import DT
from grammars.robot import Robot
from grammars.values import Pose2, Twist2

_MIDDLE: Final = 0.0045
"""Mean time of ten updates of the plugin at the start of each millisecond of a tick [s]."""


class ImposedBase(Base):
    """A base that has the commanded velocity from the next tick on, less what the ground takes."""

    def __init__(self, space: pymunk.Space, robot: Robot, start: Pose2) -> None:
        super().__init__(space, robot, start)
        # A joint to a kinematic body, without force: it keeps the robot from falling asleep.
        leash = pymunk.GearJoint(self._control, self.body, 0.0, 1.0)
        leash.max_force = 0.0
        space.add(leash)
        self._resisted = False
        self._written = (self._goal, start.yaw)

    def update(self, tick: int) -> None:
        """Write the velocity for the tick that starts now, or have it written in contact."""
        if tick >= self._expiry:
            self._goal, self._expiry = (0.0, 0.0, 0.0), math.inf
        body = self.body
        if self._resisted != (self.touching > 0):
            self._resisted = not self._resisted
            body.velocity_func = self._insist if self._resisted else pymunk.Body.update_velocity
            self._written = (self._goal, math.nan)
        if self._resisted:
            return
        yaw, (goal, heading) = body.angle, self._written
        if yaw != heading or goal != self._goal:
            self._written = (self._goal, yaw)
            self._impose(yaw)

    def _insist(
        self, body: pymunk.Body, gravity: tuple[float, float], damping: float, dt: float
    ) -> None:
        """Have the commanded velocity again, for the solver to take away what meets resistance."""
        self._impose(body.angle)

    def _impose(self, yaw: float) -> None:
        vx, vy, wz = self._goal
        loss = self._drive.friction_loss
        spin = _less(wz, self._drive.turning_loss)
        # The plugin turns the velocity with the heading at the start of each of its steps; over a
        # tick the mean of those directions is the one in the middle.
        heading = yaw + spin * _MIDDLE
        c, s = math.cos(heading), math.sin(heading)
        self.body.velocity = (_less(c * vx - s * vy, loss), _less(s * vx + c * vy, loss))
        self.body.angular_velocity = spin

    def twist(self) -> Twist2:
        """Return the true velocity of the last tick in the body frame."""
        body = self.body
        x, y = body.velocity
        wz = body.angular_velocity
        heading = body.angle if self._resisted else body.angle - (DT - _MIDDLE) * wz
        c, s = math.cos(heading), math.sin(heading)
        return Twist2(c * x + s * y, c * y - s * x, wz)


def make_base(space: pymunk.Space, robot: Robot, start: Pose2) -> Base:
    """Put the robot into ``space`` with the drive it has."""
    return (ImposedBase if robot.drive.law == "imposed" else MotorBase)(space, robot, start)


def _less(speed: float, loss: float) -> float:
    return math.copysign(max(0.0, abs(speed) - loss), speed)
