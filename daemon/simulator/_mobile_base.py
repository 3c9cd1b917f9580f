"""Mobile base: a rigid body and its drive.

A base driven by motors has a kinematic control body with the commanded velocity. A pivot and a gear
joint with bounded effort and no position correction make the robot follow it. So it pushes doors
with the effort of its motors, stalls at walls and never tunnels. Velocities written into the robot
body would tunnel. After four seconds against a wall at 1 m/s the base is 5 mm deep in it, but 14 cm
with a velocity written every 50 ms, and on the other side with one written every step (measured).

A base with imposed velocity has it written into its body once a tick, before it moves, as in
Gazebo's planar-move plugin. That alone would press the body through walls. In contact, the velocity
is therefore written where Gazebo's plugin effectively writes it: after the step has found the
contacts and before it solves their forces.
"""

from __future__ import annotations

import math
from typing import Final

import pymunk

from daemon.model.sut import TICK_RATE
from daemon.simulator import _chipmunk as chipmunk
from daemon.simulator._physics import DT, FRICTION, ROBOT_COLLISION_TYPE, ROBOT_FILTER
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import Robot

_MEAN_UPDATE_TIME: Final = 0.0045
"""Mean time of ten updates of the plugin at 0, 1, ... 9 ms of a tick [s]."""


class MobileBase:
    """The robot body, its command and its control body.

    The centre of mass is the base frame's origin.

    Attributes:
        handle: the body, for the functions of ``_chipmunk``.
        touching: number of pairs of shapes in contact, set by the log of contacts.
    """

    def __init__(self, space: pymunk.Space, robot: Robot, start: Pose2) -> None:
        self._drive = robot.drive
        self.touching = 0
        corners = list(robot.footprint)
        self.body = pymunk.Body(robot.mass, pymunk.moment_for_poly(robot.mass, corners))
        self.body.angle = start.yaw
        self.body.position = (start.x, start.y)
        self.handle = chipmunk.handle(self.body)
        self.shape = pymunk.Poly(self.body, corners)
        self.shape.collision_type = ROBOT_COLLISION_TYPE
        self.shape.filter = ROBOT_FILTER
        self.shape.friction = FRICTION
        self._control = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        self._control.position = self.body.position
        self._control_handle = chipmunk.handle(self._control)
        # The control body has no shape, so nothing can touch it. Joints to a kinematic body also
        # keep the robot awake.
        space.add(self.body, self.shape, self._control)
        self._goal = (0.0, 0.0, 0.0)
        self._expiry = math.inf

    def command(self, twist: Twist2, tick: int) -> None:
        """Take a body-frame velocity command, within the drive's speed limits.

        Raises:
            ValueError: a component is not finite.
        """
        vx, vy, wz = twist.vx, twist.vy, twist.wz
        if not math.isfinite(vx + vy + wz):
            raise ValueError(f"velocity command is not finite: {twist}")
        drive = self._drive
        vy = 0.0 if drive.kind == "differential" else _clamp(vy, drive.max_vy)
        self._goal = (_clamp(vx, drive.max_vx), vy, _clamp(wz, drive.max_wz))
        if drive.timeout > 0.0:
            self._expiry = tick + round(drive.timeout * TICK_RATE)

    def update(self, tick: int) -> None:
        """Set velocities for the tick that starts now."""
        raise NotImplementedError

    def penetration_depth(self) -> float:
        """Return the largest penetration depth of the robot [m]."""
        deepest = [0.0]

        def look(arbiter: pymunk.Arbiter) -> None:
            deepest.extend(-point.distance for point in arbiter.contact_point_set.points)

        self.body.each_arbiter(look)
        return max(deepest)

    def pose(self) -> Pose2:
        """Return the true pose of the base frame in the world."""
        position, angle = chipmunk.position(self.handle), chipmunk.angle(self.handle)
        return Pose2(position.x, position.y, math.remainder(angle, math.tau))

    def twist(self) -> Twist2:
        """Return the true velocity in the body frame."""
        raise NotImplementedError


