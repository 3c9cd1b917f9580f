"""GlobalPlanner, the other global planner of ROS Noetic (``global_planner/GlobalPlanner``).

A potential is expanded from the robot over the global costmap, by Dijkstra in waves like those of
navfn or by A* towards the goal; the path is traced back from the goal, and a filter gives its
points their yaws. Update for update as in the original (David V. Lu, Eitan Marder-Eppstein),
because its result depends on the order.

With Dijkstra, the quadratic potential and gradient paths, waves towards a goal that repeats are
restricted as those of navfn are, and checked in the same way.

Where the original looks off its arrays (at the border of a map without outline, or around a goal
there) its result is undefined; here there is nothing to be found: see :mod:`.expansion`.
"""

from daemon.stacks.ros1.global_planner._parameters import WITHOUT_EFFECT, GlobalPlannerParameters
from daemon.stacks.ros1.global_planner._planner import GlobalPlanner, warm_up

__all__ = [
    "WITHOUT_EFFECT",
    "GlobalPlanner",
    "GlobalPlannerParameters",
    "warm_up",
]
