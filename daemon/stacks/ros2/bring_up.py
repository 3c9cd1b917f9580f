"""Bring-up of a stack, from its command until it is ready for a mission.

The steps: start the stack, connect the relay, send the initial pose, wait until every lifecycle
node is active, and advance the clock to a round number.
"""

from __future__ import annotations

import time as wall_clock
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from daemon.model.sut import Briefing, Observation, StackReport, SutEvent, SutFailure
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.causes import (
    ABORTED,
    find_cause,
    first_error,
    read_death,
    read_down,
    telling_lines,
)
from daemon.stacks.ros2.endpoints import fixed_messages, link_setup, measured_messages, scan_topics
from daemon.stacks.ros2.isolation import DomainTaken
from daemon.stacks.ros2.link import (
    Cycle,
    CycleAnswer,
    LinkLost,
    LinkRefused,
    Readiness,
    RelayLink,
    relay_path,
)
from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.settings import MAP, Ros2Settings, run_values
from daemon.stacks.ros2.telemetry import Telemetry
from grammars.model.geometry import Pose2
from grammars.model.map_files import write_map

_NANO: Final = 1_000_000_000
_FIRST_CLOCK: Final = _NANO
"""ROS time of the first clock: bring-up from 1 s succeeded, from 100 s it failed once, and 0 means
"no clock yet" to ROS."""
_ROUND: Final = 5 * _NANO
"""The run begins at a multiple of this, so that results of a stack's clock are mostly the same in
every run, independent of the duration of its bring-up."""
_ALIGNING_PAUSE: Final = 0.005
_ASK_PERIOD: Final = 0.25
_POSE_PERIOD: Final = 3.0
"""Interval of the initial pose until the stack has a pose [s of wall clock]."""
_POSE_PATIENCE: Final = 5.0
"""Time for an otherwise ready stack to publish its pose [s of wall clock]."""
_FAR: Final = 0.5
"""Largest distance between start and estimated pose without a warning [m, rad]."""
_NOT_UP: Final = "the stack did not come up"
_POLL: Final = 0.05
_SETTLING: Final = 0.2
"""Longest delay of a process's last lines after the news of its death [s of wall clock]."""
_EXIT_CODE_LIMIT: Final = 1.0
"""Longest wait for launch to print the exit code of a dead process [s of wall clock]."""
_ORDINALS: Final = ("first", "second", "third")


class StackSession:
    """A running stack with its link; ``zero`` is the ROS time of simulated time 0 [ns]."""

    def __init__(self, settings: Ros2Settings, process: StackProcess, link: RelayLink) -> None:
        self.settings, self.process, self.link = settings, process, link
        self.telemetry = Telemetry(settings)
        self.zero = self.time = 0
        # The newest report of each kind from before the run; a costmap may come with every tick.
        self.reports: dict[tuple[type[StackReport], str], StackReport] = {}
        self.fault = ""
        """Defect of the stack, empty while it is sound."""
        self.is_aborted = False
        """True after Nav2's lifecycle manager has given up bringing its nodes up."""
        self._alarms = 0
        self._events: list[SutEvent] = []
        # A long wait for a command must not hide a death.
        link.is_interrupted = self.is_dead

    def watch(self) -> list[SutEvent]:
        """Check the stack's processes; return new events for the log."""
        self.is_dead()
        events, self._events = self._events, []
        return events

    def is_dead(self) -> bool:
        """Check the stack's processes; tell whether the stack has a fault."""
        self._look()
        if not self.fault and (process := self.process.dead_process()):
            self._look_until(_EXIT_CODE_LIMIT)
            self.fault = self.fault or f"{process} died"
        return bool(self.fault)

    def _look_until(self, limit: float) -> None:
        """Wait for a fault, at most ``limit`` [s of wall clock]."""
        until = wall_clock.monotonic() + limit
        while not self.fault and wall_clock.monotonic() < until:
            wall_clock.sleep(_POLL)
            self._look()

    def _look(self) -> None:
        """Read the supervisor's new reports."""
        ended = self.process.ended()
        alarms = self.process.alarms()[self._alarms :]
        self._alarms += len(alarms)
        for line in alarms:
            death, node = read_death(line), read_down(line)
            if death is not None and not death.is_of(self.settings.ready):
                text = f"{death}; it has none of the nodes of ready"
                self._events.append(SutEvent(text, "warn"))
            elif death is not None:
                self.fault = self.fault or str(death)
            elif node:
                down = f"{node} is down: the lifecycle manager has missed its heartbeat"
                self.fault = self.fault or down
            self.is_aborted = self.is_aborted or ABORTED in line
        # A launch file may end everything because of a death, which explains more.
        self.fault = self.fault or ended

    def cycle(self, cycle: Cycle) -> CycleAnswer:
        """Run one cycle; the clock never goes back."""
        self.time = cycle.time
        return self.link.cycle(cycle)

    def explain(self, error: LinkLost) -> str:
        """Return why the link was lost; the end of a process explains more than its silence.

        A refusal is the reason itself: after it the link closes, and therefore the relay ends.
        """
        if isinstance(error, LinkRefused):
            return str(error)
        if not self.is_dead():
            self._look_until(2.0)
        return self.fault or str(error)

    def failure(self, reason: str, events: Sequence[SutEvent] = ()) -> SutFailure:
        """Return a failure of the stack with its most telling output lines."""
        return SutFailure(reason, printed=telling_lines(self.process.lines()), events=events)

    def start_failure(self, fault: str) -> SutFailure:
        """Return a failure of the start, with its cause if the stack has printed it."""
        wall_clock.sleep(_SETTLING)
        printed = self.process.lines()
        cause = find_cause(printed, self.settings.files)
        first = first_error(printed)
        return self.failure(f"{_NOT_UP}: {cause or (f'{fault}: {first}' if first else fault)}")

    def close(self) -> Mapping[str, bytes]:
        """End the stack; return its output."""
        self.link.close()
        self.process.release()
        return self.process.outputs()


