"""Behaviours that move joints: key frames, triggers and reactions, and their start positions.

Triggers watch a distance to the robot. A safe bound gives the motion for which they need not look.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from daemon.model.sut import TICK_RATE
from daemon.simulator._assembly import WORLD, BodyAssembly
from daemon.simulator._joints import JointDrive, JointJumper
from daemon.simulator._physics import convex_distance, ring_array, transform_array
from grammars.model.behaviour import (
    Behaviour,
    Hold,
    Jump,
    KeyFrames,
    Motion,
    Trigger,
    Walk,
)
from grammars.model.geometry import Floats, Point2, Pose2
from grammars.model.movers import PLANAR_JOINTS, Route, chain_positions, is_mover
from grammars.model.scene import Scene, SceneObject

_OVERRUN = 0.05
"""Generous bound of a sliding joint's overrun of its limits [m]: one tick of a fast push."""

_COMPLIANCE = 0.002
"""Bound of the displacement of loaded joints at a constant position [m]; a hinge pushed with 300 N
yields by 1.1 mm."""


class RobotProximity:
    """Distance that a trigger watches, with a safe bound on its changes.

    ``of`` a trigger: ``hinge`` is the anchor of a revolute joint, or the object's origin for a
    prismatic one; ``foot`` is that origin; ``leaf`` the nearest point of the moving link;
    ``doorway`` a fixed point.
    """

    def __init__(
        self,
        drive: JointDrive,
        assembly: BodyAssembly,
        behaviour: Trigger,
        doorway: Point2 | None,
        footprint: Floats,
    ) -> None:
        motion, joint = drive.motion, drive.motion.joint
        self._of, self._to, self._fixed = behaviour.of, behaviour.to, doorway
        self._parent, self._child = drive.parent, drive.child
        turns = joint.kind == "revolute"
        foot = joint.anchor if turns and self._of != "foot" else (0.0, 0.0)
        # The centre of the distance or of its bound, if it is fixed.
        self._foot = motion.frame.apply(foot)
        if motion.parent == WORLD and doorway is None:
            self._fixed = self._centre()
        self._outlines = [
            ring_array(ring) for p in assembly.placements if p.owner == motion.owner
            for ring in p.rings
        ]  # fmt: skip
        # The watched distance is at most ``nearer`` less and ``farther`` more than that from the
        # base origin to the centre.
        self._nearer = self._farther = 0.0
        if self._to == "footprint":
            self._nearer += float(np.hypot(*footprint.T).max())
            self._farther += float(convex_distance(np.zeros((1, 2)), footprint))
        if self._of == "leaf":
            levers = np.hypot(*(np.concatenate(self._outlines) - np.array(foot)).T)
            travel = 0.0 if turns else max(abs(joint.lower), abs(joint.upper)) + _OVERRUN
            self._nearer += float(levers.max()) + travel
            self._farther += float(levers.min()) + travel

    def _centre(self) -> Point2:
        if self._fixed is not None:
            return self._fixed
        x, y = self._parent.local_to_world(self._foot)
        return (x, y)

    def distance(self, base: Pose2, footprint: Floats) -> float:
        """Return the watched distance [m]; ``footprint`` is the robot's outline in the world."""
        robot = footprint if self._to == "footprint" else np.array([[base.x, base.y]])
        if self._of != "leaf":
            return float(convex_distance(np.array([self._centre()]), robot))
        frame = Pose2(*self._child.position, self._child.angle)
        return min(
            float(convex_distance(transform_array(frame, outline), robot))
            for outline in self._outlines
        )

    def far_slack(self, base: Pose2, threshold: float, *, inside: bool) -> float:
        """Return a way of the base origin in which the distance cannot cross ``threshold``.

        By the triangle inequality it holds for all turns of the robot and motions of the leaf; 0
        without such a bound. ``inside``: the distance must grow beyond the threshold, not fall
        below it.
        """
        if self._fixed is None:
            return 0.0
        x, y = self._fixed
        distance = math.hypot(base.x - x, base.y - y)
        if inside:
            return threshold - distance - self._farther - _COMPLIANCE
        return distance - self._nearer - threshold


EventReporter = Callable[[str, str], None]
"""Function of a joint name and a description of the event."""


class JointActuator:
    """Actuator of one joint by the motion of its behaviour."""

    def __init__(
        self, motion: Motion, drive: JointDrive, jumper: JointJumper, report: EventReporter
    ) -> None:
        self._motion, self._drive, self._jumper = motion, drive, jumper
        self._report = report
        self._target: float | None = None

    @property
    def name(self) -> str:
        """Scene-wide joint name."""
        return self._drive.motion.name

    @property
    def blocked(self) -> bool:
        """True while a jump with ``hold`` waits for the robot to make way."""
        return self._target is not None

    def report(self, text: str) -> None:
        """Report an event of this joint."""
        self._report(self.name, text)

    def move_to(self, target: float, footprint: Floats, *, hold: bool) -> None:
        """Start to move to ``target``; a jump without ``hold`` releases the joint there."""
        if not isinstance(self._motion, Jump):
            self._drive.drive(self._motion, target)
            return
        reached = self._jumper.jump(target, footprint)
        if reached != target:
            self.report(f"stopped at {reached:.3f} by the robot, short of {target:g}")
        # Only a jump with ``hold`` tries again; a key frame acts once.
        self._target = target if hold and reached != target else None
        if hold:
            self._drive.hold(reached)

    def retry(self, footprint: Floats) -> None:
        """Continue a blocked jump as far as the robot now allows."""
        if self._target is None:
            return
        reached = self._jumper.jump(self._target, footprint)
        self._drive.hold(reached)
        if reached == self._target:
            self.report(f"reached {reached:g}")
            self._target = None


