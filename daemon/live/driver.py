"""Driver of the robot of a live world: commands from outside, otherwise a system under test."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, Protocol

from daemon.model.sut import (
    TICK_RATE,
    Briefing,
    Decision,
    LaserScan,
    Observation,
    Odometry,
    Progress,
    SystemUnderTest,
)
from grammars.model.geometry import Twist2

PERIOD: Final = 2
"""Ticks between two reads of commands: 0.02 s, the usual period of laser drivers and controllers
of real robots."""
TAKE_OVER: Final = 1.0
"""Time for which a command from outside overrides the system under test [s, simulated]: a person
with a stick can take over, and the system goes on afterwards."""

_NOWHERE: Final = Progress(0, 0, "active")
_SHOWN: Final = ("estimate", "cloud", "plan", "local_plan", "particles")
_MOST_REPORTS: Final = 1000
"""Reports that wait while the world is paused; older ones are dropped."""


class RobotListener(Protocol):
    """Receiver of a robot's data; the thread of the simulation calls both methods."""

    def begin(self, briefing: Briefing) -> None:
        """Begin a world, at time 0."""

    def observe(self, observation: Observation) -> None:
        """Take new data and the true pose, every :data:`PERIOD` ticks or more often."""


class LiveDriver:
    """A system under test made of commands from outside and an optional inner system.

    Commands and reports of a stack outside come from any thread. ``on_command`` is called with the
    source of each command that is carried out.
    """

    def __init__(
        self,
        inner: SystemUnderTest | None = None,
        listeners: Sequence[RobotListener] = (),
        on_command: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._inner, self._listeners, self._on_command = inner, listeners, on_command
        self._commands: deque[tuple[Twist2, str]] = deque(maxlen=1)
        self._reports: deque[Decision] = deque(maxlen=_MOST_REPORTS)
        self._every = round(inner.period * TICK_RATE) if inner else PERIOD
        self._ticks = math.gcd(PERIOD, self._every)
        self._due = 0
        self._held_until = -1.0
        self._progress = _NOWHERE
        self._odometry: list[Odometry] = []
        self._scans: list[LaserScan] = []

    @property
    def period(self) -> float:
        """Seconds of simulated time between two updates."""
        return self._ticks / TICK_RATE

    @property
    def needs_ground_truth(self) -> bool:
        """True if the inner system does, or a listener needs the true pose."""
        return bool(self._listeners) or self._inner_needs_truth

    @property
    def _inner_needs_truth(self) -> bool:
        return self._inner is not None and self._inner.needs_ground_truth

    def command(self, twist: Twist2, source: str) -> None:
        """Store a command in the body frame; raises ``ValueError`` if it is not finite."""
        if not all(map(math.isfinite, (twist.vx, twist.vy, twist.wz))):
            raise ValueError(f"a velocity command must be finite, not {twist}")
        self._commands.append((twist, source))

    def take_command(self) -> tuple[Twist2, str] | None:
        """Return the new command, if any: each is carried out once.

        So the timeout of the drive counts from the last command, as on the real base.
        """
        return self._commands.pop() if self._commands else None

    def report(self, report: Decision) -> None:
        """Store plans, estimates and events of a stack; its command and progress do not count."""
        self._reports.append(report)

    def dismiss(self) -> None:
        """Remove the inner system."""
        self._inner = None

    def start(self, briefing: Briefing) -> None:
        """Begin a world."""
        for listener in self._listeners:
            listener.begin(briefing)
        if self._inner is not None:
            self._inner.start(briefing)

    def update(self, observation: Observation) -> Decision:
        """Inform the listeners; carry out the latest command, else that of the inner system."""
        for listener in self._listeners:
            listener.observe(observation)
        command = self.take_command()
        decision = self._ask(observation)
        if not isinstance(decision, Decision):
            return decision  # the run loop refuses it with a message
        if command is not None:
            self._held_until = observation.time + TAKE_OVER
            self._on_command(command[1])
            return replace(decision, command=command[0])
        if observation.time < self._held_until:
            return replace(decision, command=None)
        if decision.command is not None:
            self._on_command("")
        return decision

    def _ask(self, observation: Observation) -> Decision:
        """Update the inner system when it is due and its mission is not over."""
        if self._inner is None or self._progress.state != "active":
            return self._merged_reports()
        # Collect data between its updates: its period may be any number of ticks.
        self._odometry.extend(observation.odometry)
        self._scans.extend(observation.scans)
        tick = round(observation.time * TICK_RATE)
        if tick < self._due:
            return Decision(None, self._progress)
        self._due = tick + self._every
        new = Observation(
            observation.time,
            tuple(self._odometry),
            tuple(self._scans),
            observation.ground_truth if self._inner_needs_truth else None,
        )
        self._odometry.clear()
        self._scans.clear()
        decision = self._inner.update(new)
        if isinstance(decision, Decision):
            self._progress = decision.progress
        return decision

    def _merged_reports(self) -> Decision:
        """Return all reports since the last call as one."""
        merged = Decision(None, self._progress)
        while self._reports:
            one = self._reports.popleft()
            new = {name: getattr(one, name) for name in _SHOWN if getattr(one, name) is not None}
            merged = replace(merged, events=(*merged.events, *one.events), **new)
        return merged
