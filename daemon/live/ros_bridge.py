"""A live world for a ROS 2 stack that is started by hand: topics out, commands in.

Uses a :class:`~daemon.stacks.ros2.link.RelayLink`, as a run does, but without lock step: the
world goes by its own clock, and commands of the stack are carried out on arrival. Sensor data,
transforms and the map are as a robot publishes them; the stack publishes map -> odom.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from daemon.live.simulation import LiveSimulation
from daemon.model.sut import Briefing, Decision, Observation, Odometry, Progress
from daemon.stacks.ros2 import sensors, telemetry
from daemon.stacks.ros2.endpoints import fixed_messages, link_setup, measured_messages
from daemon.stacks.ros2.link import Cycle, CycleAnswer, LinkLost, LinkSetup, RelayLink
from daemon.stacks.ros2.settings import Ros2Settings, read_settings
from daemon.stacks.ros2.telemetry import Telemetry
from grammars.model.robot import Laser

SOURCE: Final = "ROS 2"
"""Source of these commands."""

_SECOND: Final = 1_000_000_000
_KEPT: Final = 250
"""Observations kept for a slow relay, five seconds of them; older ones are dropped."""
_POSE_PERIOD: Final = 3.0
"""Period of initial poses until the stack has an estimate [s, wall clock]."""
_LOOK: Final = 0.1
"""Period of looks whether to end [s]."""
_ENDING: Final = 2.0
"""Longest wait for the end of a conversation [s]; a stopped relay never answers."""


def usual_settings() -> Ros2Settings:
    """Return the settings of a stack without a SUT file: the usual names."""
    # A SUT file must only have the start command, which is typed by hand here.
    return read_settings({"launch": "by hand", "map": "published"})


def _bridge_setup(settings: Ros2Settings, lasers: Sequence[Laser]) -> LinkSetup:
    """Return the setup of a link; its action client stays unused, since no goal is sent."""
    setup = link_setup(settings, lasers)
    # A person who starts a stack by hand reads its log and waits for its nodes.
    topics = tuple(topic for topic in setup.subscribe if topic.name != telemetry.ROSOUT)
    return replace(setup, subscribe=topics, nodes=())


@dataclass(frozen=True, slots=True)
class _Moment:
    """An observation, its world, and ROS time at the start of that world [ns]."""

    observation: Observation
    briefing: Briefing
    base: int

    @property
    def now(self) -> int:
        """ROS time of the observation [ns]."""
        return self.base + _nanoseconds(self.observation.time)


class RosBridge:
    """Talks to one stack after the other until it is closed, in a thread of its own.

    ``listen`` makes a link that accepts connections; a stack may leave and come again. Raises the
    :class:`~daemon.stacks.ros2.link.LinkLost` of ``listen``. ROS time begins at 1 s and never goes
    back, also when the world begins anew.
    """

    def __init__(
        self,
        simulation: LiveSimulation,
        listen: Callable[[], RelayLink],
        settings: Ros2Settings | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._simulation, self._listen, self._clock = simulation, listen, clock
        self._settings = settings or usual_settings()
        self._link = listen()
        self._moments: deque[_Moment] = deque(maxlen=_KEPT)
        self._new = threading.Event()
        self._ending = threading.Event()
        self._briefing: Briefing | None = None
        self._base = self._latest = 0
        self.connected = False
        self.state = "waits for the relay"
        self.failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="ROS 2 bridge", daemon=True)
        simulation.add_listener(self)
        self._thread.start()

    def begin(self, briefing: Briefing) -> None:
        """Continue ROS time: tf2 and costmaps forget everything when time jumps back."""
        self._briefing = briefing
        self._base = self._latest = self._latest + _SECOND

    def observe(self, observation: Observation) -> None:
        """Keep an observation for the thread that talks."""
        self._latest = self._base + _nanoseconds(observation.time)
        if self.connected and self._briefing is not None:
            self._moments.append(_Moment(observation, self._briefing, self._base))
            self._new.set()

    def close(self) -> None:
        """End the conversation."""
        self._ending.set()
        self._thread.join(_ENDING)
        self._link.close()

    def _run(self) -> None:
        try:
            while not self._ending.is_set():
                try:
                    if self._link.accept(_LOOK):
                        self._talk()
                except LinkLost as error:
                    self.state = f"waits for the relay again: {error}"
                    self.connected = False
                    self._link.close()
                    self._link = self._listen()
        except LinkLost as error:
            self.state = f"cannot be reached any more: {error}"
        except Exception as error:
            # A thread cannot raise to anybody: the server of the world raises it at the end.
            self.failure = error
            self.state = f"has ended: {type(error).__name__}: {error}"
        self.connected = False

    def _talk(self) -> None:
        """Publish observations and forward commands."""
        link = self._link
        link.set_up(_bridge_setup(self._settings, self._simulation.spec.robot.lasers))
        talk = _TopicExchange(self._settings)
        self._moments.clear()
        self.connected = True
        identity = link.identity
        self.state = " ".join(("connected", identity.distribution, identity.rmw)).rstrip()
        while not self._ending.is_set():
            moments = self._take()
            if not moments:
                continue
            now = moments[-1].now
            answer = link.cycle(Cycle(now, talk.messages(moments, self._clock())))
            for message in answer.messages:
                if message.topic == self._settings.topics.command:
                    self._command(message.data, message.kind)
            self._simulation.report(talk.read(answer, moments[-1]))

    def _take(self) -> list[_Moment]:
        """Return all new observations, or none after :data:`_LOOK`."""
        self._new.wait(_LOOK)
        self._new.clear()
        return [self._moments.popleft() for _ in range(len(self._moments))]

    def _command(self, data: bytes, kind: str) -> None:
        try:
            self._simulation.command(sensors.read_command(data, kind)[0], SOURCE)
        except ValueError as error:
            self.state = f"connected; {self._settings.topics.command}: {error}"


class _TopicExchange:
    """Conversation with one stack, from its first cycle to its last."""

    def __init__(self, settings: Ros2Settings) -> None:
        self._settings = settings
        self._telemetry = Telemetry(settings)
        self._base = -1
        self._pose_due = 0.0
        self._odometry: Odometry | None = None

    def messages(self, moments: Sequence[_Moment], wall: float) -> tuple[tuple[str, bytes], ...]:
        """Return new messages in the order a stack needs; ``wall`` is the clock [s]."""
        last = moments[-1]
        messages: list[tuple[str, bytes]] = []
        if self._base < 0:
            messages += fixed_messages(self._settings, last.briefing, last.now)
        if last.base != self._base:
            # In a new world the robot is at its start again.
            self._base, self._pose_due = last.base, wall
            self._telemetry.forget()
        for moment in moments:
            messages += self._measured(moment)
        needs_pose = self._settings.initial_pose == "published" and self._telemetry.pose() is None
        if needs_pose and wall >= self._pose_due:
            self._pose_due = wall + _POSE_PERIOD
            # The true pose, as a person would give it.
            pose = last.observation.ground_truth or last.briefing.start
            data = sensors.initial_pose(pose, last.now, self._settings.frames)
            messages.append((self._settings.topics.initial_pose, data))
        return tuple(messages)

    def read(self, answer: CycleAnswer, moment: _Moment) -> Decision:
        """Return the stack's estimates, plans and events."""
        active = Progress(0, 0, "active")
        if self._odometry is None:
            return Decision(None, active)
        now = moment.observation.time
        news = self._telemetry.read(answer.messages, now, self._odometry, answer.dropped)
        return news.decision(active, events=news.events)

    def _measured(self, moment: _Moment) -> Iterator[tuple[str, bytes]]:
        observation = moment.observation
        for sample in observation.odometry:
            self._odometry = sample
            self._telemetry.move(sample)
        return measured_messages(
            self._settings,
            moment.briefing.robot.lasers,
            observation.odometry,
            observation.scans,
            lambda time: moment.base + _nanoseconds(time),
        )


def _nanoseconds(time: float) -> int:
    return int(time * 1e9 + 0.5)
