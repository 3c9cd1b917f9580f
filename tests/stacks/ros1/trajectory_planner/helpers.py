"""Published configurations, small worlds and drives through them."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import yaml

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from grammars.model.geometry import Pose2, Twist2


def rectangle(back, front, side):
    return np.array([[back, -side], [back, side], [front, side], [front, -side]])


def circle(radius):
    angles = 2.0 * math.pi * np.arange(16) / 16.0
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def read_robot(given):
    """Return parameters of TrajectoryPlannerROS, padded footprint, control rate and costmap of a
    robot, and commands of the original."""
    parameters = TrajectoryPlannerParameters(**given["parameters"])
    ((shape, size),) = given["footprint"].items()
    outline = circle(size) if shape == "circle" else rectangle(*size)
    return SimpleNamespace(**given | {"parameters": parameters, "outline": outline})


FILE = Path(__file__).with_name("robots.yaml")
ROBOTS = {name: read_robot(given) for name, given in yaml.safe_load(FILE.read_text()).items()}


def costs_around(pose, cells, resolution, *boxes):
    """Return the window around ``pose``: lethal boxes, inscribed 0.2 m and costs 0.6 m around."""
    x0 = math.floor(pose.x / resolution - cells / 2) * resolution
    y0 = math.floor(pose.y / resolution - cells / 2) * resolution
    steps = resolution * (np.arange(cells) + 0.5)
    x, y = np.meshgrid(x0 + steps, y0 + steps)
    cost = np.zeros((cells, cells))
    for low_x, low_y, high_x, high_y in boxes:
        dx = np.maximum(np.maximum(low_x - x, x - high_x), 0.0)
        dy = np.maximum(np.maximum(low_y - y, y - high_y), 0.0)
        # The larger of both ways, so that no root decides about a whole number.
        d = np.maximum(dx, dy)
        near = np.where(d <= 0.2, 253.0, np.floor(np.maximum(250.0 * (0.6 - d) / 0.4, 0.0)))
        cost = np.maximum(cost, np.where(d == 0.0, 254.0, near))
    return CostGrid(resolution, x0, y0, cost.astype(np.uint8))


def straight(length, yaw=0.0, end=None):
    """Return a plan of ``length`` [m] from the origin; its last heading is ``end`` or ``yaw``."""
    along = np.arange(0.0, length + 1e-9, 0.05)
    plan = np.column_stack([along * math.cos(yaw), along * math.sin(yaw), np.zeros(len(along))])
    plan[-1, 2] = yaw if end is None else end
    return plan


def drive(controller, robot, pose, steps, *boxes):
    """Yield where the robot is and what is commanded, at most ``steps`` times.

    Commands are done at once and to the letter; ends when the goal is reached.
    """
    twist, period = Twist2(), 1.0 / robot.frequency
    local = costs_around(pose, robot.cells, robot.resolution, *boxes)
    for _ in range(steps):
        if controller.goal_reached(pose, twist, Pose2()):
            return
        now = costs_around(pose, robot.cells, robot.resolution, *boxes)
        local.x, local.y = now.x, now.y
        local.cells[:] = now.cells
        local.touch((0, 0, robot.cells, robot.cells))
        answer = controller.command(pose, twist, Pose2(), local)
        yield pose, answer
        twist = answer.twist
        pose = pose @ Pose2(twist.vx * period, twist.vy * period, twist.wz * period)
