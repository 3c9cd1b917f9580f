"""TrajectoryPlannerROS of the ROS stack: whole calls of the fast version against the plain one.

The same cycles of five published robots in a bend beside two boxes, command by command; the plain
version tries every trajectory in turn, in Python with compiled footprints and distances.
"""

import statistics
import time

import numpy as np

from daemon.stacks.ros1.quirks import FAST
from daemon.stacks.ros1.trajectory_planner._parameters import strafe_speeds
from daemon.stacks.ros1.trajectory_planner._settings import settings_of
from daemon.stacks.ros1.trajectory_planner.controller import TrajectoryPlanner
from grammars.model.geometry import Pose2, Twist2
from tests.benchmarks.measurement import Measurement, Reference, microseconds
from tests.kernels import load_all
from tests.stacks.ros1.trajectory_planner.helpers import ROBOTS, costs_around
from tests.stacks.ros1.trajectory_planner.plain import PlainPlanner

CYCLES = 6
REPEATS = 5
BOXES = ((1.0, -1.6, 1.4, -0.9), (0.6, 1.0, 1.2, 1.5))


def _cycle(robot, k):
    """Return a cycle, CPU microseconds of the plain version, and whether they command the same."""
    pose, twist = Pose2(0.01 * k, 0.02, 0.1 * k), Twist2(0.2, 0.0, 0.05 * k)
    local = costs_around(pose, robot.cells, robot.resolution, *BOXES)
    along = np.arange(0.0, 1.2, 0.05)
    plan = np.column_stack([along, 0.3 * np.sin(along), np.zeros(len(along))])
    p, period = robot.parameters, 1.0 / robot.frequency
    fast = TrajectoryPlanner(p, FAST, robot.outline, period)
    fast.set_plan(plan)
    s = settings_of(p, FAST, robot.resolution, period)
    plain = PlainPlanner(s, strafe_speeds(p), robot.outline)
    row = (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz)
    state = np.array(row, dtype=np.float32).astype(np.float64)
    found = fast.command(pose, twist, Pose2(), local)
    begin = time.thread_time()
    expected = plain.best(state, plan[:, :2], local)
    took = (time.thread_time() - begin) * 1e6
    same = (found.twist.vx, found.twist.vy, found.twist.wz) == expected.velocity
    return lambda: fast.command(pose, twist, Pose2(), local), took, same


def measure():
    """Yield a command of each robot."""
    load_all()
    for name, robot in ROBOTS.items():
        cycles = [_cycle(robot, k) for k in range(CYCLES)]
        fast = statistics.median(
            statistics.mean(microseconds(cycle[0], 20) for cycle in cycles) for _ in range(REPEATS)
        )
        plain = statistics.mean(cycle[1] for cycle in cycles)
        same = sum(cycle[2] for cycle in cycles)
        note = f"same command {same}/{CYCLES}"
        yield Measurement(f"{name}, a command", fast, "us", Reference("plain", plain), (), note)
