"""Scheduler of behaviours: they act at the right ticks and cost almost nothing in between.

Reactions and walks wait in a queue for events of the run, and each happens once.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from daemon.model.sut import TICK_RATE
from daemon.simulator import _chipmunk as chipmunk
from daemon.simulator._assembly import BodyAssembly
from daemon.simulator._behaviours import (
    EventReporter,
    JointActuator,
    KeyFramePlayer,
    RobotProximity,
    TriggeredJoint,
)
from daemon.simulator._joints import JointDrive, JointJumper
from daemon.simulator._mobile_base import MobileBase
from daemon.simulator._physics import centroid, ring_array, transform_array
from daemon.simulator._walkers import Walker
from grammars.model.behaviour import (
    Behaviour,
    Event,
    Hold,
    JointActs,
    KeyFrames,
    LegBegins,
    Reaction,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.model.geometry import Floats, Point2
from grammars.model.robot import Robot
from grammars.model.scene import Scene

Action = Callable[[], None]
MOVED_BY = 0.01
"""Displacement at which a joint has started to move [rad or m]: more than the yield under a load,
less than an open door."""


class EventQueue:
    """Actions that wait for events, and the agenda of those whose delay runs.

    Attributes:
        due: tick at which the next act is due, if any.
    """

    def __init__(
        self, waypoints: Sequence[str], positions: Mapping[str, Callable[[], float]]
    ) -> None:
        self._waypoints = list(waypoints)
        # Looked up late, because walkers add theirs after this queue is made.
        self._positions = positions
        self._waiting: list[tuple[Event, int, Action]] = []
        self._agenda: list[tuple[int, int, Action]] = []
        self._watched: dict[str, float] = {}
        self._count = 0

    def wait(self, event: Event, delay: int, act: Action) -> None:
        """Let ``act`` be called ``delay`` ticks after ``event``.

        Raises:
            ValueError: the mission has no such waypoint.
        """
        if isinstance(event, WaypointReached) and event.waypoint not in self._waypoints:
            raise ValueError(f"the mission has no waypoint {event.waypoint!r}")
        self._waiting.append((event, delay, act))
        # Watched joints keep their first position, so that slow motion adds up.
        self._watch()

    def _watch(self) -> None:
        """Watch the joints whose motion an action waits for, from their present positions."""
        names = {
            name
            for event, _, _ in self._waiting
            if isinstance(event, JointActs) and event.act == "moves"
            for name in event.joints
            if name in self._positions
        }
        self._watched = {
            name: self._watched.get(name, self._positions[name]()) for name in sorted(names)
        }

    @property
    def due(self) -> float:
        """Tick of the next action on the agenda; infinite without one."""
        return self._agenda[0][0] if self._agenda else math.inf

    @property
    def watching(self) -> bool:
        """True while :meth:`check_moving_joints` must be called every tick."""
        return bool(self._watched)

    def note_progress(self, current: int, reached: int, tick: int) -> None:
        """Process the mission: index of the present waypoint, number of reached ones."""

        def happened(event: Event) -> bool:
            if isinstance(event, LegBegins):
                return current >= event.leg - 1
            if isinstance(event, WaypointReached):
                return reached > self._waypoints.index(event.waypoint)
            return False

        self._schedule_matching(happened, tick)

    def note_fired(self, joint: str, tick: int) -> None:
        """Process the firing of a joint's behaviour."""
        self._schedule_matching(
            lambda e: isinstance(e, JointActs) and e.act == "fires" and joint in e.joints, tick
        )

    def check_moving_joints(self, tick: int) -> None:
        """Process joints that have started to move."""
        stirred = {
            name
            for name, start in self._watched.items()
            if abs(self._positions[name]() - start) >= MOVED_BY
        }
        if stirred:
            self._schedule_matching(
                lambda e: (
                    isinstance(e, JointActs)
                    and e.act == "moves"
                    and not stirred.isdisjoint(e.joints)
                ),
                tick,
            )
            self._watch()

    def _schedule_matching(self, happened: Callable[[Event], bool], tick: int) -> None:
        waiting, self._waiting = self._waiting, []
        for event, delay, act in waiting:
            if happened(event):
                # The count keeps the actions of one tick in the order of their declaration.
                self._count += 1
                heapq.heappush(self._agenda, (tick + delay, self._count, act))
            else:
                self._waiting.append((event, delay, act))

    def run_due(self, tick: int) -> None:
        """Run the due actions, and those that become due by them."""
        while self._agenda and self._agenda[0][0] <= tick:
            heapq.heappop(self._agenda)[2]()


