"""From the command that starts a stack to a stack that is ready for a mission.

Started; in sight of the relay; told where the robot stands; every lifecycle node active; and the
clock at a round number.
"""

from __future__ import annotations

import time as wall_clock
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from daemon.model.sut import Briefing, Observation, SutEvent, SutFailure
from daemon.stacks.ros2 import placeholders, sensors
from daemon.stacks.ros2.endpoints import fixed_messages, link_setup, measured_messages, scan_topics
from daemon.stacks.ros2.isolation import DomainTaken
from daemon.stacks.ros2.link import (
    Cycle,
    CycleAnswer,
    LinkLost,
    Readiness,
    StackLink,
)
from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.relay_link import RelayLink, relay_path
from daemon.stacks.ros2.settings import Ros2Settings
from daemon.stacks.ros2.telemetry import Telemetry
from grammars.model.geometry import Pose2
from grammars.model.map_files import write_map

_NANO: Final = 1_000_000_000
_FIRST_CLOCK: Final = _NANO
"""ROS time of the first clock: bring-up that began at 1 s came up, at 100 s it failed once, and 0
means "no clock yet" to ROS."""
_ROUND: Final = 5 * _NANO
"""The run begins at a multiple of this, so that what a stack computes of its clock is mostly the
same from run to run, however long it took to come up."""
_ALIGNING_PAUSE: Final = 0.005
_ASK_PERIOD: Final = 0.25
_POSE_PERIOD: Final = 3.0
"""The initial pose is told again after so long [s of wall clock] until the stack has a pose."""
_POSE_PATIENCE: Final = 5.0
"""A stack that is ready otherwise is given so long [s of wall clock] to say where it is."""
_FAR: Final = 0.5
"""A stack that believes to be farther from the start [m, rad] was told in vain."""
_NOT_UP: Final = "the stack did not come up"
_LAST_LINES: Final = 20


class StackSession:
    """A stack that runs, and what is connected to it; ``zero`` is the ROS time of time 0 [ns]."""

    def __init__(self, settings: Ros2Settings, process: StackProcess, link: StackLink) -> None:
        self.settings, self.process, self.link = settings, process, link
        self.telemetry = Telemetry(settings.topics, settings.frames)
        self.zero = self.time = 0

    def cycle(self, cycle: Cycle) -> CycleAnswer:
        """Do one cycle; the clock never goes back."""
        self.time = cycle.time
        return self.link.cycle(cycle)

    def explain(self, lost: str) -> str:
        """Return why the link was lost: an end of a process says more than its silence."""
        until = wall_clock.monotonic() + 2.0
        ended = self.process.ended()
        while not ended and wall_clock.monotonic() < until:
            wall_clock.sleep(0.05)
            ended = self.process.ended()
        return ended or lost

    def failure(self, reason: str, events: Sequence[SutEvent] = ()) -> SutFailure:
        """Return a failure of the stack with the last lines it printed."""
        return SutFailure(reason, printed=self.process.last_lines(_LAST_LINES), events=events)

    def close(self) -> Mapping[str, bytes]:
        """End the stack; return what it printed."""
        self.link.close()
        self.process.release()
        return self.process.outputs()


