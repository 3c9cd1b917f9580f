"""Moving joints: their guiding constraints, their actuators, and jumps.

Everything except jumps runs inside the physics solver, so a driven joint needs no Python per tick.
Servos are equality constraints with bounded effort (``max_force``) and bounded correction speed
(``max_bias``), like a position drive with limited rate and effort. A jump sets a joint at once, as
far as the robot allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pymunk

from daemon.model.sut import TICK_RATE
from daemon.simulator._assembly import WORLD, BodyAssembly, MovingJoint
from daemon.simulator._physics import DT, convex_distance, ring_array, transform_array
from grammars.model.behaviour import Jump, Motion, Servo, Spring
from grammars.model.geometry import Floats, Point2, Pose2

_LIMIT_LAG = 0.5
"""Time constant of a joint's return from beyond its limit [s]: a stop, not a spring."""

_HEAVY = 1e6
"""Factor on the mass of a held joint's body, so that no robot can move it."""

_STEP = 0.02
"""Largest move of a point between two tests of a blocked jump [m]."""
_RESOLUTION = 1e-4
"""Accuracy of a blocked jump's approach to the robot [m]."""


class JointDrive:
    """Guide of one joint within its limits, with friction and closer, and its drive.

    After construction the joint is free. Positions in rad or m, efforts in N m or N.
    """

    def __init__(self, space: pymunk.Space, motion: MovingJoint, assembly: BodyAssembly) -> None:
        self.motion, bodies = motion, assembly.bodies
        self.parent, self.child = bodies[motion.parent], bodies[motion.child]
        self._space = space
        self._mass, self._moment = self.child.mass, self.child.moment
        self._inertia = self._driven_inertia([bodies[s] for s in assembly.behind(motion.child)])
        self._servo: pymunk.GearJoint | pymunk.PivotJoint | None = None
        self._spring: pymunk.DampedRotarySpring | pymunk.DampedSpring | None = None
        guide = self._guide_turning if motion.joint.kind == "revolute" else self._guide_sliding
        guide()
        joint = motion.joint
        if joint.stiffness > 0.0 or joint.damping > 0.0:
            self._add(self._make_spring(joint.rest, joint.stiffness, joint.damping))

    def _add(self, constraint: pymunk.Constraint) -> None:
        # Connected bodies overlap by design: a leaf with its jamb or with the previous leaf.
        constraint.collide_bodies = False
        self._space.add(constraint)

    def _guide_turning(self) -> None:
        motion, joint = self.motion, self.motion.joint
        parent, child = self.parent, self.child
        anchor = motion.frame.apply(joint.anchor)
        self._add(pymunk.PivotJoint(parent, child, anchor, joint.anchor))
        low, high = joint.lower + motion.offset, joint.upper + motion.offset
        limit = pymunk.RotaryLimitJoint(parent, child, low, high)
        limit.error_bias = _error_bias(_LIMIT_LAG)
        self._add(limit)
        if joint.friction > 0.0:
            brake = pymunk.SimpleMotor(parent, child, 0.0)
            brake.max_force = joint.friction
            self._add(brake)

    def _guide_sliding(self) -> None:
        motion, joint = self.motion, self.motion.joint
        parent, child = self.parent, self.child
        low, high, point = self._rail(joint.lower), self._rail(joint.upper), self._grip
        self._add(pymunk.GrooveJoint(parent, child, low, high, point))
        self._add(pymunk.GearJoint(parent, child, motion.offset, 1.0))
        if joint.friction > 0.0:
            brake = pymunk.PivotJoint(parent, child, low, point)
            brake.max_bias, brake.max_force = 0.0, joint.friction
            self._add(brake)

    @property
    def _grip(self) -> Point2:
        """Point that guides a sliding child: its centre of mass, so that it never turns."""
        x, y = self.child.center_of_gravity
        return (x, y)

    def _rail(self, position: float) -> Point2:
        """Return the grip in the parent body's frame at a joint position."""
        (x, y), (ax, ay) = self._grip, self.motion.joint.axis
        return self.motion.frame.apply((x + position * ax, y + position * ay))

    def _make_spring(
        self, rest: float, stiffness: float, damping: float
    ) -> pymunk.DampedRotarySpring | pymunk.DampedSpring:
        if self.motion.joint.kind == "revolute":
            # Chipmunk measures a rotary spring from the child to the parent.
            angle = -(rest + self.motion.offset)
            return pymunk.DampedRotarySpring(self.parent, self.child, angle, stiffness, damping)
        far, length = self._spring_anchor(rest)
        return pymunk.DampedSpring(
            self.parent, self.child, far, self._grip, length, stiffness, damping
        )

    def _spring_anchor(self, rest: float) -> tuple[Point2, float]:
        """Return a point behind the lower limit and its distance from the grip at ``rest``."""
        lower = min(self.motion.joint.lower, rest) - 1.0
        return self._rail(lower), rest - lower

    def position(self) -> float:
        """Return the present joint position."""
        motion = self.motion
        if motion.joint.kind == "revolute":
            return float(self.child.angle - self.parent.angle - motion.offset)
        x, y = self.parent.world_to_local(self.child.position)
        ax, ay = motion.axis
        return float((x - motion.frame.x) * ax + (y - motion.frame.y) * ay)

    def hinge(self) -> Point2:
        """Return the anchor in the world."""
        x, y = self.parent.local_to_world(self.motion.frame.apply(self.motion.joint.anchor))
        return (x, y)

    def _driven_inertia(self, bodies: Sequence[pymunk.Body]) -> float:
        """Return the inertia of a servo's load at the start: kg, or kg m^2 about the anchor."""
        if self.motion.joint.kind == "prismatic":
            return sum(body.mass for body in bodies)
        hinge = self.hinge()
        arms = [body.local_to_world(body.center_of_gravity).get_distance(hinge) for body in bodies]
        return sum(b.moment + b.mass * arm**2 for b, arm in zip(bodies, arms, strict=True))

    def drive(self, motion: Motion, target: float) -> None:
        """Drive to ``target`` by ``motion``; a jump holds the joint, which is already there."""
        match motion:
            case Jump():
                self.hold(target)
            case Servo():
                self.servo(target, motion.rate, motion.effort)
            case Spring():
                self.spring(target, motion.stiffness, motion.damping)

    def servo(self, target: float, rate: float, effort: float) -> None:
        """Drive to ``target`` and stay there, with bounded speed and effort.

        The approach is exponential near the target. Its time constant needs half of the effort to
        brake the mass from ``rate``.
        """
        self._release()
        # The exponential approach begins at ``rate`` with a deceleration of rate / lag; the effort
        # could brake with effort / inertia. Twice the lag of equality leaves half of the effort for
        # the closer and for loads on the leaf. In less than a tick no error can be corrected.
        self._steer(target, rate, effort, max(DT, 2.0 * self._inertia * rate / effort))

    def hold(self, target: float) -> None:
        """Hold the joint at ``target``, where it already is, against any push.

        On a moving parent, the joint is stiff instead of immovable.
        """
        self._release()
        # Heavy instead of static, so that the joint can be released without leaving the space. On a
        # moving parent, the mass would tear at the parent's joint.
        if self.motion.parent == WORLD:
            self.child.mass, self.child.moment = _HEAVY * self._mass, _HEAVY * self._moment
        self._steer(target, math.inf, math.inf, 10.0 * DT)

    def _release(self) -> None:
        self.child.mass, self.child.moment = self._mass, self._moment
        # A sleeping body would not notice a new goal of its constraint.
        self.child.activate()

    def _steer(self, target: float, rate: float, effort: float, lag: float) -> None:
        servo = self._servo
        if servo is None:
            servo = self._servo = self._make_servo()
            self._add(servo)
        if isinstance(servo, pymunk.GearJoint):
            servo.phase = target + self.motion.offset
        else:
            servo.anchor_a = self._rail(target)
        servo.error_bias = _error_bias(lag)
        servo.max_bias, servo.max_force = rate, effort

    def _make_servo(self) -> pymunk.GearJoint | pymunk.PivotJoint:
        if self.motion.joint.kind == "revolute":
            return pymunk.GearJoint(self.parent, self.child, 0.0, 1.0)
        return pymunk.PivotJoint(self.parent, self.child, self._rail(0.0), self._grip)

    def spring(self, target: float, stiffness: float, damping: float) -> None:
        """Pull to ``target`` with a spring, in addition to the object's own closer."""
        self._release()
        if self._spring is None:
            self._spring = self._make_spring(target, stiffness, damping)
            self._add(self._spring)
        elif isinstance(self._spring, pymunk.DampedRotarySpring):
            self._spring.rest_angle = -(target + self.motion.offset)
        else:
            self._spring.anchor_a, self._spring.rest_length = self._spring_anchor(target)


