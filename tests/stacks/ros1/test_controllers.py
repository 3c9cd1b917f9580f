"""What both controllers do at and before the goal, with plans, and with costmaps of other shapes.

``controllers.txt`` has cases: the controller and its parameters; ``steps`` are cycles one after
the other, ``each`` is a list of cycles that each begin with a controller of their own. What comes
of a cycle is what is commanded, with how many points, and whether the goal is reached.
"""

from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.quirks import FAST, FIXED
from daemon.stacks.ros1.trajectory_planner.controller import TrajectoryPlanner
from grammars.model.geometry import Pose2, Twist2
from tests.stacks.cases import cases, written
from tests.stacks.ros1.dwa.helpers import A2S, OMNI, SMALL
from tests.stacks.ros1.trajectory_planner.helpers import ROBOTS, costs_around, rectangle, straight

CONTROLLERS = Path(__file__).with_name("controllers.txt")
HUSKY = ROBOTS["husky"].parameters


def made(base, parameters=(), quirks="fast", *, latch=False):
    """Return a controller with the parameters of a robot and others."""
    kept = {"fast": FAST, "fixed": FIXED}[quirks]
    if base == "husky":
        given = replace(HUSKY, **dict(parameters))
        return TrajectoryPlanner(given, kept, rectangle(-0.3, 0.3, 0.2), 0.2)
    given = replace({"a2s": A2S, "omni": OMNI}[base], **dict(parameters))
    return Dwa(given, kept, SMALL, 0.05, latch_goal=latch)


def plan_of(length=1.0, yaw=0.0, end=None, *, aside=0.0, back=False):
    plan = straight(length, yaw, end) + np.array((0.0, aside, 0.0))
    return np.concatenate([plan, plan[::-1]]) if back else plan


def cycle(controller, at, moves=(), boxes=(), cells=80, frame=(), plan=None):
    """Return what one cycle comes to."""
    if plan is not None:
        controller.set_plan(plan_of(**plan))
    pose, twist, frame = Pose2(*at), Twist2(*moves), Pose2(*frame)
    answer = controller.command(pose, twist, frame, costs_around(pose, cells, 0.05, *boxes))
    speeds = " ".join(f"{round(v, 6) + 0.0:g}" for v in astuple(answer.twist))
    reached = "reached" if controller.goal_reached(pose, twist, frame) else "on the way"
    words = f"{speeds}, {len(answer.local_plan)} points" if answer.ok else "no command"
    assert answer.ok or answer.twist == Twist2()
    forgotten = controller._plan._start
    return f"{words}, {reached}" + (f", {forgotten} points forgotten" if forgotten else "")


def results(plan=(), steps=(), each=(), **given):
    for run in [steps, *(one if isinstance(one, list) else [one] for one in each)]:
        controller = made(**given)
        if plan is not None:
            controller.set_plan(plan_of(**dict(plan)))
        for step in run:
            yield cycle(controller, **step)


def test_commands_are_as_expected(golden):
    told = []
    for name, lines in cases(CONTROLLERS):
        told += written((name, lines), results(**yaml.safe_load("\n".join(lines))))
    golden(CONTROLLERS.name, "\n".join(told) + "\n")


@pytest.mark.parametrize("base", ["a2s", "husky"])
def test_the_plan_is_taken_through_the_correction_of_the_map(base):
    correction, twist = Pose2(5.0, -3.0, 0.7), Twist2(0.2, 0.0, 0.1)
    here, moved = made(base), made(base)
    plan = straight(1.5) * (0.9, 1.0, 1.0) + (0.012, 0.012, 0.0)  # nothing on edges of cells
    here.set_plan(plan)
    points = [correction @ Pose2(x, y, yaw) for x, y, yaw in plan.tolist()]
    moved.set_plan(np.array([(p.x, p.y, p.yaw) for p in points]))
    pose, local = Pose2(0.003, 0.004, 0.1), costs_around(Pose2(), 80, 0.05)
    expected = here.command(pose, twist, Pose2(), local)
    assert expected.ok
    assert moved.command(pose, twist, correction, local).twist == expected.twist