class BringUp:
    """One attempt to get a stack ready; ``session`` is there as soon as something is connected."""

    def __init__(self, settings: Ros2Settings, briefing: Briefing, first: Observation) -> None:
        self._settings, self._briefing = settings, briefing
        self._first = first
        self._latched = False
        self._began = 0.0
        self.session: StackSession | None = None
        self.events: list[SutEvent] = []

    def run(self) -> Iterator[str]:
        """Yield what is being waited for; raises :class:`SutFailure` when it does not come up."""
        began = wall_clock.monotonic()
        try:
            yield from self._connect()
            yield from self._wait_until_ready()
            self._align()
        except LinkLost as error:
            session = self.ready_session()
            why = session.explain(str(error))
            raise session.failure(f"{_NOT_UP}: {why}") from error
        identity = self.ready_session().link.identity
        self.events.append(
            SutEvent(
                f"ready after {wall_clock.monotonic() - began:.1f} s of wall clock; ROS 2 "
                f"{identity.distribution or 'of unknown distribution'}, {identity.rmw}; "
                f"time 0 is ROS time {self.ready_session().zero / _NANO:g} s"
            )
        )

    def ready_session(self) -> StackSession:
        """Return the session; only after something was connected."""
        assert self.session is not None
        return self.session

    def _connect(self) -> Iterator[str]:
        """Start the stack and wait for a link to it."""
        settings = self._settings
        self._began = wall_clock.monotonic()
        yield "starting the stack"
        values = self._values()
        process = StackProcess(settings, values=values, relay=relay_path())
        # Where the map lies is known with the folder; the values are used when it is started.
        values[placeholders.MAP] = str(self._write_map(process))
        try:
            link = RelayLink.listen(process.socket, process.nonce)
        except LinkLost as error:
            process.release()
            raise SutFailure(str(error)) from error
        self.session = StackSession(settings, process, link)
        yield from self._start(process)
        while not link.accept(timeout=0.1):
            self._check_alive(process, "its relay has not come")
            yield f"waiting for the relay in the stack's ROS 2, {self._waited()}"
        link.set_up(link_setup(settings, self._briefing.robot.lasers))

    def _start(self, process: StackProcess) -> Iterator[str]:
        """Start the processes; a domain that is another run's at the moment is waited for."""
        while True:
            try:
                process.start()
            except DomainTaken as error:
                if wall_clock.monotonic() - self._began > self._settings.start_up:
                    raise
                yield str(error)
                wall_clock.sleep(_ASK_PERIOD)
            else:
                return

    def _wait_until_ready(self) -> Iterator[str]:
        session, settings = self.ready_session(), self._settings
        ask = tell = 0.0
        complete_since: float | None = None
        readiness: Readiness | None = None
        while True:
            self._tick(wait=settings.period)
            now = wall_clock.monotonic()
            if now >= ask:
                ask, readiness = now + _ASK_PERIOD, session.link.readiness()
            assert readiness is not None
            pose = session.telemetry.pose()
            heard = readiness.listeners.get(settings.topics.initial_pose, 0) > 0
            if settings.initial_pose == "published" and heard and pose is None and now >= tell:
                self._tell_pose()
                tell = now + _POSE_PERIOD
            missing = self._missing(readiness)
            if not missing:
                complete_since = complete_since or now
                if pose is not None or now - complete_since > _POSE_PATIENCE:
                    break
                missing = f"no transform {settings.frames.map} -> {settings.frames.base} yet"
            else:
                complete_since = None
            self._check_alive(session.process, missing)
            yield f"{missing}, {self._waited()}"
        self._check_pose(session.telemetry.pose())
        self._check_alone()

    def _missing(self, readiness: Readiness) -> str:
        """Return what a stack still lacks, empty when nothing."""
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
            return f"nobody listens to {' or '.join(scans)}"
        return ""

    def _check_alone(self) -> None:
        """Raise :class:`SutFailure` when somebody else has a clock in this stack's domain.

        Domains are exclusive among runs, but nobody keeps other programs out of them.
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
                f"{session.process.domain}: another simulator, or a bag that is played"
            )

    def _check_pose(self, pose: Pose2 | None) -> None:
        """Warn when the stack does not know, or not rightly, where it was told to be."""
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
        """Let the clock go on by a period, with the first measurements as if they were of now."""
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
        """Do one cycle and hear its answer: the link forgets what it has handed over."""
        session = self.ready_session()
        answer = session.cycle(cycle)
        heard = session.telemetry.read(
            answer.messages, 0.0, self._first.odometry[-1], answer.dropped
        )
        self.events += heard.events

    def _align(self) -> None:
        """Let the clock go on to a round number, quickly."""
        session = self.ready_session()
        period = round(self._settings.period * _NANO)
        session.zero = -(-(session.time + period) // _ROUND) * _ROUND
        while session.time + period < session.zero:
            self._tick(wait=_ALIGNING_PAUSE)

    def _tell_pose(self) -> None:
        session = self.ready_session()
        message = sensors.initial_pose(self._briefing.start, session.time, self._settings.frames)
        self._cycle(Cycle(session.time + 1, ((self._settings.topics.initial_pose, message),)))

    def _check_alive(self, process: StackProcess, missing: str) -> None:
        ended = process.ended()
        if ended:
            raise self.ready_session().failure(f"{_NOT_UP}: {ended}")
        if wall_clock.monotonic() - self._began > self._settings.start_up:
            raise self.ready_session().failure(
                f"the stack was not ready within {self._settings.start_up:g} s of wall clock "
                f"(start-up): {missing}"
            )

    def _waited(self) -> str:
        return f"{wall_clock.monotonic() - self._began:.0f} s"

    def _values(self) -> dict[str, str]:
        """Return the values of placeholders that do not depend on the folder of the run."""
        briefing = self._briefing
        return placeholders.run_values(
            start=briefing.start,
            robot=briefing.robot.name,
            namespace=self._settings.namespace,
            seed=int(briefing.seed.generate_state(1)[0]),
            files=self._settings.files,
        )

    def _write_map(self, process: StackProcess) -> Path:
        height = self._briefing.robot.laser.z
        _, meta = write_map(self._briefing.map, process.folder / "map", laser_height=height)
        return meta
