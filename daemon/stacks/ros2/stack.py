"""User's ROS 2 stack as a system under test: bring-up, lock step, end.

Every period of simulated time has one cycle. New transforms, odometry and scans go out, then the
clock, because a timer that fires on the clock must find its data. Then the cycle waits for the
answering command. ROS time begins near 0 with the stack and runs during bring-up: no stack comes up
without a clock, and Nav2's costmaps take a late one for a time-out. The run's time 0 is the next
multiple of five seconds.
"""

from __future__ import annotations

import time as wall_clock
from collections.abc import Iterator, Mapping
from typing import Final

from daemon.model.sut import Briefing, Decision, Observation, SutEvent, SutFailure
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.bring_up import BringUp, StackSession
from daemon.stacks.ros2.endpoints import measured_messages
from daemon.stacks.ros2.inspection import WALL_CLOCK_CONTROLLERS
from daemon.stacks.ros2.link import Cycle, CycleAnswer, LinkLost
from daemon.stacks.ros2.lockstep import LockStep
from daemon.stacks.ros2.mission import GoalSequence
from daemon.stacks.ros2.settings import Ros2Settings
from grammars.model.geometry import Twist2

_NANO: Final = 1_000_000_000
_PATIENCE: Final = {"": 1.0, "not answering": 8.0}
"""Time for a node of these states to come back [s of wall clock]. Discovery may lose and find
nodes, and with eight times more work than cores live nodes were silent for five seconds. The end of
a process is noticed independently."""
_LOST: Final = {"": "left the graph", "not answering": "did not answer any more"}
_FAILED: Final = ("aborted", "canceled", "rejected", "unanswered")
_NEWS: Final = 3.0
_NEWS_OF_LAUNCH: Final = 0.3
"""Longest time from the end of a goal to the news of the death that caused it [s of wall clock]:
until nodes are known to be silent, or until launch has reported the death."""
_POLL: Final = 0.05
_SERVER_GONE: Final = 3.0
"""Longest absence of the action server [s of wall clock]; discovery may lose and find it."""


class Ros2Stack:
    """ROS 2 stack as a :class:`daemon.model.sut.ExternalSystem`."""

    needs_ground_truth = False

    def __init__(self, settings: Ros2Settings) -> None:
        self._settings = settings
        self._briefing: Briefing | None = None
        self._session: StackSession | None = None
        self._drive: _StackDrive | None = None
        self._outputs: Mapping[str, bytes] = {}

    @property
    def period(self) -> float:
        """Seconds of simulated time between two cycles."""
        return self._settings.period

    def start(self, briefing: Briefing) -> None:
        """Take the briefing; :meth:`bring_up` starts processes, with messages."""
        self._briefing = briefing

    def bring_up(self, first: Observation) -> Iterator[str]:
        """Start the stack and wait until it is ready; see the module for its clock."""
        assert self._briefing is not None
        attempt = BringUp(self._settings, self._briefing, first)
        try:
            yield from attempt.run()
        except SutFailure as error:
            raise SutFailure(error.reason, printed=error.printed, events=attempt.events) from error
        finally:
            # A stack that did not come up must also be ended, and its output kept.
            self._session, self._outputs = attempt.session, attempt.outputs
        self._drive = _StackDrive(attempt.ready_session(), self._briefing, first, attempt.events)

    def update(self, observation: Observation) -> Decision:
        """Run one cycle; raises :class:`SutFailure` if the test cannot continue."""
        assert self._drive is not None
        return self._drive.update(observation)

    def finish(self) -> None:
        """Raise :class:`SutFailure` if too many answers were late."""
        assert self._drive is not None
        self._drive.finish()

    def close(self) -> None:
        """End the stack."""
        if self._session is not None:
            self._outputs = {**self._outputs, **self._session.close()}

    def outputs(self) -> Mapping[str, bytes]:
        """Return the output of the stack and of the relay."""
        return self._outputs


