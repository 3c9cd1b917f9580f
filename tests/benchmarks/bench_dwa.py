"""The sampling controller of the ROS stack: a cycle of the fast version against the plain one.

Both are compiled and decide the same problems, a drive along a corridor with a costmap that is a
second old at most, for the differential and the omnidirectional configuration of the paper; then a
whole call of the controller from Python.
"""

import math
import statistics
import time

import numpy as np

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2, Twist2
from tests.benchmarks.measurement import Measurement, Reference, microseconds
from tests.kernels import load_all
from tests.stacks.ros1.dwa.helpers import A2S, LARGE, OMNI, SMALL, Problem, settings, singles

PROBLEMS = 24
REPEATS = 5
CONFIGURATIONS = (("a2s", A2S, SMALL), ("fro-diff", A2S, LARGE), ("fro-omni", OMNI, LARGE))


def corridor(x, y):
    """Return the costmap around (x, y) of a corridor along y = 40 that is 2.4 m wide."""
    local = CostGrid(0.05, x - 1.5, y - 1.5, np.zeros((60, 60), dtype=np.uint8))
    rows = local.y + 0.05 * (np.arange(60) + 0.5)
    wall = np.maximum(1.2 - np.abs(rows - 40.0), 0.0)
    cost = np.where(wall < 0.025, 254, np.where(wall < 0.085, 253, 252 * np.exp(0.425 - 5 * wall)))
    local.cells[:] = np.where(wall < 0.55, cost, 0.0).astype(np.uint8)[:, None]
    return local


def problems(parameters, outline):
    """Return cycles along a path that weaves through the corridor."""
    built, out = settings(parameters), []
    for k, x in enumerate(np.linspace(20.0, 40.0, PROBLEMS).tolist()):
        along = np.arange(x - 0.3, x + 1.5, 0.025)
        plan = np.column_stack([along, 40.3 + 0.4 * np.sin(along)])
        y = 40.3 + 0.4 * math.sin(x)
        yaw = math.atan(0.4 * math.cos(x)) + 0.2 * math.sin(3.0 * k)
        state = singles(x, y + 0.02 * math.cos(k), yaw, 0.2, 0.0, 0.2 * math.sin(k))
        front = plan[-1] + 0.325 * np.array((1.0, 0.0))
        banned = np.zeros(6, dtype=np.int32)
        local = corridor(x - 0.011 * (k % 10), y)
        out.append(Problem(state, plan, front, True, built, local, outline, banned))
    return out


def _whole(p, parameters):
    dwa = Dwa(parameters, FAST, p.outline, 0.1)
    dwa.set_plan(np.column_stack([p.plan, np.zeros(len(p.plan))]))
    pose, twist = Pose2(*p.state[:3].tolist()), Twist2(*p.state[3:].tolist())
    origin = Pose2()
    return lambda: dwa.command(pose, twist, origin, p.local)


def measure():
    """Yield a cycle and a whole call for each configuration."""
    load_all()
    for name, parameters, outline in (
        ("a2s", A2S, SMALL),
        ("fro-diff", A2S, LARGE),
        ("fro-omni", OMNI, LARGE),
    ):
        cycles = problems(parameters, outline)
        decided = [p.fast()[:2] for p in cycles]
        # The plain one takes as long as all the others together: once is enough, when it is loaded.
        cycles[0].plain()
        begin = time.thread_time()
        plainly = [p.plain()[:2] for p in cycles]
        plain = (time.thread_time() - begin) / len(cycles) * 1e6
        equal = sum(one == other for one, other in zip(decided, plainly, strict=True))
        rows = {"fast": [], "whole": []}
        for _ in range(REPEATS):
            rows["fast"].append(statistics.mean(microseconds(p.cycle()[0], 50) for p in cycles))
            rows["whole"].append(
                statistics.mean(microseconds(_whole(p, parameters), 50) for p in cycles)
            )
        fast, whole = (statistics.median(rows[k]) for k in ("fast", "whole"))
        same = f"same winner {equal}/{len(cycles)}"
        yield Measurement(f"{name}, a cycle", fast, "us", Reference("plain", plain), (), same)
        beside = Reference("the cycle alone", fast)
        yield Measurement("  whole call of the controller", whole, "us", beside)
