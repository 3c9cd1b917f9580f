"""The loop of a run: the world, the system under test and the recording, instant by instant.

Simulated time advances in ticks of 10 ms. A tick has a fixed order: physics, ground truth and
joints, odometry, scans (in the robot's order of lasers), the system under test, its command.
``RunLoop._tick`` gives the reasons. Nothing here reads a clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from daemon.model.deadline import OutOfTime, check_wall_clock
from daemon.model.live_view import LiveView
from daemon.model.spec import RunEnding, RunSpec, Snapshot
from daemon.model.stack_reports import StackState
from daemon.model.sut import (
    TICK_RATE,
    Briefing,
    Cloud,
    Decision,
    Estimate,
    ExternalSystem,
    LaserScan,
    Observation,
    Odometry,
    SutEvent,
    SystemUnderTest,
)
from daemon.run_map import run_map
from daemon.simulator import World
from daemon.stacks.calls import SutError, check_decision, make_in_time, sut_call
from daemon.trace import Recorder
from grammars.model.geometry import Floats
from grammars.model.scene import Scene
from grammars.text.terminal_text import printable

STATE_RATE: Final = 20.0
"""Ground truth and joint states are recorded this often [Hz]."""
CLOCK_RATE: Final = 10.0
"""The simulated time is recorded this often [Hz]."""
SNAPSHOT_RATE: Final = 1.0
WATCHED_RATE: Final = 10.0
"""Rate at which a watcher is asked whether it wants a snapshot [Hz, simulated]."""

_LINE_LENGTH: Final = 120
"""Longest text of an external system in a snapshot [characters]; a pipe takes snapshots whole."""

ProgressCallback = Callable[[Snapshot], None]
Interest = Callable[[], Literal["nothing", "progress", "everything"]]
"""Called before each snapshot: whether to take it, and in which detail."""


@dataclass(slots=True)
class _PeriodicTimer:
    """Ticks at which something periodic is due: the k-th is the first tick at or after k/rate."""

    rate: float
    count: int = 0
    due: int = 0

    def move_on(self) -> None:
        """Advance to the next due tick."""
        self.count += 1
        # Computed from the count, so that a rate that does not divide 100 Hz does not drift. The
        # 1e-9 absorbs rounding: a period of 0.07 s has its first tick at 7.000000000000001.
        self.due = math.ceil(self.count * TICK_RATE / self.rate - 1e-9)


@dataclass(frozen=True, slots=True)
class LoopEnd:
    """End of a run, with a ``note``; ``stopped`` if the wall clock ended it."""

    ended: RunEnding
    note: str = ""
    stopped: bool = False


class RunLoop:
    """A run in progress: the world, the system under test and the recording.

    :meth:`run` goes to the end; :meth:`begin` and :meth:`advance` go step by step.
    ``sut`` replaces the specified system under test.
    """

    def __init__(
        self,
        spec: RunSpec,
        scene: Scene,
        trace: Recorder,
        on_progress: ProgressCallback | None = None,
        interest: Interest | None = None,
        sut: SystemUnderTest | None = None,
    ) -> None:
        # Two branches of one seed: random draws of a system under test never change doors or
        # noise, so different systems are compared under the same chance.
        world_seed, self._sut_seed = np.random.SeedSequence(spec.seed).spawn(2)
        self._driver = sut
        self._sut: SystemUnderTest
        start = spec.mission.start
        waypoints = tuple(waypoint.id for waypoint in spec.mission.waypoints)
        self.world = World(scene, spec.robot, start, spec.behaviours, world_seed, waypoints)
        self._spec, self._trace, self._on_progress = spec, trace, on_progress
        joints = dict(zip(self.world.joint_names, self.world.joint_positions(), strict=True))
        self._grid = run_map(spec.map, scene, spec.robot.laser.z, joints)
        self._update_call = sut_call("update()")
        self._external: ExternalSystem | None = None
        self._waiting = ""
        self._odometry: list[Odometry] = []
        self._scans: list[LaserScan] = []
        self._decision: Decision | None = None
        self._estimate: Estimate | None = None
        self._cloud: Cloud | None = None
        self._plan: Floats | None = None
        self._stack = StackState()
        self._recorded = -1
        self._state = _PeriodicTimer(STATE_RATE)
        self._clock = _PeriodicTimer(CLOCK_RATE)
        self._period = spec.robot.odometry.period
        self._odom = _PeriodicTimer(
            1.0 / self._period if self._period else spec.robot.odometry.rate
        )
        self._scan_timers = tuple(
            (laser.name, _PeriodicTimer(laser.rate)) for laser in spec.robot.lasers
        )
        self._update: _PeriodicTimer
        self._interest = interest
        self._snapshot = _PeriodicTimer(SNAPSHOT_RATE if interest is None else WATCHED_RATE)
        self._live_view: LiveView | None = None
        scans = (timer for _, timer in self._scan_timers)
        self._timers = [self._state, self._clock, self._odom, *scans]

    def run(self) -> LoopEnd:
        """Step until the mission is over, the limit is reached or the system crashes."""
        trace, world = self._trace, self.world
        try:
            self.begin()
            finished = self.advance(round(self._spec.limit * TICK_RATE))
            if self._external is not None:
                with sut_call("finish()"):
                    self._external.finish()
        except SutError as error:
            self._record_events(world.time, error.events)
            trace.event(world.time, "sut", error.note, level="error")
            return LoopEnd("crashed", error.note, error.stopped)
        finally:
            # Also after a crash: a trace is valid up to its last recorded state, which brings the
            # contacts and events since the state before.
            if self._recorded != world.tick:
                self._record_state()
        return LoopEnd("finished") if finished else LoopEnd("limit", "simulated time is up")

    def begin(self) -> None:
        """Record the constants of the run, make and start the system under test."""
        self._trace.static(self._grid)
        spec = self._spec
        self._sut = sut = self._driver or make_in_time(spec.sut.kind, spec.sut.local_parameters)
        self._external = sut if isinstance(sut, ExternalSystem) else None
        self._update = _PeriodicTimer(1.0 / sut.period)
        self._timers.append(self._update)
        briefing = Briefing(
            spec.robot, self._grid, spec.mission, spec.mission.start, self._sut_seed
        )
        with sut_call("start()"):
            sut.start(briefing)

    def advance(self, last: int) -> bool:
        """Step until tick ``last`` or the end of the mission; return whether that is over.

        Several calls have the effect of one call to the last tick: everything due at a tick
        happens once. Raises :class:`SutError`.
        """
        world = self.world
        while True:
            # Instant 0 is recorded and answered before anything moves. So is the instant of the
            # limit: the last answer may end the mission.
            finished = self._tick()
            if finished or world.tick >= last:
                return finished
            try:
                check_wall_clock()
            except OutOfTime as error:
                raise SutError(error) from error
            # In one go to the next due tick: a few dozen steps in Python per simulated second,
            # not a hundred for each timer.
            world.advance(min(self.next_due(), last) - world.tick)

    def _bring_up(self, first: Observation) -> None:
        """Wait for an external system; snapshots say what it still lacks."""
        if self._external is None:
            return
        with sut_call("bring_up()"):
            steps = self._external.bring_up(first)
        while True:
            # Never while a snapshot is sent: the reader of half a snapshot would wait.
            with sut_call("bring_up()"):
                waiting = next(steps, None)
            if waiting is None:
                break
            self._waiting = _one_line(waiting)
            self._publish_snapshot(first.time)
        self._waiting = ""

    def close(self) -> Mapping[str, bytes]:
        """End the world and an external system; return the system's outputs by name."""
        self.world.close()
        if self._external is None:
            return {}
        self._external.close()
        return self._external.outputs()

    def next_due(self) -> int:
        """Return the next tick at which a timer is due."""
        # A plain loop: ``min`` over a generator takes six times as long.
        due = self._state.due
        for timer in self._timers:
            if timer.due < due:
                due = timer.due
        return due

    def _tick(self) -> bool:
        """Do everything due now; return whether the mission is over.

        The physics has reached this instant. Everything here sees the same state of the world;
        the answer acts from the next physics step on.
        """
        world, trace = self.world, self._trace
        tick, now = world.tick, world.time
        # Truth first: answers of this instant are compared with it, and it is in the trace even
        # when an answer raises.
        if tick >= self._clock.due:
            self._clock.move_on()
            trace.clock(now)
        if tick >= self._state.due:
            self._state.move_on()
            self._record_state()
        # Odometry before the scans, both before the update: the system under test can place a scan
        # by the odometry of the same stamp, and sees this instant, not the tick before.
        if tick >= self._odom.due:
            # A period need not be a multiple of a tick: the sample may lie within the last tick.
            sample = world.odometry(self._odom.count * self._period if self._period else now)
            self._odom.move_on()
            trace.odometry(sample)
            self._odometry.append(sample)
        for laser, timer in self._scan_timers:
            if tick >= timer.due:
                timer.move_on()
                ranges = world.scan(laser)
                trace.scan(now, ranges, laser)
                self._scans.append(LaserScan(now, ranges, laser))
                if self._live_view is not None:
                    self._live_view.add_scan(world.pose(), ranges, laser)
        # Last, after all measurements of this instant: the command moves the robot from the next
        # step on.
        finished = False
        if tick >= self._update.due:
            self._update.move_on()
            finished = self._update_sut(now)
        if self._on_progress is not None and tick >= self._snapshot.due:
            self._snapshot.move_on()
            self._publish_snapshot(now)
        return finished

    def _record_state(self) -> None:
        world, trace = self.world, self._trace
        self._recorded, now = world.tick, world.time
        trace.ground_truth(now, world.pose(), world.twist())
        trace.joints(now, *world.joint_states())
        for contact in world.take_contacts():
            trace.contact(
                contact.until,
                contact.first,
                contact.second,
                contact.point,
                contact.normal,
                contact.depth,
            )
            if self._live_view is not None:
                self._live_view.contacts.append(contact.point)
        for event in world.take_events():
            trace.event(event.time, event.source, event.text)

    def _update_sut(self, now: float) -> bool:
        """Give the system under test the new measurements; record and apply its answer."""
        truth = self.world.pose() if self._sut.needs_ground_truth else None
        observation = Observation(now, tuple(self._odometry), tuple(self._scans), truth)
        self._odometry.clear()
        self._scans.clear()
        if self._decision is None:
            self._bring_up(observation)
        with self._update_call:
            decision = self._sut.update(observation)
            check_decision(decision)
        try:
            # Record first: an answer that the trace refuses (a plan of another shape) must not
            # move the robot.
            progressed = self._decision is None or decision.progress != self._decision.progress
            self._record_decision(now, decision, progressed)
            if progressed:
                self.world.progress(decision.progress.current, decision.progress.reached)
            if decision.command is not None:
                self.world.command(decision.command)
        except ValueError as error:
            raise SutError(error) from error
        self._decision = decision
        return decision.progress.state != "active"

    def _record_decision(self, now: float, decision: Decision, progressed: bool) -> None:
        trace = self._trace
        if decision.estimate is not None:
            trace.estimate(decision.estimate)
            self._estimate = decision.estimate
        if decision.cloud is not None:
            trace.cloud(decision.cloud)
            self._cloud = decision.cloud
        if decision.plan is not None:
            trace.plan(now, decision.plan)
            self._plan = decision.plan
        if decision.local_plan is not None:
            trace.local_plan(now, decision.local_plan)
        if decision.particles is not None:
            # The cloud sums up these particles, so they have its stamp.
            trace.particles(decision.cloud.time if decision.cloud else now, decision.particles)
        if decision.costmap is not None:
            trace.costmap(decision.costmap)
        for report in decision.reports:
            trace.report(report)
            self._stack.take(report)
        if progressed:
            trace.progress(now, decision.progress)
        if decision.command is not None:
            trace.command(now, decision.command)
        if decision.latency is not None:
            trace.latency(now, decision.latency)
        self._record_events(now, decision.events)

    def _record_events(self, now: float, events: Iterable[str | SutEvent]) -> None:
        for event in events:
            if isinstance(event, str):
                event = SutEvent(event)
            self._trace.event(now, event.source, event.text, level=event.level)

    def _publish_snapshot(self, now: float) -> None:
        """Publish the progress of the run in the detail that the watchers ask for."""
        detail = "progress" if self._interest is None else self._interest()
        if detail == "nothing" or self._on_progress is None:
            return
        if detail == "everything":
            self._on_progress(self.snapshot(now))
        else:
            # Nobody watches the map any more: stop collecting scans and contacts.
            self._live_view = None
            self._on_progress(self._take_snapshot(now))

    def snapshot(self, now: float) -> Snapshot:
        """Return a snapshot with everything visible; the first call begins to collect scans."""
        if self._live_view is None:
            self._live_view = LiveView(self._spec.robot.lasers)
        belief = self._cloud or self._estimate
        costmap = self._stack.costmap
        return self._live_view.extend(self._take_snapshot(now), belief, self._plan, costmap)

    def _take_snapshot(self, now: float) -> Snapshot:
        decision = self._decision
        return Snapshot(
            time=now,
            limit=self._spec.limit,
            pose=self.world.pose(),
            estimate=None if self._estimate is None else self._estimate.pose,
            reached=decision.progress.reached if decision else 0,
            waypoints=len(self._spec.mission.waypoints),
            joints=tuple(self.world.joint_positions().tolist()),
            waiting=self._waiting,
            stack=_one_line(self._stack.line),
        )


def _one_line(text: str) -> str:
    """Return text of a system as one line, safe for any terminal and any JSON."""
    return printable(" ".join(text[: 2 * _LINE_LENGTH].split())[:_LINE_LENGTH])
