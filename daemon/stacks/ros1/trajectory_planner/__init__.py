"""TrajectoryPlannerROS of base_local_planner of ROS Noetic, the default local planner of move_base.

Tries arcs the robot can reach, then turns on the spot, then strafing, and backs up when nothing
is legal; the cheapest wins, by distances on the local costmap.
"""

from daemon.stacks.ros1.trajectory_planner._parameters import TrajectoryPlannerParameters

__all__ = ["TrajectoryPlannerParameters"]
