"""A live world for a ROS 2 stack that somebody starts by hand: topics out, commands in.

Over a :class:`~daemon.stacks.ros2.link.StackLink`, as in a run, but nothing is waited for: the
world goes on by its own clock, and what the stack commands is carried out when it comes. Sensor
data, transforms and the map are as a robot publishes them; map -> odom is the stack's to say.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

from daemon.live.simulation import LiveSimulation
from daemon.model.sut import Briefing, Observation
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.link import Cycle, LinkLost, LinkSetup, Qos, StackLink, TopicSetup

SOURCE: Final = "ROS 2"
"""Whose commands these are."""

_SECOND: Final = 1_000_000_000
_KEPT: Final = 250
"""Observations kept for a relay that is slow, five seconds of them; older ones are dropped."""
_LOOK: Final = 0.1
"""Seconds after which it looks whether it has to end."""
_ENDING: Final = 2.0
"""How long the end of a conversation is waited for [s]; a relay that was stopped answers never."""


@dataclass(frozen=True, slots=True)
class StackTopics:
    """Absolute names of topics, names of frames and what is published besides sensor data."""

    scan: str = "/scan"
    odom: str = "/odom"
    command: str = "/cmd_vel"
    tf: str = "/tf"
    tf_static: str = "/tf_static"
    map: str = "/map"
    frames: sensors.FrameNames = field(default_factory=sensors.FrameNames)
    scan_qos: Qos = "best effort"
    odom_qos: Qos = "best effort"

    def setup(self) -> LinkSetup:
        """Return what a link has to make."""
        return LinkSetup(
            publish=(
                TopicSetup(self.tf, sensors.TRANSFORMS, depth=100),
                TopicSetup(self.odom, sensors.ODOMETRY, self.odom_qos, 5),
                TopicSetup(self.scan, sensors.SCAN, self.scan_qos, 5),
                TopicSetup(self.tf_static, sensors.TRANSFORMS, "latched", 1),
                TopicSetup(self.map, sensors.GRID, "latched", 1),
            ),
            subscribe=(),
            command=self.command,
            # No goal is ever sent, but a link has a client for one action.
            action="/navigate_to_pose",
            action_kind="navigate_to_pose",
            nodes=(),
        )


class ListeningLink(StackLink, Protocol):
    """A link that a stack connects to when it likes."""

    def accept(self, timeout: float = 0.1) -> bool:
        """Wait ``timeout`` [s] of wall clock; return whether the stack is there."""


@dataclass(frozen=True, slots=True)
class _Moment:
    """What was observed, of which world, and ROS time at the begin of that world [ns]."""

    observation: Observation
    briefing: Briefing
    base: int


class RosBridge:
    """Talks to one stack after the other until it is closed, in a thread of its own.

    ``listen`` makes a link that can be connected to; a stack that went may come again. Raises
    what it raises, :class:`~daemon.stacks.ros2.link.LinkLost`, when that is not possible at all.
    ROS time begins at 1 s and never goes back: where the world begins anew, it goes on.
    """

    def __init__(
        self,
        simulation: LiveSimulation,
        listen: Callable[[], ListeningLink],
        topics: StackTopics | None = None,
    ) -> None:
        self._simulation, self._listen = simulation, listen
        self._topics = topics or StackTopics()
        self._link = listen()
        self._moments: deque[_Moment] = deque(maxlen=_KEPT)
        self._new = threading.Event()
        self._ending = threading.Event()
        self._briefing: Briefing | None = None
        self._base = self._latest = 0
        self.connected = False
        self.state = "waits for the relay"
        self._thread = threading.Thread(target=self._run, name="ROS 2 bridge", daemon=True)
        simulation.add_listener(self)
        self._thread.start()

    def begin(self, briefing: Briefing) -> None:
        """Go on after the world before: tf2 and costmaps forget everything when time jumps back."""
        self._briefing = briefing
        self._base = self._latest = self._latest + _SECOND

    def observe(self, observation: Observation) -> None:
        """Keep what is new for the thread that talks."""
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

    def _talk(self) -> None:
        """Publish what comes, hand commands over."""
        link = self._link
        link.set_up(self._topics.setup())
        self._moments.clear()
        self.connected = True
        identity = link.identity
        self.state = " ".join(("connected", identity.distribution, identity.rmw)).rstrip()
        told = False
        while not self._ending.is_set():
            moments = self._take()
            if not moments:
                continue
            last = moments[-1]
            now = last.base + _nanoseconds(last.observation.time)
            sent = [message for moment in moments for message in self._measured(moment)]
            if not told:
                sent = [*self._fixed(last.briefing, now), *sent]
                told = True
            answer = link.cycle(Cycle(now, tuple(sent)))
            for message in answer.messages:
                if message.topic == self._topics.command:
                    self._command(message.data, message.kind)

    def _take(self) -> list[_Moment]:
        """Return all that is new, at the latest after a moment without anything."""
        self._new.wait(_LOOK)
        self._new.clear()
        return [self._moments.popleft() for _ in range(len(self._moments))]

    def _command(self, data: bytes, kind: str) -> None:
        try:
            self._simulation.command(sensors.read_command(data, kind)[0], SOURCE)
        except ValueError as error:
            self.state = f"connected; {self._topics.command}: {error}"

    def _fixed(self, briefing: Briefing, now: int) -> Sequence[tuple[str, bytes]]:
        frames = self._topics.frames
        return (
            (self._topics.tf_static, sensors.laser_transform(briefing.robot.laser, now, frames)),
            (self._topics.map, sensors.occupancy_grid(briefing.map, now, frames)),
        )

    def _measured(self, moment: _Moment) -> Sequence[tuple[str, bytes]]:
        """Return transforms, odometry and scans in the order a stack needs them in."""
        topics, laser, found = self._topics, moment.briefing.robot.laser, []
        for sample in moment.observation.odometry:
            at = moment.base + _nanoseconds(sample.time)
            found.append((topics.tf, sensors.odometry_transform(sample, at, topics.frames)))
            found.append((topics.odom, sensors.odometry(sample, at, topics.frames)))
        for sweep in moment.observation.scans:
            at = moment.base + _nanoseconds(sweep.time)
            found.append((topics.scan, sensors.scan(sweep, laser, at, topics.frames)))
        return found


def _nanoseconds(time: float) -> int:
    return int(time * 1e9 + 0.5)