class BehaviourScheduler:
    """Owner of the controllers of a run; it calls them only when they can matter.

    Attributes:
        due: tick of the next call of :meth:`update`; earlier calls change nothing.
    """

    def __init__(
        self,
        scene: Scene,
        robot: Robot,
        behaviours: Sequence[Behaviour],
        drives: Mapping[str, JointDrive],
        assembly: BodyAssembly,
        base: MobileBase,
        report: EventReporter,
        waypoints: Sequence[str] = (),
    ) -> None:
        self._base, self._report, self._assembly, self._drives = base, report, assembly, drives
        self._footprint = ring_array(robot.footprint)
        self._timed: list[KeyFramePlayer] = []
        self._triggers: list[TriggeredJoint] = []
        self._reacting: list[JointActuator] = []
        self._walkers: list[Walker] = []
        self._tick = 0
        self._doorways = {d.name: centroid(d.footprint) for d in scene.doorways}
        positions: dict[str, Callable[[], float]] = {
            name: drive.position for name, drive in drives.items()
        }
        self._events = EventQueue(waypoints, positions)
        # First make all walkers, then let them wait: a walk may wait for the motion of another
        # walker, which needs that walker's position.
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
        self._due = min((t.due for t in self._timed), default=math.inf)
        self._checked_at = (0.0, 0.0)
        self._slack = 0.0 if self._triggers else math.inf
        self.due: float = 0

    def _add(self, behaviour: KeyFrames | Trigger | Reaction) -> None:
        name, drive = behaviour.joint, self._drives[behaviour.joint]
        actuator = JointActuator(
            behaviour.motion, drive, JointJumper(drive, self._assembly), self._report
        )
        if isinstance(behaviour, KeyFrames):
            self._timed.append(KeyFramePlayer(behaviour, actuator))
            return
        drive.drive(behaviour.motion, behaviour.start)
        if isinstance(behaviour, Trigger):
            centre = _doorway_centre(behaviour, drive, self._doorways)
            near = RobotProximity(drive, self._assembly, behaviour, centre, self._footprint)
            fires = partial(self._note_fired, name)
            self._triggers.append(TriggeredJoint(behaviour, actuator, near, fires))
        else:
            self._reacting.append(actuator)
            react = partial(self._react, actuator, behaviour.end)
            self._wait(behaviour.event, behaviour.delay, react)

    def _set_out(self, walker: Walker) -> None:
        walker.set_out(self._tick)

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
        self._events.wait(event, round(delay * TICK_RATE), act)

    def _react(self, actuator: JointActuator, end: float) -> None:
        """Move a joint after the event and the delay."""
        actuator.report(f"reacts: to {end:g}")
        actuator.move_to(end, self._world_footprint(), hold=True)
        self._note_fired(actuator.name)

    def _note_fired(self, joint: str) -> None:
        self._events.note_fired(joint, self._tick)

    def progress(self, current: int, reached: int, tick: int) -> None:
        """Process the progress of the mission."""
        self._events.note_progress(current, reached, tick)
        # An action that waited for this may be due at once.
        self.due = min(self.due, self._events.due)

    def update(self, tick: int) -> None:
        """Run everything that is due at the start of ``tick``.

        Causes come before effects: key frames and triggers, then moving joints, then the actions
        that waited for them, so that a reaction without a delay happens in the same tick.
        """
        self._tick = tick
        if tick >= self._due:
            self._play(tick)
        # Not ``>=``, so that a position of nan leads to a check.
        if self._slack != math.inf and not self._way_since_check() < self._slack:
            self._check_triggers()
        if self._events.watching:
            self._events.check_moving_joints(tick)
        if tick >= self._events.due:
            self._events.run_due(tick)
        # Walkers come last: one that sets out now makes its first step now.
        for actuator in self._reacting:
            if actuator.blocked:
                actuator.retry(self._world_footprint())
        for walker in self._walkers:
            walker.update(tick)
        self.due = self._next_due(tick)

    def _next_due(self, tick: int) -> float:
        """Return the first tick after ``tick`` with possible actions."""
        # Distances of the robot, motions of joints and blocked jumps can change in every tick. Only
        # actions with a fixed time allow a wait.
        following = tick + 1
        if self._slack != math.inf or self._events.watching:
            return following
        due = min(self._due, self._events.due)
        if any(actuator.blocked for actuator in self._reacting):
            return following
        for walker in self._walkers:
            due = min(due, walker.due)
        return max(following, due)

    def _way_since_check(self) -> float:
        """Return the distance of the base from its place at the last check of triggers [m]."""
        base = chipmunk.position(self._base.handle)
        return math.hypot(base.x - self._checked_at[0], base.y - self._checked_at[1])

    def _play(self, tick: int) -> None:
        footprint = self._world_footprint()
        for timed in self._timed:
            while timed.due <= tick:
                timed.act(footprint)
        self._due = min(timed.due for timed in self._timed)

    def _check_triggers(self) -> None:
        pose, footprint = self._base.pose(), self._world_footprint()
        slacks = []
        for trigger in self._triggers:
            trigger.actuator.retry(footprint)
            slack = trigger.check(pose, footprint)
            # A blocked jump is retried every tick, so that it follows the robot out of its way.
            slacks.append(0.0 if trigger.actuator.blocked else slack)
        self._checked_at = (pose.x, pose.y)
        # Slightly less than the bound, so that rounding cannot delay a check.
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
