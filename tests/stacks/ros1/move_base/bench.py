"""move_base on a bench: a planner, a controller and recoveries that do what a test tells them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from daemon.stacks.ros1.base_local_planner.controller import (
    NO_POINTS,
    NO_VELOCITY,
    ControllerAnswer,
)
from daemon.stacks.ros1.move_base import MoveBaseParameters
from daemon.stacks.ros1.move_base.control import MoveBase, MoveBaseStatus, PlannerThread
from daemon.stacks.ros1.move_base.recoveries import RecoveryStep
from daemon.stacks.ros1.quirks import FAST, Quirks
from grammars.model.geometry import Pose2, Twist2

STEP = 0.05
GOAL = Pose2(10.0, 0.0, 0.0)
FORWARD = Twist2(0.2, 0.0, 0.0)
PLAN = np.array([(0.0, 0.0, 0.0), (10.0, 0.0, 0.0)])


@dataclass
class FakeController:
    works: Callable[[float], bool]
    bench: Bench
    plans: int = 0
    arrived: bool = False

    def set_plan(self, plan):
        self.plans += 1

    def goal_reached(self, pose, twist, plan_frame):
        return self.arrived

    def command(self, pose, twist, plan_frame, grid):
        works = self.works(self.bench.now)
        return ControllerAnswer(True, FORWARD, NO_POINTS) if works else NO_VELOCITY


@dataclass
class FakeFrame:
    """A frame in map, where the bench has the robot."""

    bench: Bench
    name = "map"
    transforms = SimpleNamespace(twist=Twist2())

    @property
    def base(self):
        return self.bench.pose

    def pose_in(self, other):
        return Pose2()


@dataclass
class Tried:
    """A recovery that takes ``lasts`` seconds."""

    name: str
    bench: Bench
    lasts: float = 0.0
    period: float = STEP
    since: float = 0.0

    def start(self):
        self.since = self.bench.now
        self.bench.tried.append((self.since, self.name))

    def step(self):
        return RecoveryStep(None, self.bench.now - self.since >= self.lasts - 1e-9)


@dataclass
class Bench:
    """Steps the planner thread and then the control loop, every 50 ms."""

    plans: Callable[[float], bool] = lambda now: True
    works: Callable[[float], bool] = lambda now: True
    quirks: Quirks = FAST
    parameters: dict[str, Any] = field(default_factory=dict)
    recoveries: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    speed: float = 0.2
    """How fast the robot gets on while it is commanded to [m/s]."""

    def __post_init__(self):
        defaults = {
            "controller_frequency": 10.0,
            "planner_frequency": 5.0,
            "oscillation_timeout": 10.0,
            "oscillation_distance": 0.2,
        }
        given = MoveBaseParameters(**(defaults | self.parameters))
        self.now, self.pose = 0.0, Pose2()
        self.status = MoveBaseStatus()
        self.tried = []
        self.planned = []
        self.states = []
        self.commands = []
        self.result = None
        self.controller = FakeController(self.works, self)
        recoveries = [Tried(f"r{k}", self, lasts) for k, lasts in enumerate(self.recoveries)]
        costmap = SimpleNamespace(costmap=SimpleNamespace(grid=None), frame=FakeFrame(self))
        self.planner = PlannerThread(
            given, self.quirks, self.status, SimpleNamespace(plan=self._plan), costmap
        )
        self.move_base = MoveBase(
            given, self.quirks, self.status, self.planner, self.controller, recoveries,
            costmap, costmap,
        )  # fmt: skip

    def _plan(self, grid, start, goal):
        self.planned.append(self.now)
        return PLAN if self.plans(self.now) else None

    def accept(self):
        self.move_base.accept(self.now, GOAL)
        assert self.move_base.take_command() == Twist2()

    def run(self, until):
        """Step until a time [s] or the end of the goal."""
        while self.now < until - 1e-9 and self.result is None:
            self.now = round(self.now + STEP, 9)
            moving = bool(self.commands) and self.commands[-1][1] == FORWARD
            if moving:
                self.pose = Pose2(self.pose.x + self.speed * STEP, self.pose.y, 0.0)
            self.planner.step(self.now)
            self.move_base.step(self.now)
            self.result = self.move_base.take_result()
            command = self.move_base.take_command()
            if command is not None:
                self.commands.append((self.now, command))
            state = str(self.status.state)
            if not self.states or self.states[-1][1] != state:
                self.states.append((self.now, state))
        return self

    def said(self, words):
        """How many sentences contain ``words``."""
        return sum(words in sentence for sentence in self.status.log)


def without(quirk):
    """The original but for a quirk."""
    return replace(Quirks(), **{quirk: False})
