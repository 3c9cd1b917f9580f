"""dwa_local_planner of ROS Noetic with the parts of base_local_planner it stands on.

Samples velocities the robot can reach within one control period, follows each for ``sim_time``
and takes the one whose trajectory costs least, by distances on the local costmap.
"""

from daemon.stacks.ros1.dwa._dwa import Dwa, Oscillation, warm_up
from daemon.stacks.ros1.dwa._parameters import (
    RENAMED,
    WITHOUT_EFFECT,
    DwaParameters,
    DwaSettings,
    contradictions,
    doubts,
    longest_trajectory,
    settings_of,
)

__all__ = [
    "RENAMED",
    "WITHOUT_EFFECT",
    "Dwa",
    "DwaParameters",
    "DwaSettings",
    "Oscillation",
    "contradictions",
    "doubts",
    "longest_trajectory",
    "settings_of",
    "warm_up",
]
