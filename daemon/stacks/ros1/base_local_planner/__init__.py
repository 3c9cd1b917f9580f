"""base_local_planner of ROS Noetic: what the sampling controllers stand on.

The plan near the robot, distances from it on the local costmap, and what a footprint lies on.
"""

from daemon.stacks.ros1.base_local_planner.controller import (
    NO_POINTS,
    NO_VELOCITY,
    ControllerAnswer,
    FollowedPlan,
    Objection,
    sim_period,
)
from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost

__all__ = [
    "NO_POINTS",
    "NO_VELOCITY",
    "ControllerAnswer",
    "FollowedPlan",
    "Objection",
    "footprint_cost",
    "sim_period",
]
