"""Who drives the robot of a live world: commands from outside, else a system under test."""

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
"""Ticks between two looks at what was commanded: 0.02 s, as often as laser drivers and
controllers of real robots are read."""
TAKE_OVER: Final = 1.0
"""After a command from outside a system under test has no say for so long [s, simulated]: a hand
on the stick can hold it, and it goes on when the hand lets go."""

_NOWHERE: Final = Progress(0, 0, "active")
_SHOWN: Final = ("estimate", "cloud", "plan", "local_plan", "particles")
_MOST_REPORTS: Final = 1000
"""Reports that wait while the world stands still; older ones are dropped."""


class OutsideInput:
    """The latest velocity command from outside and what a stack there says; for any thread."""

    def __init__(self) -> None:
        self._commands: deque[tuple[Twist2, str]] = deque(maxlen=1)
        self._reports: deque[Decision] = deque(maxlen=_MOST_REPORTS)

    def command(self, twist: Twist2, source: str) -> None:
        """Leave a command in the body frame; raises ``ValueError`` for numbers that are none."""
        if not all(map(math.isfinite, (twist.vx, twist.vy, twist.wz))):
            raise ValueError(f"a velocity command must be finite, not {twist}")
        self._commands.append((twist, source))

    def take_command(self) -> tuple[Twist2, str] | None:
        """Return the command that nobody has taken yet: each is carried out once.

        So the timeout of the drive counts from the last command, as on the real base.
        """
        return self._commands.pop() if self._commands else None

    def report(self, said: Decision) -> None:
        """Leave plans, estimates and events of a stack; its command and progress do not count."""
        self._reports.append(said)

    def take_report(self) -> Decision:
        """Return what was said since the last time."""
        all_of_it = Decision(None, _NOWHERE)
        while self._reports:
            said = self._reports.popleft()
            new = {name: getattr(said, name) for name in _SHOWN if getattr(said, name) is not None}
            all_of_it = replace(all_of_it, events=(*all_of_it.events, *said.events), **new)
        return all_of_it


class RobotListener(Protocol):
    """Who gets what a robot would publish; both are called by the thread of the simulation."""

    def begin(self, briefing: Briefing) -> None:
        """A world begins, at time 0."""

    def observe(self, observation: Observation) -> None:
        """What is new, and where the robot is, every :data:`PERIOD` ticks or more often."""


class LiveDriver:
    """A system under test made of commands from outside and, perhaps, another one inside.

    ``commanded`` is told when a command of somebody is carried out.
    """

    def __init__(
        self,
        outside: OutsideInput,
        inner: SystemUnderTest | None = None,
        listeners: Sequence[RobotListener] = (),
        commanded: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._outside, self._listeners, self._commanded = outside, listeners, commanded
        self._inner = inner
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
        """Whether the system inside does, or anybody listens who may look at the truth."""
        return bool(self._listeners) or self._inner_needs_truth

    @property
    def _inner_needs_truth(self) -> bool:
        return self._inner is not None and self._inner.needs_ground_truth

    @property
    def progress(self) -> Progress:
        """Where the mission of the system inside stands."""
        return self._progress

    def dismiss(self) -> None:
        """Ask the system inside no more."""
        self._inner = None

    def start(self, briefing: Briefing) -> None:
        """Begin a world."""
        for listener in self._listeners:
            listener.begin(briefing)
        if self._inner is not None:
            self._inner.start(briefing)

    def update(self, observation: Observation) -> Decision:
        """Tell the listeners, carry out the latest command; else do what the system inside says."""
        for listener in self._listeners:
            listener.observe(observation)
        taken = self._outside.take_command()
        decision = self._ask(observation)
        if not isinstance(decision, Decision):
            return decision  # whoever carries it out says what is wrong with it
        if taken is not None:
            self._held_until = observation.time + TAKE_OVER
            self._commanded(taken[1])
            return replace(decision, command=taken[0])
        if observation.time < self._held_until:
            return replace(decision, command=None)
        if decision.command is not None:
            self._commanded("")
        return decision

    def _ask(self, observation: Observation) -> Decision:
        """Ask the system inside when it is due and its mission is not over."""
        if self._inner is None or self._progress.state != "active":
            return replace(self._outside.take_report(), progress=self._progress)
        # Its period may be any number of ticks: what came in between is kept for it.
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