class BringUp:
    """Start of a stack; ``session`` exists once a link listens.

    ``outputs`` are those of all attempts except the last, by name.
    """

    def __init__(self, settings: Ros2Settings, briefing: Briefing, first: Observation) -> None:
        self._settings, self._briefing = settings, briefing
        self._first = first
        self._latched = False
        self._began = 0.0
        self.session: StackSession | None = None
        self.events: list[SutEvent] = []
        self.outputs: dict[str, bytes] = {}

    def run(self) -> Iterator[str]:
        """Yield progress messages; raises :class:`SutFailure` if the stack does not come up."""
        self._began = wall_clock.monotonic()
        for ordinal in _ORDINALS[: self._settings.attempts]:
            try:
                yield from self._attempt()
                break
            except SutFailure as error:
                is_last = ordinal == _ORDINALS[self._settings.attempts - 1]
                if is_last or self._seconds() > self._settings.start_up:
                    raise
                why = error.reason.removeprefix(f"{_NOT_UP}: ")
                text = f"the {ordinal} start failed: {why}; started again"
                self.events.append(SutEvent(text, "warn"))
                self._end_attempt(ordinal)
        identity = self.ready_session().link.identity
        self.events.append(
            SutEvent(
                f"ready after {self._seconds():.1f} s of wall clock; ROS 2 "
                f"{identity.distribution or 'of unknown distribution'}, {identity.rmw}; "
                f"time 0 is ROS time {self.ready_session().zero / _NANO:g} s"
            )
        )

    def _attempt(self) -> Iterator[str]:
        try:
            yield from self._connect()
            yield from self._wait_until_ready()
            self._align()
        except LinkLost as error:
            session = self.ready_session()
            raise session.start_failure(session.explain(error)) from error

    def _end_attempt(self, ordinal: str) -> None:
        """End a stack that did not come up, and keep its output."""
        if self.session is not None:
            for name, data in self.session.close().items():
                self.outputs[f"{ordinal}-{name}"] = data
        self.session = None
        self._latched = False

    def ready_session(self) -> StackSession:
        """Return the session, which must exist."""
        assert self.session is not None
        return self.session

    def _connect(self) -> Iterator[str]:
        """Start the stack and wait for a link to it."""
        settings = self._settings
        yield "starting the stack"
        values = run_values(settings, self._briefing)
        process = StackProcess(settings, values=values, relay=relay_path())
        # The path of the map depends on the folder; the start uses the values later.
        values[MAP] = str(self._write_map(process))
        try:
            link = RelayLink.listen(process.socket, process.nonce)
        except LinkLost as error:
            process.release()
            raise SutFailure(str(error)) from error
        self.session = StackSession(settings, process, link)
        yield from self._start(process)
        while not link.accept(timeout=0.1):
            self._check_alive("its relay has not come")
            yield f"waiting for the relay in the stack's ROS 2, {self._waited()}"
        link.set_up(link_setup(settings, self._briefing.robot.lasers))

    def _start(self, process: StackProcess) -> Iterator[str]:
        """Start the processes; wait while another run holds the domain."""
        while True:
            try:
                process.start()
            except DomainTaken as error:
                if self._seconds() > self._settings.start_up:
                    raise
                yield str(error)
                wall_clock.sleep(_ASK_PERIOD)
            else:
                return

    def _wait_until_ready(self) -> Iterator[str]:
        session, settings = self.ready_session(), self._settings
        next_ask = next_pose = 0.0
        complete_since: float | None = None
        readiness: Readiness | None = None
        while True:
            self._tick(wait=settings.period)
            now = wall_clock.monotonic()
            if now >= next_ask:
                next_ask, readiness = now + _ASK_PERIOD, session.link.readiness()
            assert readiness is not None
            pose = session.telemetry.pose()
            is_due = readiness.listeners.get(settings.topics.initial_pose, 0) > 0
            is_due = is_due and pose is None and now >= next_pose
            if settings.initial_pose == "published" and is_due:
                self._send_pose()
                next_pose = now + _POSE_PERIOD
            missing = self._missing(readiness)
            if not missing:
                complete_since = complete_since or now
                if pose is not None or now - complete_since > _POSE_PATIENCE:
                    break
                missing = f"no transform {settings.frames.map} -> {settings.frames.base} yet"
            else:
                complete_since = None
            self._check_alive(missing)
            yield f"{missing}, {self._waited()}"
        session.process.watch_nodes(settings.ready)
        self._check_pose(session.telemetry.pose())
        self._check_alone()

    def _missing(self, readiness: Readiness) -> str:
        """Return the first thing that the stack still lacks, or an empty text."""
        settings = self._settings
        states = readiness.nodes
        waiting = [node for node in settings.ready if states.get(node) != "active"]
        if waiting:
            active = len(settings.ready) - len(waiting)
            state = states.get(waiting[0]) or "not there"
            return (
                f"{active} of {len(settings.ready)} nodes active, {waiting[0].lstrip('/')} "
                f"is {state}"
            )
        if not readiness.server:
            return f"no action server {settings.action}"
        scans = scan_topics(settings, self._briefing.robot.lasers)
        if not settings.ready and not any(readiness.listeners.get(name, 0) for name in scans):
            return f"no subscription to {' or '.join(scans)}"
        return ""

    def _check_alone(self) -> None:
        """Raise :class:`SutFailure` if another program publishes a clock in this stack's domain.

        Domains are exclusive among runs, but other programs may use them.
        """
        session = self.ready_session()
        clocks = [
            end.node
            for end in session.link.graph().endpoints
            if end.topic == "/clock" and end.role == "publisher"
        ]
        if clocks:
            raise SutFailure(
                f"{', '.join(clocks)} publishes /clock too, in ROS domain "
                f"{session.process.domain}: end the other simulator or bag player"
            )

    def _check_pose(self, pose: Pose2 | None) -> None:
        """Warn if the stack has no pose, or one far from the start."""
        settings = self._settings
        frames = settings.frames
        if pose is None:
            text = f"no transform {frames.map} -> {frames.base} was seen: no estimate is recorded"
            self.events.append(SutEvent(text, "warn"))
        elif settings.initial_pose == "published":
            off = self._briefing.start.inverse() @ pose
            if max(abs(off.x), abs(off.y), abs(off.yaw)) > _FAR:
                text = f"the stack believes to be {off.x:.2f} m, {off.y:.2f} m off the start"
                self.events.append(SutEvent(text, "warn"))

    def _tick(self, *, wait: float) -> None:
        """Advance the clock by a period, with the first measurements at the present time."""
        session = self.ready_session()
        period = round(self._settings.period * _NANO)
        now = session.time + period if session.time else _FIRST_CLOCK
        settings, first = self._settings, self._first
        messages = [] if self._latched else list(fixed_messages(settings, self._briefing, now))
        self._latched = True
        for sample in first.odometry[-1:]:
            session.telemetry.move(sample)
        latest = {scan.laser: scan for scan in first.scans}
        messages += measured_messages(
            settings,
            self._briefing.robot.lasers,
            first.odometry[-1:],
            tuple(latest.values()),
            lambda _: now,
        )
        self._cycle(Cycle(now, tuple(messages), "nothing", wait))

    def _cycle(self, cycle: Cycle) -> None:
        """Run one cycle and read its answer; the link keeps no messages."""
        session = self.ready_session()
        answer = session.cycle(cycle)
        news = session.telemetry.read(
            answer.messages, 0.0, self._first.odometry[-1], answer.dropped
        )
        self.events += news.events
        for report in news.reports:
            session.reports[type(report), getattr(report, "scope", "")] = report

    def _align(self) -> None:
        """Advance the clock quickly to a round number."""
        session = self.ready_session()
        period = round(self._settings.period * _NANO)
        session.zero = -(-(session.time + period) // _ROUND) * _ROUND
        while session.time + period < session.zero:
            self._tick(wait=_ALIGNING_PAUSE)

    def _send_pose(self) -> None:
        session = self.ready_session()
        message = sensors.initial_pose(self._briefing.start, session.time, self._settings.frames)
        self._cycle(Cycle(session.time + 1, ((self._settings.topics.initial_pose, message),)))

    def _check_alive(self, missing: str) -> None:
        """Raise :class:`SutFailure` if the stack has failed or is late."""
        session, limit = self.ready_session(), self._settings.start_up
        self.events += session.watch()
        if session.fault or session.is_aborted:
            raise session.start_failure(session.fault or "Nav2 gave up bringing its nodes up")
        if self._seconds() > limit:
            cause = find_cause(session.process.lines(), self._settings.files)
            raise session.failure(
                f"the stack was not ready within {limit:g} s of wall clock (start-up): {missing}"
                f"{f'; {cause}' if cause else ''}"
            )

    def _seconds(self) -> float:
        """Return the time since the start [s of wall clock]."""
        return wall_clock.monotonic() - self._began

    def _waited(self) -> str:
        return f"{self._seconds():.0f} s"

    def _write_map(self, process: StackProcess) -> Path:
        height = self._briefing.robot.laser.z
        _, meta = write_map(self._briefing.map, process.folder / "map", laser_height=height)
        return meta