class MotorDrivenBase(MobileBase):
    """A base whose motors follow the command within their accelerations, force and torque."""

    def __init__(self, space: pymunk.Space, robot: Robot, start: Pose2) -> None:
        super().__init__(space, robot, start)
        pull = pymunk.PivotJoint(self._control, self.body, (0.0, 0.0), (0.0, 0.0))
        turn = pymunk.GearJoint(self._control, self.body, 0.0, 1.0)
        pull.max_bias = turn.max_bias = 0.0
        pull.max_force, turn.max_force = robot.drive.max_force, robot.drive.max_torque
        space.add(pull, turn)
        self._speed = (0.0, 0.0, 0.0)
        self._written_yaw = math.nan

    def update(self, tick: int) -> None:
        """Set the velocity of the control body for the tick that starts now."""
        if tick >= self._expiry:
            self._goal, self._expiry = (0.0, 0.0, 0.0), math.inf
        speed, yaw = self._speed, chipmunk.angle(self.handle)
        settled = speed == self._goal
        # Straight on at a constant speed, as in most of a run, needs no update.
        if settled and yaw == self._written_yaw:
            return
        # The step that starts now moves the body by its present velocity, then computes that of the
        # next step. The heading halfway through the next step, 1.5 ticks from now, makes an arc of
        # straight steps.
        if settled:
            vx, vy, wz = speed
            heading = yaw + 1.5 * DT * wz
        else:
            spin = chipmunk.angular_velocity(self.handle)
            vx, vy, wz = self._ramp(yaw, spin)
            heading = yaw + DT * (spin + 0.5 * wz)
            chipmunk.set_angular_velocity(self._control_handle, wz)
        c, s = math.cos(heading), math.sin(heading)
        chipmunk.set_velocity(self._control_handle, (c * vx - s * vy, s * vx + c * vy))
        self._written_yaw = yaw

    def _ramp(self, yaw: float, spin: float) -> tuple[float, float, float]:
        """Bring the demanded speed nearer to the commanded one, within the accelerations."""
        drive, goal, speed = self._drive, self._goal, self._speed
        vx, vy = self._body_velocity(yaw, spin)
        self._speed = (
            _approach(goal[0], speed[0], vx, drive.max_ax * DT),
            _approach(goal[1], speed[1], vy, drive.max_ay * DT),
            _approach(goal[2], speed[2], spin, drive.max_az * DT),
        )
        return self._speed

    def twist(self) -> Twist2:
        """Return the true velocity in the body frame."""
        wz = chipmunk.angular_velocity(self.handle)
        vx, vy = self._body_velocity(chipmunk.angle(self.handle), wz)
        return Twist2(vx, vy, wz)

    def _body_velocity(self, yaw: float, spin: float) -> tuple[float, float]:
        # The velocity belongs to the heading in the middle of its step.
        velocity = chipmunk.velocity(self.handle)
        x, y = velocity.x, velocity.y
        heading = yaw + 0.5 * DT * spin
        c, s = math.cos(heading), math.sin(heading)
        return c * x + s * y, c * y - s * x


def _approach(goal: float, demanded: float, true: float, limit: float) -> float:
    """Return the next demanded speed, at most ``limit`` from the last one.

    A stalled robot with a command to turn back starts from its true speed, not from the speed of
    its push.
    """
    change = goal - demanded
    if change == 0.0:
        return goal
    if (goal - true) * (demanded - true) < 0.0:
        demanded, change = true, goal - true
    return goal if -limit <= change <= limit else demanded + math.copysign(limit, change)


def _clamp(value: float, limit: float) -> float:
    return value if -limit <= value <= limit else math.copysign(limit, value)


class ImposedVelocityBase(MobileBase):
    """A base with the commanded velocity from the next tick on, less the loss by friction."""

    def __init__(self, space: pymunk.Space, robot: Robot, start: Pose2) -> None:
        super().__init__(space, robot, start)
        # A joint to a kinematic body, without force, keeps the robot awake.
        leash = pymunk.GearJoint(self._control, self.body, 0.0, 1.0)
        leash.max_force = 0.0
        space.add(leash)
        self._resisted = False
        self._written = (self._goal, start.yaw)

    def update(self, tick: int) -> None:
        """Write the velocity for the tick that starts now; in contact the solver's hook does."""
        if tick >= self._expiry:
            self._goal, self._expiry = (0.0, 0.0, 0.0), math.inf
        if self._resisted != (self.touching > 0):
            self._resisted = not self._resisted
            # Only during contact, because a velocity function in Python costs 2.5 us in every step.
            # The yaw nan equals no other, so the velocity is written again afterwards.
            own = self._impose_in_contact if self._resisted else pymunk.Body.update_velocity
            self.body.velocity_func = own
            self._written = (self._goal, math.nan)
        if self._resisted:
            return
        yaw, (goal, heading) = chipmunk.angle(self.handle), self._written
        if yaw != heading or goal != self._goal:
            self._written = (self._goal, yaw)
            self._impose(yaw)

    def _impose_in_contact(
        self, body: pymunk.Body, gravity: tuple[float, float], damping: float, dt: float
    ) -> None:
        """Restore the commanded velocity; the solver then removes the part against contacts."""
        self._impose(chipmunk.angle(self.handle))

    def _impose(self, yaw: float) -> None:
        vx, vy, wz = self._goal
        loss, spin = self._drive.friction_loss, _reduced_speed(wz, self._drive.turning_loss)
        # The plugin turns the velocity with the heading at the start of each of its steps. Over a
        # tick, the mean of these directions is the middle one.
        heading = yaw + spin * _MEAN_UPDATE_TIME
        c, s = math.cos(heading), math.sin(heading)
        speed = (_reduced_speed(c * vx - s * vy, loss), _reduced_speed(s * vx + c * vy, loss))
        chipmunk.set_velocity(self.handle, speed)
        chipmunk.set_angular_velocity(self.handle, spin)

    def twist(self) -> Twist2:
        """Return the true velocity of the last tick in the body frame."""
        velocity, yaw = chipmunk.velocity(self.handle), chipmunk.angle(self.handle)
        x, y = velocity.x, velocity.y
        wz = chipmunk.angular_velocity(self.handle)
        heading = yaw if self._resisted else yaw - (DT - _MEAN_UPDATE_TIME) * wz
        c, s = math.cos(heading), math.sin(heading)
        return Twist2(c * x + s * y, c * y - s * x, wz)


def make_base(space: pymunk.Space, robot: Robot, start: Pose2) -> MobileBase:
    """Put the robot with its kind of drive into ``space``."""
    return (ImposedVelocityBase if robot.drive.law == "imposed" else MotorDrivenBase)(
        space, robot, start
    )


def _reduced_speed(speed: float, loss: float) -> float:
    if speed > loss:
        return speed - loss
    return speed + loss if speed < -loss else math.copysign(0.0, speed)
