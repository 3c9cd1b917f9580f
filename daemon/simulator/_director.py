"""Lets behaviours act at the right ticks, and costs next to nothing in between."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from daemon.simulator._base import Base
from daemon.simulator._behaviours import Mover, Reacting, Report, TimedMoves, TriggeredMove
from daemon.simulator._cues import Cues
from daemon.simulator._geometry import area_and_centroid, ring_array, transform_array
from daemon.simulator._joints import JointDrive
from daemon.simulator._jump import Jumper
from daemon.simulator._layers import TICK_RATE
from daemon.simulator._links import Assembly
from daemon.simulator._proximity import Proximity
from daemon.simulator._walkers import Walker
from grammars.behaviour import Behaviour, Event, Hold, KeyFrames, Reaction, Trigger, Walk
from grammars.robot import Robot
from grammars.scene import Scene
from grammars.values import Floats, Point2


class Director:
    """Owns the controllers of one run and calls them when, and only when, they can matter.

    Attributes:
        active: whether there is anything to do at all.
    """

    def __init__(
        self,
        scene: Scene,
        robot: Robot,
        behaviours: Sequence[Behaviour],
        drives: Mapping[str, JointDrive],
        assembly: Assembly,
        base: Base,
        report: Report,
        waypoints: Sequence[str] = (),
    ) -> None:
        self._base, self._report, self._assembly, self._drives = base, report, assembly, drives
        self._footprint = ring_array(robot.footprint)
        self._timed: list[TimedMoves] = []
        self._triggers: list[TriggeredMove] = []
        self._reacting: list[Reacting] = []
        self._walkers: list[Walker] = []
        self._tick = 0
        self._radius = max(math.hypot(*corner) for corner in robot.footprint)
        self._doorways = {d.name: area_and_centroid(d.footprint)[1] for d in scene.doorways}
        positions: dict[str, Callable[[], float]] = {
            name: drive.position for name, drive in drives.items()
        }
        self._cues = Cues(waypoints, positions)
        walks = [b for b in behaviours if isinstance(b, Walk)]
        for walk in walks:
            walker = self._add_walker(walk)
            positions.update(dict.fromkeys(walk.joints, walker.moved))
        for walk, walker in zip(walks, self._walkers, strict=True):
            if walk.event is not None:
                self._wait(walk.event, walk.start, partial(self._set_out, walker))
        for behaviour in behaviours:
            if not isinstance(behaviour, Hold | Walk):
                self._add(behaviour)
        self.active = bool(self._timed or self._triggers or self._reacting or self._walkers)
        self._due = min((t.due for t in self._timed), default=math.inf)
        self._close: list[Proximity] = []
        self._seen = (0.0, 0.0, 0.0)
        self._slack = 0.0

    def _add(self, behaviour: KeyFrames | Trigger | Reaction) -> None:
        name, drive = behaviour.joint, self._drives[behaviour.joint]
        mover = Mover(behaviour.motion, drive, Jumper(drive, self._assembly), self._report)
        if isinstance(behaviour, KeyFrames):
            self._timed.append(TimedMoves(behaviour, mover))
        elif isinstance(behaviour, Trigger):
            centre = _doorway_centre(behaviour, drive, self._doorways)
            near = Proximity(
                drive, self._assembly, behaviour.of, behaviour.to, centre, self._footprint
            )
            self._triggers.append(
                TriggeredMove(behaviour, mover, near, lambda: self._cues.fired(name, self._tick))
            )
        else:
            reacting = Reacting(behaviour, mover)
            self._reacting.append(reacting)
            self._wait(behaviour.event, behaviour.delay, lambda: self._react(reacting))

    def _set_out(self, walker: Walker) -> None:
        walker.begin(self._tick)

    def _add_walker(self, walk: Walk) -> Walker:
        (slot,) = {m.child for m in self._assembly.walks if m.name == walk.joint}
        rings = [
            ring
            for placement in self._assembly.placements_on(slot)
            if placement.owner in self._assembly.owners.values()
            for ring in placement.rings
        ]
        walker = Walker(
            walk, self._assembly.bodies[slot], rings, self._base, self._footprint, self._report
        )
        self._walkers.append(walker)
        return walker

    def _wait(self, event: Event, delay: float, act: Callable[[], None]) -> None:
        self._cues.wait(event, round(delay * TICK_RATE), act)

    def _react(self, reacting: Reacting) -> None:
        reacting.act(self._world_footprint())
        self._cues.fired(reacting.mover.name, self._tick)

    def progress(self, current: int, reached: int, tick: int) -> None:
        """Take note of what the mission has come to."""
        self._cues.progress(current, reached, tick)

    def update(self, tick: int) -> None:
        """Let everything happen that is due at the start of ``tick``."""
        self._tick = tick
        if tick >= self._due:
            self._play(tick)
        if self._triggers and not self._motion() < self._slack:
            self._watch()
        if self._cues.watching:
            self._cues.look(tick)
        if tick >= self._cues.due:
            self._cues.play(tick)
        if self._reacting:
            self._retry()
        if self._walkers:
            for walker in self._walkers:
                walker.update(tick)

    def _retry(self) -> None:
        for reacting in self._reacting:
            if reacting.mover.unfinished:
                reacting.mover.retry(self._world_footprint())

    def _motion(self) -> float:
        """Return a bound on what moved since the triggers were watched [m]."""
        x, y = self._base.body.position
        motion = math.hypot(x - self._seen[0], y - self._seen[1])
        if self._close:
            motion += self._radius * abs(self._base.body.angle - self._seen[2])
            motion += max(proximity.moved() for proximity in self._close)
        return motion

    def _play(self, tick: int) -> None:
        footprint = self._world_footprint()
        for timed in self._timed:
            while timed.due <= tick:
                timed.act(footprint)
        self._due = min(timed.due for timed in self._timed)

    def _watch(self) -> None:
        pose, footprint = self._base.pose(), self._world_footprint()
        slacks = []
        for trigger in self._triggers:
            trigger.mover.retry(footprint)
            slack = trigger.watch(pose, footprint)
            slacks.append(0.0 if trigger.mover.unfinished else slack)
        self._close = [trigger.proximity for trigger in self._triggers if trigger.close]
        self._seen = (pose.x, pose.y, self._base.body.angle)
        # Slightly less than the bound, so that rounding cannot make a check late.
        self._slack = min(slacks) - 1e-6

    def _world_footprint(self) -> Floats:
        return transform_array(self._base.pose(), self._footprint)


def _doorway_centre(
    behaviour: Trigger, drive: JointDrive, doorways: Mapping[str, Point2]
) -> Point2 | None:
    if behaviour.of != "doorway":
        return None
    name = drive.motion.doorway
    if name not in doorways:
        raise ValueError(f"trigger of joint {behaviour.joint!r}: its object stands in no doorway")
    return doorways[name]
