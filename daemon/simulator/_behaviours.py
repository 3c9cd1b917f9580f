"""Controllers of the behaviours that move joints: key frames, triggers and reactions."""

from __future__ import annotations

import math
from collections.abc import Callable

from daemon.simulator._joints import JointDrive
from daemon.simulator._jump import Jumper
from daemon.simulator._layers import TICK_RATE
from daemon.simulator._proximity import Proximity
from grammars.behaviour import Jump, KeyFrame, KeyFrames, Motion, Reaction, Servo, Spring, Trigger
from grammars.values import Floats, Pose2

Report = Callable[[str, str], None]
"""Called with the joint name and what happened."""


class Mover:
    """Moves one joint the way a behaviour declares."""

    def __init__(self, motion: Motion, drive: JointDrive, jumper: Jumper, report: Report) -> None:
        self._motion, self._drive, self._jumper = motion, drive, jumper
        self._report = report
        self._wanted: float | None = None

    @property
    def name(self) -> str:
        """The scene-wide joint name."""
        return self._drive.motion.name

    @property
    def unfinished(self) -> bool:
        """Whether a held jump still waits for the robot to make way."""
        return self._wanted is not None

    def tell(self, text: str) -> None:
        """Report something that happened to this joint."""
        self._report(self.name, text)

    def go(self, target: float, footprint: Floats, *, hold: bool) -> None:
        """Start to move to ``target``; a jump with ``hold`` stays there, else it is let go."""
        match self._motion:
            case Servo(rate=rate, effort=effort):
                self._drive.servo(target, rate, effort)
            case Spring(stiffness=stiffness, damping=damping):
                self._drive.spring(target, stiffness, damping)
            case Jump():
                reached = self._jumper.jump(target, footprint)
                if reached != target:
                    self.tell(f"stopped at {reached:.3f} by the robot, short of {target:g}")
                self._wanted = target if hold and reached != target else None
                if hold:
                    self._drive.hold(reached)

    def retry(self, footprint: Floats) -> None:
        """Take a blocked, held jump as far as the robot now allows."""
        if self._wanted is None:
            return
        reached = self._jumper.jump(self._wanted, footprint)
        self._drive.hold(reached)
        if reached == self._wanted:
            self.tell(f"reached {reached:g}")
            self._wanted = None

    def hold_start(self, start: float) -> None:
        """Hold the joint where it starts, by the means of the motion."""
        match self._motion:
            case Servo(rate=rate, effort=effort):
                self._drive.servo(start, rate, effort)
            case Spring(stiffness=stiffness, damping=damping):
                self._drive.spring(start, stiffness, damping)
            case Jump():
                self._drive.hold(start)


class TimedMoves:
    """Plays key frames; a jumped joint is free between frames."""

    def __init__(self, behaviour: KeyFrames, mover: Mover) -> None:
        self._mover = mover
        self._frames = behaviour.frames
        self._next = 0

    @property
    def due(self) -> float:
        """The tick at which the next frame acts; infinite after the last one."""
        if self._next == len(self._frames):
            return math.inf
        return frame_tick(self._frames[self._next])

    def act(self, footprint: Floats) -> None:
        """Perform the frame that is due."""
        frame = self._frames[self._next]
        self._next += 1
        self._mover.tell(f"key frame {self._next} at {frame.time:g} s: to {frame.position:g}")
        self._mover.go(frame.position, footprint, hold=False)


def frame_tick(frame: KeyFrame) -> int:
    """Return the first tick not before the frame's time (within a nanosecond)."""
    return math.ceil(round(frame.time * TICK_RATE, 7))


class TriggeredMove:
    """Moves a joint when the robot comes near, and back when it leaves if it re-arms."""

    def __init__(
        self, behaviour: Trigger, mover: Mover, proximity: Proximity, fires: Callable[[], None]
    ) -> None:
        self._behaviour, self.mover, self.proximity = behaviour, mover, proximity
        self._fires = fires
        self._fired = self.close = False
        mover.hold_start(behaviour.start)

    @property
    def threshold(self) -> float:
        """The distance whose crossing matters next; infinite when nothing can happen any more."""
        behaviour = self._behaviour
        if not self._fired:
            return behaviour.distance
        return math.inf if behaviour.rearm is None else behaviour.rearm

    def watch(self, base: Pose2, footprint: Floats) -> float:
        """Fire or re-arm if it is time; return how much motion cannot change anything [m].

        Motion of the base origin alone, or, when ``close`` is set, of footprint and leaf too.
        """
        threshold, self.close = self.threshold, False
        if math.isinf(threshold):
            return math.inf
        slack = self.proximity.far_slack(base, threshold, inside=self._fired)
        if slack > 0.0:
            return slack
        self.close = True
        distance = self.proximity.distance(base, footprint)
        if self._fired and distance > threshold:
            self._switch(False, f"re-armed at {distance:.3f} m: back to", footprint)
        elif not self._fired and distance < threshold:
            self._switch(True, f"triggered at {distance:.3f} m: to", footprint)
        else:
            return self.proximity.near_slack(distance, threshold)
        return 0.0

    def _switch(self, fired: bool, text: str, footprint: Floats) -> None:
        self._fired = fired
        target = self._behaviour.end if fired else self._behaviour.start
        self.mover.tell(f"{text} {target:g}")
        self.mover.go(target, footprint, hold=True)
        if fired:
            self._fires()


class Reacting:
    """Moves a joint once, when it is told to."""

    def __init__(self, behaviour: Reaction, mover: Mover) -> None:
        self._behaviour, self.mover = behaviour, mover
        mover.hold_start(behaviour.start)

    def act(self, footprint: Floats) -> None:
        """Go: the event has happened and the delay is over."""
        self.mover.tell(f"reacts: to {self._behaviour.end:g}")
        self.mover.go(self._behaviour.end, footprint, hold=True)
