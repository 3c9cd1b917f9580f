"""GlobalPlanner, the other global planner of ROS Noetic (``global_planner/GlobalPlanner``).

As most robots configure it: Dijkstra expands a potential from the robot over the global costmap
with the wave of navfn, a path is traced back from the goal along the gradient, and its points look
forward. Update for update as in the original (David V. Lu, Eitan Marder-Eppstein), because its
result depends on the order. A*, plain potentials, paths from cell to cell and other orientations
are refused.

Field, waves and descent are those of :mod:`daemon.stacks.ros1.navfn`, with other costs and ends.
"""

from daemon.stacks.ros1.global_planner._parameters import GlobalPlannerParameters

__all__ = ["GlobalPlannerParameters"]
