"""Behaviours that move joints: key frames, triggers and reactions, and where they start.

Triggers watch a distance to the robot; safe bounds say for how long they need not look.
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
"""How far a sliding joint may overrun its limits, generously [m]: one tick of a fast push."""

_COMPLIANCE = 0.002
"""More than loaded joints give way without their position changing [m]; a hinge that is pushed with
300 N gives way by 1.1 mm."""


class RobotProximity:
    """The distance a trigger watches, and a safe bound on when it need not be watched.

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
        # The centre the distance is measured to or bounded by, if it stands still.
        self._foot = motion.frame.apply(foot)
        if motion.parent == WORLD and doorway is None:
            self._fixed = self._centre()
        self._outlines = [
            ring_array(ring) for p in assembly.placements if p.owner == motion.owner
            for ring in p.rings
        ]  # fmt: skip
        # The watched distance is the one from the base origin to the centre, less at most
        # ``nearer`` and plus at most ``farther``.
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
        """Return a way the base origin may move before the distance can cross ``threshold``.

        Holds however the robot turns and the leaf moves, by the triangle inequality; 0 where no
        such bound holds. ``inside``: the distance is to grow beyond the threshold, not to fall
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
"""Called with the joint name and what happened."""


class JointActuator:
    """Moves one joint the way a behaviour declares."""

    def __init__(
        self, motion: Motion, drive: JointDrive, jumper: JointJumper, report: EventReporter
    ) -> None:
        self._motion, self._drive, self._jumper = motion, drive, jumper
        self._report = report
        self._target: float | None = None

    @property
    def name(self) -> str:
        """The scene-wide joint name."""
        return self._drive.motion.name

    @property
    def blocked(self) -> bool:
        """True while a jump that is to hold waits for the robot to make way."""
        return self._target is not None

    def report(self, text: str) -> None:
        """Report something that happened to this joint."""
        self._report(self.name, text)

    def move_to(self, target: float, footprint: Floats, *, hold: bool) -> None:
        """Start to move to ``target``; a jump with ``hold`` stays there, else it is let go."""
        if not isinstance(self._motion, Jump):
            self._drive.drive(self._motion, target)
            return
        reached = self._jumper.jump(target, footprint)
        if reached != target:
            self.report(f"stopped at {reached:.3f} by the robot, short of {target:g}")
        # Only what is to stay there goes on trying; a key frame had its moment.
        self._target = target if hold and reached != target else None
        if hold:
            self._drive.hold(reached)

    def retry(self, footprint: Floats) -> None:
        """Take a blocked jump that is to hold as far as the robot now allows."""
        if self._target is None:
            return
        reached = self._jumper.jump(self._target, footprint)
        self._drive.hold(reached)
        if reached == self._target:
            self.report(f"reached {reached:g}")
            self._target = None


class KeyFramePlayer:
    """Plays key frames; a jumped joint is free between frames."""

    def __init__(self, behaviour: KeyFrames, actuator: JointActuator) -> None:
        self._actuator = actuator
        self._frames = behaviour.frames
        self._ticks = frame_ticks(behaviour)
        self._next = 0

    @property
    def due(self) -> float:
        """The tick at which the next frame acts; infinite after the last one."""
        if self._next == len(self._frames):
            return math.inf
        return self._ticks[self._next]

    def act(self, footprint: Floats) -> None:
        """Perform the frame that is due."""
        frame = self._frames[self._next]
        self._next += 1
        self._actuator.report(f"key frame {self._next} at {frame.time:g} s: to {frame.position:g}")
        self._actuator.move_to(frame.position, footprint, hold=False)


def frame_ticks(behaviour: KeyFrames) -> tuple[int, ...]:
    """Return for every frame the tick it acts at: the first one not before its time.

    Frames that are not in order of time each have a tick of their own, after the one before.
    """
    # Rounded first: 1.1 s times 100 is 110.00000000000001, whose next whole tick is the 111th.
    ticks = [math.ceil(round(frame.time * TICK_RATE, 7)) for frame in behaviour.frames]
    if not behaviour.in_order:
        for k in range(1, len(ticks)):
            ticks[k] = max(ticks[k], ticks[k - 1] + 1)
    return tuple(ticks)


class TriggeredJoint:
    """Moves a joint when the robot comes near, and back when it leaves if it re-arms."""

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

    @property
    def threshold(self) -> float:
        """The distance whose crossing matters next; infinite when nothing can happen any more."""
        behaviour = self._behaviour
        if not self._fired:
            return behaviour.distance
        return math.inf if behaviour.rearm is None else behaviour.rearm

    def check(self, base: Pose2, footprint: Floats) -> float:
        """Fire or re-arm if it is time; return how far the base may move before it can be [m]."""
        threshold = self.threshold
        if math.isinf(threshold):
            return math.inf
        # The cheap bound first: most of a run the robot is far from most doors, and the distance
        # of polygons need not be computed at all.
        slack = self._proximity.far_slack(base, threshold, inside=self._fired)
        if slack > 0.0:
            return slack
        distance = self._proximity.distance(base, footprint)
        if self._fired and distance > threshold:
            self._switch(False, f"re-armed at {distance:.3f} m: back to", footprint)
        elif not self._fired and distance < threshold:
            self._switch(True, f"triggered at {distance:.3f} m: to", footprint)
        return 0.0

    def _switch(self, fired: bool, text: str, footprint: Floats) -> None:
        self._fired = fired
        target = self._behaviour.end if fired else self._behaviour.start
        self.actuator.report(f"{text} {target:g}")
        self.actuator.move_to(target, footprint, hold=True)
        if fired:
            self._fires()


def starting_positions(
    scene: Scene, behaviours: Sequence[Behaviour]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return where behaviours put joints at the start, and which joints they hold for good.

    Raises:
        ValueError: a behaviour names no joint of the scene, one of a frozen object, or one that
            another behaviour drives, or of a mover; walks of what is no mover.
    """
    frozen = {f"{o.name}.{j.name}": o.frozen for o in scene.objects for j in o.joints}
    movers = {o.name: o for o in scene.objects if is_mover(o.joints)}
    start: dict[str, float] = {}
    # Nothing pushes a person: a mover without a walk stands still for good.
    holds = {
        f"{o.name}.{joint}": q
        for o in movers.values()
        for joint, q in zip(PLANAR_JOINTS, o.initial, strict=False)
    }
    driven: set[str] = set()
    for behaviour in behaviours:
        name = behaviour.joint
        if isinstance(behaviour, Walk) and behaviour.object not in movers:
            raise ValueError(f"behaviour walk: {behaviour.object!r} is no mover")
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
    """Return where the mover's joints are when it stands on the first point of its route."""
    route = Route(walk)
    x, y = route.point(0.0)
    return dict(zip(walk.joints, chain_positions(mover, Pose2(x, y), route.yaw(0.0)), strict=True))