class _StackDrive:
    """Cycles of a ready stack and its mission."""

    def __init__(
        self, session: StackSession, briefing: Briefing, first: Observation, events: list[SutEvent]
    ) -> None:
        self._session, self._lasers = session, briefing.robot.lasers
        self._settings = settings = session.settings
        self._mission = GoalSequence(
            briefing.mission, settings.mission, session.link, settings.frames.map
        )
        real_time = session.link.identity.distribution in WALL_CLOCK_CONTROLLERS
        self._lockstep = LockStep(settings, real_time=real_time)
        self._odometry = first.odometry[-1]
        self._server_missing: float | None = None
        self._missing: dict[str, float] = {}
        """Begin of the absence or silence of nodes [s of wall clock]."""
        self._events = list(events)

    def update(self, observation: Observation) -> Decision:
        """Run one cycle; raises :class:`SutFailure` with the stack's output."""
        session = self._session
        try:
            return self._cycle(observation)
        except LinkLost as error:
            why = f"{session.explain(error)} at {observation.time:.1f} s"
            raise session.failure(why, self._events) from error
        except SutFailure as error:
            raise session.failure(error.reason, self._events) from error

    def finish(self) -> None:
        """Raise :class:`SutFailure` if a node is missing or too many answers were late."""
        session = self._session
        try:
            if self._missing and self._mission.progress.state != "succeeded":
                # A loaded machine answers late, which alone is not an error of the run.
                self._await_nodes((session.time - session.zero) / _NANO)
            self._lockstep.check_share()
        except LinkLost as error:
            raise session.failure(session.explain(error)) from error
        except SutFailure as error:
            raise session.failure(error.reason) from error

    def _cycle(self, observation: Observation) -> Decision:
        session, mission, lockstep = self._session, self._mission, self._lockstep
        time = self._ros_time(observation.time)
        if observation.odometry:
            self._odometry = observation.odometry[-1]
            session.telemetry.move(self._odometry)
        mission.send_next(time)
        active = mission.active
        # Only new measurements, each with its own stamp.
        outgoing = measured_messages(
            self._settings,
            self._lasers,
            observation.odometry,
            observation.scans,
            self._ros_time,
        )
        wait, tolerance = lockstep.wait(active=active), round(lockstep.tolerance * _NANO)
        answer = session.cycle(Cycle(time, tuple(outgoing), "command", wait, tolerance))
        # First, because the last messages of a stack explain its end.
        news = session.telemetry.read(
            answer.messages, observation.time, self._odometry, answer.dropped
        )
        self._events += news.events
        news.reports[:0] = session.reports.values()
        session.reports.clear()
        # After the wait, which reveals a crash; it explains more than its consequences.
        self._check_stack(answer.inactive, observation.time)
        command, behind = _newest_command(answer, self._settings.topics.command, time)
        for line in news.log:
            mission.hear_log(line)
        for update in answer.goals:
            if update.state in _FAILED:
                self._await_news(observation.time)
            self._events += mission.take(update)
        # A goal that ended in this cycle needs no command any more.
        latency, events = lockstep.take(answer, behind, active=active and mission.active)
        self._events += events
        self._watch_server(answer)
        events, self._events = self._events, []
        return news.decision(mission.progress, command, latency=latency, events=events)

    def _ros_time(self, time: float) -> int:
        """Return ROS time [ns] of simulated time [s]."""
        return self._session.zero + round(time * _NANO)

    def _check_stack(self, inactive: Mapping[str, str], time: float) -> None:
        """Raise :class:`SutFailure` for a dead process or an inactive node."""
        session, now = self._session, wall_clock.monotonic()
        self._events += session.watch()
        if session.fault:
            raise SutFailure(f"{session.fault} at {time:.1f} s")
        self._missing = {node: self._missing.get(node, now) for node in inactive}
        # Absent and silent nodes come first: other states may be their consequence.
        for node, state in sorted(inactive.items(), key=lambda item: item[1] not in _LOST):
            if now - self._missing[node] >= _PATIENCE.get(state, 0.0):
                what = _LOST.get(state, f"became {state}")
                raise SutFailure(f"{node.lstrip('/')} {what} at {time:.1f} s")

    def _await_news(self, time: float) -> None:
        """Raise :class:`SutFailure` if a node has died, which explains a failed goal."""
        link, ready = self._session.link, self._settings.ready
        # A node that answers is alive; every node has this parameter.
        all_answer = all(link.parameters(node, ("use_sim_time",)) for node in ready)
        self._await_nodes(time, _NEWS_OF_LAUNCH if all_answer else _NEWS)

    def _await_nodes(self, time: float, least: float = 0.0) -> None:
        """Wait until every node is active, at least ``least`` [s of wall clock].

        Raises :class:`SutFailure` if one does not become active again.
        """
        until = wall_clock.monotonic() + least
        while True:
            states = self._session.link.readiness().nodes
            inactive = {node: state for node, state in states.items() if state != "active"}
            self._check_stack(inactive, time)
            if wall_clock.monotonic() >= until and not inactive:
                return
            wall_clock.sleep(_POLL)

    def _watch_server(self, answer: CycleAnswer) -> None:
        if answer.server or not self._mission.active:
            self._server_missing = None
            return
        now = wall_clock.monotonic()
        self._server_missing = self._server_missing or now
        if now - self._server_missing > _SERVER_GONE:
            raise SutFailure(f"the action server {self._settings.action} is gone")


def _newest_command(
    answer: CycleAnswer, topic: str, time: int
) -> tuple[Twist2 | None, float | None]:
    """Return the last command of a cycle, and the lag of its stamp [s]."""
    for message in reversed(answer.messages):
        if message.topic == topic:
            try:
                twist, stamp = sensors.read_command(message.data, message.kind)
            except ValueError as error:
                raise SutFailure(str(error)) from error
            return twist, None if stamp is None else (time - stamp) / _NANO
    return None, None
