"""dwa_local_planner of ROS Noetic.

It samples velocities that the robot can reach within one control period, follows each for
``sim_time`` and takes the one with the cheapest trajectory, by distances on the local costmap.
"""

from daemon.stacks.ros1.dwa._parameters import DwaParameters

__all__ = ["DwaParameters"]
