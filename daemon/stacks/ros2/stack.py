"""A user's own ROS 2 stack as a system under test: brought up, kept in lock step, ended.

One cycle, every period of simulated time: transforms, odometry and scans that are new go out, the
clock last, because a timer that fires on the clock must find its data; then the command that
answers is awaited. ROS time begins near 0 when the stack is started and runs on while it comes up,
because nothing comes up without a clock, and Nav2's costmaps take one that begins late for a
time-out; the run's time 0 is the next multiple of five seconds after that.
"""

from __future__ import annotations

import time as wall_clock
from collections.abc import Iterator, Mapping
from typing import Final

from daemon.model.sut import (
    Briefing,
    Decision,
    Observation,
    Odometry,
    SutEvent,
    SutFailure,
)
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.bring_up import BringUp, StackSession
from daemon.stacks.ros2.endpoints import measured_messages
from daemon.stacks.ros2.link import Cycle, CycleAnswer, LinkLost
from daemon.stacks.ros2.lockstep import HeardAnswer, LockStep, LockStepSettings
from daemon.stacks.ros2.mission import GoalSequence
from daemon.stacks.ros2.pace import WALL_CLOCK_CONTROLLERS
from daemon.stacks.ros2.settings import Ros2Settings
from grammars.model.geometry import Twist2

_NANO: Final = 1_000_000_000
_SERVER_GONE: Final = 3.0
"""The action server may be out of sight for so long [s of wall clock]: discovery forgets and finds
again."""


class Ros2Stack:
    """Fulfils :class:`daemon.model.sut.ExternalSystem`."""

    needs_ground_truth = False

    def __init__(self, settings: Ros2Settings) -> None:
        self._settings = settings
        self._session: StackSession | None = None
        self._outputs: Mapping[str, bytes] = {}
        self._mission: GoalSequence | None = None
        self._lockstep: LockStep | None = None
        self._briefing: Briefing | None = None
        self._zero = 0
        self._odometry: Odometry | None = None
        self._server_missing: float | None = None
        self._said: list[SutEvent] = []

    @property
    def period(self) -> float:
        """Seconds of simulated time between two cycles."""
        return self._settings.period

    def start(self, briefing: Briefing) -> None:
        """Take the briefing; processes are started by :meth:`bring_up`, which can say so."""
        self._briefing = briefing

    def bring_up(self, first: Observation) -> Iterator[str]:
        """Start the stack, wait until it is ready; see the module for its clock."""
        assert self._briefing is not None
        attempt = BringUp(self._settings, self._briefing, first)
        try:
            yield from attempt.run()
        except SutFailure as error:
            raise SutFailure(error.reason, printed=error.printed, events=attempt.events) from error
        finally:
            # Also of a stack that did not come up: it has to be ended, and what it printed kept.
            self._session = attempt.session
        session = attempt.ready_session()
        self._zero, self._said = session.zero, list(attempt.events)
        settings = self._settings
        mode = settings.mission
        self._mission = GoalSequence(
            self._briefing.mission, mode, session.link, settings.frames.map
        )
        distribution = session.link.identity.distribution
        self._lockstep = LockStep(
            LockStepSettings(
                period=settings.period,
                patience=settings.patience,
                idle=settings.idle,
                late=settings.late,
                tolerance=settings.tolerance,
                real_time=distribution in WALL_CLOCK_CONTROLLERS,
            )
        )

    def update(self, observation: Observation) -> Decision:
        """Do one cycle; raises :class:`SutFailure` when the stack cannot be tested any further."""
        assert self._session is not None
        assert self._mission is not None
        assert self._lockstep is not None
        try:
            return self._cycle(observation, self._session, self._mission, self._lockstep)
        except LinkLost as error:
            raise self._session.failure(self._session.explain(str(error)), self._said) from error
        except SutFailure as error:
            raise self._session.failure(error.reason, self._said) from error

    def _cycle(
        self,
        observation: Observation,
        session: StackSession,
        mission: GoalSequence,
        lockstep: LockStep,
    ) -> Decision:
        time = self._zero + round(observation.time * _NANO)
        if observation.odometry:
            self._odometry = observation.odometry[-1]
            session.telemetry.move(self._odometry)
        assert self._odometry is not None  # the robot's first sample is of time 0
        mission.send_next(time)
        active = mission.active
        answer = session.cycle(
            Cycle(
                time,
                tuple(self._outgoing(observation)),
                "command",
                lockstep.wait(active=active),
                round(lockstep.tolerance * _NANO),
            )
        )
        # First of all: what a stack says last explains why it ended.
        heard = session.telemetry.read(
            answer.messages, observation.time, self._odometry, answer.dropped
        )
        self._said += heard.events
        # After the wait, in which a crash shows: it says more than what is missing because of it.
        ended = session.process.ended()
        if ended:
            raise SutFailure(ended)
        command, behind = _newest_command(answer, self._settings.topics.command, time)
        for line in heard.log:
            mission.hear_log(line)
        for update in answer.goals:
            self._said += mission.take(update)
        # A goal that ended in this cycle is owed no command any more.
        latency, events = lockstep.take(
            HeardAnswer(answer.latency, behind, answer.commands, answer.heard),
            active=active and mission.active,
        )
        self._said += events
        self._watch_server(answer, mission)
        said, self._said = self._said, []
        return heard.decision(mission.progress, command, latency=latency, events=said)

    def _outgoing(self, observation: Observation) -> Iterator[tuple[str, bytes]]:
        """Yield what is new: transforms, odometry, scans, each with its own stamp."""
        assert self._briefing is not None
        return measured_messages(
            self._settings,
            self._briefing.robot.lasers,
            observation.odometry,
            observation.scans,
            lambda time: self._zero + round(time * _NANO),
        )

    def _watch_server(self, answer: CycleAnswer, mission: GoalSequence) -> None:
        if answer.server or not mission.active:
            self._server_missing = None
            return
        now = wall_clock.monotonic()
        self._server_missing = self._server_missing or now
        if now - self._server_missing > _SERVER_GONE:
            raise SutFailure(f"the action server {self._settings.action} is gone")

    def finish(self) -> None:
        """Raise :class:`SutFailure` when too many answers were late."""
        if self._lockstep is not None and self._session is not None:
            try:
                self._lockstep.check_share()
            except SutFailure as error:
                raise self._session.failure(error.reason) from error

    def close(self) -> None:
        """End the stack."""
        if self._session is not None:
            self._outputs = self._session.close()

    def outputs(self) -> Mapping[str, bytes]:
        """Return what the stack and the relay printed."""
        return self._outputs


def _newest_command(
    answer: CycleAnswer, topic: str, time: int
) -> tuple[Twist2 | None, float | None]:
    """Return the last command of a cycle, and how far its stamp lies before the clock [s]."""
    for message in reversed(answer.messages):
        if message.topic == topic:
            try:
                twist, stamp = sensors.read_command(message.data, message.kind)
            except ValueError as error:
                raise SutFailure(str(error)) from error
            return twist, None if stamp is None else (time - stamp) / _NANO
    return None, None
