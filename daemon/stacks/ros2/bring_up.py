"""From the command that starts a stack to a stack that is ready for a mission.

Started, or taken over from the run before and reset; in sight of the relay; told where the robot
stands; every lifecycle node active; and the clock at a round number.
"""

from __future__ import annotations

import hashlib
import time as wall_clock
from collections.abc import Generator, Iterator, Mapping, Sequence
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
from grammars.text import codec

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
"""A reset stack that believes to be farther from the start [m, rad] was not reset."""
_NOT_UP: Final = "the stack did not come up"
_CLOCK_FILE: Final = "clock"
_LAST_LINES: Final = 20
_RESET_STEPS: Final = (("deactivate", "inactive"), ("cleanup", "unconfigured"))
_START_STEPS: Final = (("configure", "inactive"), ("activate", "active"))


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

    def close(self, *, keep: bool) -> Mapping[str, bytes]:
        """Let go of the stack, end it unless it is kept; return what it printed."""
        if keep:
            try:
                self.link.cancel_goals()
                (self.process.folder / _CLOCK_FILE).write_text(str(self.time), encoding="ascii")
            except (LinkLost, OSError):
                # Nothing to tell anybody: it is ended here and started anew by the next run.
                keep = False
        self.link.close()
        self.process.release(keep=keep)
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
            while not (yield from self._come_up()):
                yield from self._connect()
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
        """Start the stack, or find the one that was left, and wait for a link to it."""
        settings = self._settings
        self._began = wall_clock.monotonic()
        yield "starting the stack"
        values = self._values()
        process = StackProcess(settings, values=values, key=self._key(), relay=relay_path())
        # Where the map lies is known with the folder; the values are used when it is started.
        values[placeholders.MAP] = str(self._write_map(process))
        try:
            link = RelayLink.listen(process.socket, process.nonce)
        except LinkLost as error:
            process.release(keep=False)
            raise SutFailure(str(error)) from error
        self.session = StackSession(settings, process, link)
        yield from self._start(process)
        while not link.accept(timeout=0.1):
            self._check_alive(process, "its relay has not come")
            yield f"waiting for the relay in the stack's ROS 2, {self._waited()}"
        link.set_up(link_setup(settings, self._briefing.robot.lasers))
        self._latched = False

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

    def _come_up(self) -> Generator[str, None, bool]:
        """Wait until the stack is ready; return whether it is, or another one has to be started.

        Only a stack of the run before may be given up like this: when its reset does not come out
        as it should, which is seen by its nodes and by where it believes to be.
        """
        session = self.ready_session()
        if not session.process.reused:
            yield from self._wait_until_ready()
            return True
        try:
            yield from self._reset()
            yield from self._wait_until_ready()
            off = self._off_the_start(session.telemetry.pose())
            if off:
                raise SutFailure(off)
        except (SutFailure, LinkLost, OSError, ValueError) as error:
            first = error.reason if isinstance(error, SutFailure) else str(error)
            self.events.append(SutEvent(f"the stack could not be used again: {first}", "warn"))
            session.close(keep=False)
            return False
        return True

    def _reset(self) -> Iterator[str]:
        """Take every lifecycle node down and up again, in order, and forget where it was."""
        session = self.ready_session()
        clock = (session.process.folder / _CLOCK_FILE).read_text(encoding="ascii")
        session.time = int(clock)
        nodes = self._settings.ready
        for steps, order in ((_RESET_STEPS, nodes[::-1]), (_START_STEPS, nodes)):
            for transition, state in steps:
                for node in order:
                    yield from self._change_state(node, transition, state)
        session.telemetry.forget()
        self.events.append(SutEvent("the stack of the run before was reset and is used again"))

    def _change_state(self, node: str, transition: str, state: str) -> Iterator[str]:
        session = self.ready_session()
        session.link.request_state(node, transition)
        while session.link.readiness().nodes.get(node) != state:
            self._tick(wait=self._settings.period)
            self._check_alive(session.process, f"{node} does not {transition}")
            yield f"resetting the stack: {transition} {node}"

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
        """Say when the stack does not know, or not rightly, where it was told to be."""
        frames = self._settings.frames
        text = self._off_the_start(pose)
        if pose is None:
            text = f"no transform {frames.map} -> {frames.base} was seen: no estimate is recorded"
        if text:
            self.events.append(SutEvent(text, "warn"))

    def _off_the_start(self, pose: Pose2 | None) -> str:
        """Return how far off the start the stack believes to be, empty when it is not."""
        if pose is None or self._settings.initial_pose != "published":
            return ""
        off = self._briefing.start.inverse() @ pose
        if max(abs(off.x), abs(off.y), abs(off.yaw)) <= _FAR:
            return ""
        return f"the stack believes to be {off.x:.2f} m, {off.y:.2f} m off the start"

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

    def _key(self) -> str:
        """Return what must be equal for a stack to be used again by another run."""
        briefing, grid = self._briefing, self._briefing.map
        drawn = hashlib.sha256(grid.cells.tobytes()).hexdigest()
        place = (grid.resolution, grid.x, grid.y, grid.cells.shape)
        parts = (codec.to_json(self._settings), codec.to_json(briefing.robot), repr(place), drawn)
        return hashlib.sha256(repr(parts).encode()).hexdigest()

    def _write_map(self, process: StackProcess) -> Path:
        height = self._briefing.robot.laser.z
        _, meta = write_map(self._briefing.map, process.folder / "map", laser_height=height)
        return meta
