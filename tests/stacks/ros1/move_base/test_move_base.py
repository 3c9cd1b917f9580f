"""move_base instant by instant: states, plans, commands and recoveries; goals one after the other.

What is expected was followed on paper through the published move_base (Noetic): ``executeCb``,
``executeCycle``, ``planThread`` and ``resetState`` of ``move_base.cpp``, and ``ros::Rate::sleep``.
Controlling is due every 0.1 s from the goal on; the planner thread has its turn every 0.05 s,
before the control loop: a wake-up of the one is heard by the other at the next instant.
``instants.txt`` has what is given (when planner and controller fail, parameters, how long each
recovery takes), and what comes of it. ``pytest --update`` adds what comes of new cases.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from daemon.stacks.ros1.base_local_planner.controller import (
    NO_POINTS,
    NO_VELOCITY,
    ControllerAnswer,
)
from daemon.stacks.ros1.move_base import DispatcherParameters, MoveBaseParameters
from daemon.stacks.ros1.move_base.control import MoveBase, MoveBaseStatus, PlannerThread
from daemon.stacks.ros1.move_base.dispatcher import WaypointDispatcher
from daemon.stacks.ros1.move_base.recoveries import RecoveryStep
from daemon.stacks.ros1.quirks import FAST, Quirks
from grammars.model.geometry import Pose2, Twist2
from grammars.model.mission import Waypoint
from tests.stacks.cases import cases, written

INSTANTS = Path(__file__).with_name("instants.txt")
STEP = 0.05
GOAL = Pose2(10.0, 0.0, 0.0)
FORWARD = Twist2(0.2, 0.0, 0.0)
PLAN = np.array([(0.0, 0.0, 0.0), (10.0, 0.0, 0.0)])
PARAMETERS = {
    "controller_frequency": 10.0,
    "planner_frequency": 5.0,
    "oscillation_timeout": 10.0,
    "oscillation_distance": 0.2,
}


def fails(spans, now):
    """Tell whether a time lies in [since, until) of one of some spans."""
    return any(since - 1e-6 < now < until - 1e-6 for since, until in spans)


@dataclass
class Recovery:
    """A recovery that takes ``lasts`` seconds."""

    name: str
    bench: object
    lasts: float
    period = STEP

    def start(self):
        self.since = self.bench.now
        self.bench.tried.append((self.since, self.name))

    def step(self):
        return RecoveryStep(None, self.bench.now - self.since >= self.lasts - 1e-9)


class Bench:
    """Steps the planner thread and then the control loop, every 50 ms."""

    def __init__(
        self, no_plan=(), no_command=(), parameters=(), recoveries=(0.0,) * 4, without=None
    ):
        given = MoveBaseParameters(**PARAMETERS | dict(parameters))
        quirks = replace(Quirks(), **{without: False}) if without else FAST
        self.now, self.pose, self.speed = 0.0, Pose2(), 0.2
        self.arrived, self.result, self.new_plans = False, None, 0
        self.no_plan, self.no_command = no_plan, no_command
        self.status = MoveBaseStatus()
        self.tried, self.planned, self.states, self.commands = [], [], [], []
        frame = type("Frame", (), {
            "name": "map", "transforms": SimpleNamespace(twist=Twist2()),
            "base": property(lambda _: self.pose), "pose_in": lambda _, other: Pose2(),
        })  # fmt: skip
        costmap = SimpleNamespace(costmap=SimpleNamespace(grid=None), frame=frame())
        planner = SimpleNamespace(plan=self._plan)
        self.planner = PlannerThread(given, quirks, self.status, planner, costmap)
        controller = SimpleNamespace(
            set_plan=self._set_plan, goal_reached=lambda *_: self.arrived, command=self._command
        )
        behaviours = [Recovery(f"r{k}", self, lasts) for k, lasts in enumerate(recoveries)]
        self.move_base = MoveBase(
            given, quirks, self.status, self.planner, controller, behaviours, costmap, costmap
        )

    def _plan(self, grid, start, goal):
        self.planned.append(self.now)
        return None if fails(self.no_plan, self.now) else PLAN

    def _set_plan(self, plan):
        self.new_plans += 1

    def _command(self, *state):
        if fails(self.no_command, self.now):
            return NO_VELOCITY
        return ControllerAnswer(True, FORWARD, NO_POINTS)

    def accept(self, now=0.0):
        self.now, self.result, self.arrived = now, None, False
        self.move_base.accept(now, GOAL)
        assert self.move_base.take_command() == Twist2()

    def run(self, until):
        """Step until a time [s] or the end of the goal."""
        while self.now < until - 1e-9 and self.result is None:
            self.now = round(self.now + STEP, 9)
            if self.commands and self.commands[-1][1] == FORWARD:
                self.pose = Pose2(self.pose.x + self.speed * STEP, self.pose.y, 0.0)
            self.planner.step(self.now)
            self.move_base.step(self.now)
            self.result = self.move_base.take_result()
            if (command := self.move_base.take_command()) is not None:
                assert command in (FORWARD, Twist2())
                self.commands.append((self.now, command))
            state = str(self.status.state)
            if not self.states or self.states[-1][1] != state:
                self.states.append((self.now, state))


def series(times):
    """Write times; three and more with the same step as the first two and the last."""
    words, times = [], [round(time, 2) for time in times]
    while times:
        step = round(times[1] - times[0], 2) if len(times) > 1 else 0.0
        count = 1
        while count < len(times) and round(times[count] - times[count - 1], 2) == step:
            count += 1
        shown = times[:count] if count < 4 else [*times[:2], "...", times[count - 1]]
        words += [f"{time}" for time in shown]
        times = times[count:]
    return " ".join(words)


def timeline(steps, begin=0.0, at=(0.0, 0.0), **given):
    """Return what comes of a goal that is given at ``begin`` [s] to a robot ``at`` a place."""
    bench = Bench(**given)
    bench.pose = Pose2(*at)
    bench.accept(begin)
    for step in steps:
        if "goal" in step:
            bench.accept(step["goal"])
        if "at" in step:
            bench.pose = Pose2(*step["at"])
        bench.speed = step.get("speed", bench.speed)
        bench.arrived = step.get("arrived", bench.arrived)
        bench.run(step["until"])
    told = {f"{command}": [t for t, c in bench.commands if c == twist]
            for command, twist in (("forward", FORWARD), ("stopped", Twist2()))}  # fmt: skip
    status = bench.status
    return [
        f"planned {series(bench.planned)}",
        "states " + ", ".join(f"{time:g} {state}" for time, state in bench.states),
        *(f"{command} {series(times)}" for command, times in told.items() if times),
        *(f"recovery {time:g} {name}" for time, name in bench.tried),
        *status.log,
        f"{bench.result or 'active'} at {bench.now:g}, {bench.new_plans} plans handed over, "
        f"planner {'runs' if status.planner_runs else 'rests'}, "
        f"{status.planning_retries} retries, {'a goal' if status.goal else 'no goal'}",
    ]


def test_instants_are_those_of_the_original(golden):
    told = []
    for name, lines in cases(INSTANTS):
        given = yaml.safe_load("\n".join(lines))
        told += written((name, lines), timeline(**given))
    golden(INSTANTS.name, "\n".join(told) + "\n")


def test_planning_as_often_as_controlling_leaves_a_cycle_without_a_new_plan_now_and_then():
    bench = Bench(parameters={"controller_frequency": 20.0, "planner_frequency": 20.0})
    bench.accept()
    bench.run(60.0)
    cycles = len(bench.commands)
    assert cycles == pytest.approx(1199, abs=1)
    # A millisecond in fifty is lost to being woken: of fifty-one cycles one has the old plan.
    assert cycles - bench.new_plans == pytest.approx(cycles / 51, abs=2)


WAYPOINTS = (Waypoint("a", 1.0, 0.0, 0.5), Waypoint("b", 2.0, 0.0), Waypoint("c", 3.0, 0.0))
GOALS = (Pose2(1.0, 0.0, 0.5), Pose2(2.0, 0.0, 0.0), Pose2(3.0, 0.0, 0.0))
HERE = Pose2(0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("steps", "progress"),
    [
        # A goal at once, the next one with its result, but not within a second of the one before.
        ([(0.0, "", 0), (0.05, "", None), (20.0, "succeeded", 1), (20.3, "succeeded", None),
          (20.95, "", None), (21.0, "", 2), (30.0, "succeeded", None)], (2, 3, "succeeded")),
        ([(0.0, "", 0), (10.0, "succeeded", 1), (20.0, "aborted", None), (30.0, "", None)],
         (1, 1, "aborted")),
    ],
)  # fmt: skip
def test_goals_are_sent_one_after_the_other(steps, progress):
    asked = []
    parameters = DispatcherParameters()
    dispatcher = WaypointDispatcher(parameters, WAYPOINTS, lambda *ends: asked.append(ends))
    for time, result, sent in steps:
        goal = dispatcher.step(time, result or None, HERE)
        assert goal == (None if sent is None else GOALS[sent]), time
    now = dispatcher.progress
    assert (now.current, now.reached, now.state) == progress
    # A plan from where amcl last saw the robot.
    assert asked == [(HERE, GOALS[sent]) for _, _, sent in steps if sent is not None]


def test_the_next_goal_waits_until_the_stay_is_over():
    stays = (replace(WAYPOINTS[0], wait=5.0), replace(WAYPOINTS[1], wait=3.0))
    dispatcher = WaypointDispatcher(DispatcherParameters(make_plan=False), stays, pytest.fail)
    instants = {0.0: "", 10.0: "succeeded", 14.9: "", 15.0: "", 20.0: "succeeded", 22.9: ""}
    sent = [t for t, result in instants.items() if dispatcher.step(t, result or None, HERE)]
    assert (sent, dispatcher.progress.state) == ([0.0, 15.0], "active")
    dispatcher.step(23.0, None, HERE)
    assert dispatcher.progress.state == "succeeded"


def test_a_waypoint_without_a_heading_gets_that_of_the_parameters():
    given = DispatcherParameters(default_yaw=1.0, make_plan=False)
    dispatcher = WaypointDispatcher(given, WAYPOINTS[1:], pytest.fail)
    assert dispatcher.step(0.0, None, HERE) == Pose2(2.0, 0.0, 1.0)
