"""GlobalPlanner, the other global planner of ROS Noetic (``global_planner/GlobalPlanner``).

This is the usual configuration: Dijkstra expands a potential from the robot over the global costmap
with the wave of navfn. A path leads back from the goal along the gradient, and its points look
forward. Every update is that of the original (David V. Lu, Eitan Marder-Eppstein), because the
result depends on their order. A*, plain potentials, paths from cell to cell and other orientations
are refused.

Field, waves and descent are those of :mod:`daemon.stacks.ros1.navfn`, with other costs and ends.
"""

from daemon.stacks.ros1.global_planner._parameters import GlobalPlannerParameters

__all__ = ["GlobalPlannerParameters"]