class KeyFramePlayer:
    """Player of key frames; a joint that jumps is free between frames."""

    def __init__(self, behaviour: KeyFrames, actuator: JointActuator) -> None:
        self._actuator = actuator
        self._frames = behaviour.frames
        self._ticks = frame_ticks(behaviour)
        self._next = 0

    @property
    def due(self) -> float:
        """Tick of the next frame; infinite after the last one."""
        if self._next == len(self._frames):
            return math.inf
        return self._ticks[self._next]

    def act(self, footprint: Floats) -> None:
        """Perform the next frame."""
        frame = self._frames[self._next]
        self._next += 1
        self._actuator.report(f"key frame {self._next} at {frame.time:g} s: to {frame.position:g}")
        self._actuator.move_to(frame.position, footprint, hold=False)


def frame_ticks(behaviour: KeyFrames) -> tuple[int, ...]:
    """Return the tick of every frame: the first one not before its time.

    Frames out of order of time have separate ticks in their own order.
    """
    # Round first: 1.1 s times 100 is 110.00000000000001, and its next whole tick is the 111th.
    ticks = [math.ceil(round(frame.time * TICK_RATE, 7)) for frame in behaviour.frames]
    if not behaviour.in_order:
        for k in range(1, len(ticks)):
            ticks[k] = max(ticks[k], ticks[k - 1] + 1)
    return tuple(ticks)


class TriggeredJoint:
    """Trigger of a joint: moves it when the robot comes near, and back if it re-arms."""

    def __init__(
        self,
        behaviour: Trigger,
        actuator: JointActuator,
        proximity: RobotProximity,
        fires: Callable[[], None],
    ) -> None:
        self._behaviour, self.actuator, self._proximity = behaviour, actuator, proximity
        self._fires = fires
        self._fired = False

    def check(self, base: Pose2, footprint: Floats) -> float:
        """Fire or re-arm if needed; return a way of the base [m] without a further crossing."""
        behaviour = self._behaviour
        threshold = behaviour.rearm if self._fired else behaviour.distance
        if threshold is None or math.isinf(threshold):  # it cannot act any more
            return math.inf
        # The cheap bound comes first: the robot is usually far from most doors, and the distance of
        # polygons is then unnecessary.
        slack = self._proximity.far_slack(base, threshold, inside=self._fired)
        if slack > 0.0:
            return slack
        distance = self._proximity.distance(base, footprint)
        if self._fired and distance > threshold:
            self._switch(False, f"re-armed at {distance:.3f} m: back to", footprint)
        elif not self._fired and distance < threshold:
            self._switch(True, f"triggered at {distance:.3f} m: to", footprint)
        return 0.0

    def _switch(self, has_fired: bool, text: str, footprint: Floats) -> None:
        self._fired = has_fired
        target = self._behaviour.end if has_fired else self._behaviour.start
        self.actuator.report(f"{text} {target:g}")
        self.actuator.move_to(target, footprint, hold=True)
        if has_fired:
            self._fires()


def starting_positions(
    scene: Scene, behaviours: Sequence[Behaviour]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the start positions by behaviours, and the joints that are held for good.

    Raises:
        ValueError: a behaviour names an unknown joint, one of a frozen object or of a mover, or
            one that another behaviour drives; or an object that walks is not a mover.
    """
    frozen = {f"{o.name}.{j.name}": o.frozen for o in scene.objects for j in o.joints}
    movers = {o.name: o for o in scene.objects if is_mover(o.joints)}
    start: dict[str, float] = {}
    # A person cannot be pushed: a mover without a walk stands still for good.
    holds = {
        f"{o.name}.{joint}": q
        for o in movers.values()
        for joint, q in zip(PLANAR_JOINTS, o.initial, strict=False)
    }
    driven: set[str] = set()
    for behaviour in behaviours:
        name = behaviour.joint
        if isinstance(behaviour, Walk) and behaviour.object not in movers:
            raise ValueError(f"behaviour walk: {behaviour.object!r} is not a mover")
        if name not in frozen:
            raise ValueError(f"behaviour {behaviour.kind}: the scene has no joint {name!r}")
        if frozen[name]:
            raise ValueError(f"behaviour {behaviour.kind}: joint {name!r} is frozen")
        if name in driven:
            raise ValueError(f"joint {name!r} has more than one behaviour")
        driven.add(name)
        if isinstance(behaviour, Walk):
            start.update(_first_step(behaviour, movers[behaviour.object]))
            for joint in behaviour.joints:
                del holds[joint]
                driven.add(joint)
        elif isinstance(behaviour, Hold):
            holds[name] = behaviour.position
        elif name in holds:
            raise ValueError(f"behaviour {behaviour.kind}: {name!r} belongs to a mover")
        elif behaviour.start_position is not None:
            start[name] = behaviour.start_position
    return start, holds


def _first_step(walk: Walk, mover: SceneObject) -> dict[str, float]:
    """Return the mover's joint positions at the first point of its route."""
    route = Route(walk)
    x, y = route.point(0.0)
    return dict(zip(walk.joints, chain_positions(mover, Pose2(x, y), route.yaw(0.0)), strict=True))
