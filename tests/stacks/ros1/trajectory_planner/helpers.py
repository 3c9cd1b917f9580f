"""Published configurations, small worlds and drives through them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from grammars.model.geometry import Floats, Pose2, Twist2


def rectangle(back, front, side):
    return np.array([[back, -side], [back, side], [front, side], [front, -side]])


def circle(radius):
    angles = 2.0 * math.pi * np.arange(16) / 16.0
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


@dataclass(frozen=True)
class Robot:
    """Parameters of TrajectoryPlannerROS, padded footprint, control rate and costmap of a robot."""

    parameters: TrajectoryPlannerParameters
    outline: Floats
    frequency: float
    cells: int
    resolution: float


ROBOTS = {
    "husky": Robot(
        TrajectoryPlannerParameters(
            acc_lim_x=2.5, acc_lim_theta=3.2, max_vel_x=1.0, min_vel_x=0.0, max_vel_theta=1.0,
            min_vel_theta=-1.0, min_in_place_vel_theta=0.2, holonomic_robot=False,
            escape_vel=-0.1, yaw_goal_tolerance=0.1, xy_goal_tolerance=0.2, sim_time=2.0,
            sim_granularity=0.02, angular_sim_granularity=0.02, vx_samples=6, vtheta_samples=20,
            controller_frequency=20.0, meter_scoring=True, occdist_scale=0.1, pdist_scale=0.75,
            gdist_scale=1.0, heading_lookahead=0.325, heading_scoring_timestep=0.8, dwa=True,
            oscillation_reset_dist=0.25, escape_reset_dist=0.1, escape_reset_theta=0.1,
        ),
        rectangle(-0.51, 0.51, 0.34), 5.0, 120, 0.05,
    ),
    "jackal": Robot(
        TrajectoryPlannerParameters(
            acc_lim_x=10.0, acc_lim_theta=20.0, max_vel_x=0.5, min_vel_x=0.1, max_vel_theta=1.57,
            min_vel_theta=-1.57, min_in_place_vel_theta=0.314, holonomic_robot=False,
            escape_vel=-0.5, yaw_goal_tolerance=0.157, xy_goal_tolerance=0.25, sim_time=2.0,
            sim_granularity=0.02, angular_sim_granularity=0.02, vx_samples=6, vtheta_samples=20,
            controller_frequency=20.0, meter_scoring=True, occdist_scale=0.1, pdist_scale=0.75,
            gdist_scale=1.0, heading_scoring_timestep=0.8, dwa=True, oscillation_reset_dist=0.05,
            escape_reset_dist=0.1, escape_reset_theta=0.1,
        ),
        rectangle(-0.31, 0.31, 0.265), 20.0, 200, 0.05,
    ),
    "fetch": Robot(
        TrajectoryPlannerParameters(
            acc_lim_x=0.35, acc_lim_y=0.0, acc_lim_theta=0.8, max_vel_x=1.0, min_vel_x=0.15,
            max_vel_theta=1.5, min_vel_theta=-1.5, min_in_place_vel_theta=0.3,
            holonomic_robot=False, yaw_goal_tolerance=0.1, xy_goal_tolerance=0.1,
            latch_xy_goal_tolerance=True, sim_time=1.0, sim_granularity=0.025,
            angular_sim_granularity=0.025, vx_samples=3, vtheta_samples=10, meter_scoring=True,
            path_distance_bias=0.5, goal_distance_bias=0.75, occdist_scale=0.00625,
            heading_lookahead=0.325, heading_scoring_timestep=0.8, heading_scoring=True, dwa=False,
            oscillation_reset_dist=0.05,
        ),
        circle(0.31), 25.0, 160, 0.025,
    ),
    "mir": Robot(
        TrajectoryPlannerParameters(
            acc_lim_x=1.5, acc_lim_y=0.0, acc_lim_theta=2.0, max_vel_x=0.8, min_vel_x=0.1,
            max_vel_theta=1.0, min_vel_theta=-1.0, min_in_place_vel_theta=0.2, escape_vel=-0.1,
            holonomic_robot=False, yaw_goal_tolerance=0.03, xy_goal_tolerance=0.08,
            latch_xy_goal_tolerance=True, sim_time=1.2, sim_granularity=0.025,
            angular_sim_granularity=0.04, vx_samples=15, vtheta_samples=20,
            controller_frequency=5.0, meter_scoring=True, pdist_scale=2.2, gdist_scale=0.8,
            occdist_scale=0.1, heading_scoring=True, heading_scoring_timestep=0.8, dwa=True,
            oscillation_reset_dist=0.05, prune_plan=True,
        ),
        rectangle(-0.454, 0.506, 0.32), 5.0, 160, 0.05,
    ),
    "robile_amr": Robot(
        TrajectoryPlannerParameters(
            acc_lim_x=1.0, acc_lim_y=0.5, acc_lim_theta=1.0, max_vel_x=0.3, min_vel_x=0.1,
            max_vel_theta=0.5, min_vel_theta=-0.5, min_in_place_vel_theta=0.4, escape_vel=-0.1,
            holonomic_robot=False, yaw_goal_tolerance=0.1, xy_goal_tolerance=0.2,
            latch_xy_goal_tolerance=True, sim_time=5.0, sim_granularity=0.1,
            angular_sim_granularity=0.025, vx_samples=5, vtheta_samples=20,
            controller_frequency=5.0, meter_scoring=True, pdist_scale=1.0, gdist_scale=2.0,
            occdist_scale=0.05, heading_lookahead=0.825, heading_scoring_timestep=0.8, dwa=True,
        ),
        rectangle(-0.34, 0.34, 0.34), 5.0, 60, 0.1,
    ),
}  # fmt: skip
"""Facts of five published configurations, with move_base's rate and the costmap's size."""


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