def _error_bias(lag: float) -> float:
    """Return Chipmunk's remaining share of an error after a second, for a time constant."""
    return float((1.0 - DT / lag) ** TICK_RATE)


class JointJumper:
    """Teleport of the part of an object behind one joint.

    A target clear of the robot is reached at once, regardless of obstacles between. If the target
    is inside the robot, the part sweeps towards it and stays at the first touch. There the physics
    takes over, and the contact is recorded.
    """

    def __init__(self, drive: JointDrive, assembly: BodyAssembly) -> None:
        self._drive = drive
        slots = assembly.behind(drive.motion.child)
        self._bodies = [assembly.bodies[slot] for slot in slots]
        solid = set(assembly.owners.values())
        self._outlines = [
            (assembly.bodies[slot], ring_array(ring))
            for slot in slots
            for placement in assembly.placements_on(slot)
            if placement.owner in solid
            for ring in placement.rings
        ]

    def jump(self, target: float, footprint: Floats) -> float:
        """Move to ``target`` or as far as possible; return the position reached.

        ``footprint`` is the robot's outline in the world, shape (n, 2).
        """
        start = self._drive.position()
        way = target - start
        reached = target
        if self._hits(way, footprint):
            reached = start + self._free_way(way, footprint)
        self._move_bodies(reached - start)
        return reached

    def _free_way(self, way: float, footprint: Floats) -> float:
        if self._hits(0.0, footprint):
            return 0.0
        # Steps before bisection, because a corner of the robot may lie between two free positions.
        reach = self._reach()
        steps = max(1, math.ceil(abs(way) * reach / _STEP))
        low = high = 0.0
        for k in range(1, steps + 1):
            high = way * k / steps
            if self._hits(high, footprint):
                break
            low = high
        while abs(high - low) * reach > _RESOLUTION:
            middle = 0.5 * (low + high)
            if self._hits(middle, footprint):
                high = middle
            else:
                low = middle
        return high

    def _reach(self) -> float:
        """Return the way [m] of the fastest point per unit of joint motion."""
        motion = self._drive.motion
        if motion.joint.kind == "prismatic":
            return 1.0
        hinge = np.array(self._drive.hinge())
        outlines = self._world_outlines(Pose2())
        return max(float(np.hypot(*(outline - hinge).T).max()) for outline in outlines)

    def _move(self, way: float) -> Pose2:
        """Return the rigid motion of the part in the world for a joint displacement."""
        motion, parent = self._drive.motion, self._drive.parent
        if motion.joint.kind == "prismatic":
            x, y = pymunk.Vec2d(*motion.axis).rotated(parent.angle) * way
            return Pose2(x, y, 0.0)
        x, y = self._drive.hinge()
        return Pose2(x, y, 0.0) @ Pose2(0.0, 0.0, way) @ Pose2(-x, -y, 0.0)

    def _world_outlines(self, move: Pose2) -> list[Floats]:
        return [
            transform_array(move @ Pose2(*body.position, body.angle), outline)
            for body, outline in self._outlines
        ]

    def _hits(self, way: float, footprint: Floats) -> bool:
        outlines = self._world_outlines(self._move(way))
        return any(convex_distance(outline, footprint) == 0.0 for outline in outlines)

    def _move_bodies(self, way: float) -> None:
        move = self._move(way)
        turn = 0.0 if self._drive.motion.joint.kind == "prismatic" else way
        for body in self._bodies:
            position = move.apply((body.position.x, body.position.y))
            body.angle += turn
            body.position = position
            body.velocity, body.angular_velocity = (0.0, 0.0), 0.0
            # Until then, Chipmunk finds a teleported body at its old place.
            if body.space is not None:
                body.space.reindex_shapes_for_body(body)
