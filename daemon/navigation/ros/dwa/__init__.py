"""dwa_local_planner of ROS Noetic with the parts of base_local_planner it stands on.

Samples velocities the robot can reach within one control period, follows each for ``sim_time``
and takes the one whose trajectory costs least, by distances on the local costmap.
"""

from __future__ import annotations

from daemon.navigation.ros.dwa._dwa import Dwa, DwaAnswer
from daemon.navigation.ros.dwa._footprint import footprint_cost
from daemon.navigation.ros.dwa._parameters import WITHOUT_EFFECT, DwaParameters, contradictions
from daemon.navigation.ros.dwa._warmup import warm_up

__all__ = [
    "WITHOUT_EFFECT",
    "Dwa",
    "DwaAnswer",
    "DwaParameters",
    "contradictions",
    "footprint_cost",
    "warm_up",
]
