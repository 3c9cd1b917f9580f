"""dwa_local_planner of ROS Noetic with the parts of base_local_planner it stands on.

Samples velocities the robot can reach within one control period, follows each for ``sim_time``
and takes the one whose trajectory costs least, by distances on the local costmap.
"""

from daemon.stacks.ros1.dwa._parameters import DwaParameters

__all__ = ["DwaParameters"]
