"""TrajectoryPlannerROS of base_local_planner of ROS Noetic, the default local planner of move_base.

It tries reachable arcs, then turns on the spot, then strafing, and backs up if no motion is legal.
The cheapest wins, by distances on the local costmap.
"""

from daemon.stacks.ros1.trajectory_planner._parameters import TrajectoryPlannerParameters

__all__ = ["TrajectoryPlannerParameters"]
