"""navfn, the global planner of ROS Noetic's move_base (``navfn/NavfnROS``).

A wave spreads from the robot over the global costmap until it reaches the goal, and the path
descends from there (Konolige's gradient method). Update for update as in the original, because
its result depends on the order.
"""

from __future__ import annotations

from daemon.navigation.ros.navfn._parameters import WITHOUT_EFFECT, NavfnParameters
from daemon.navigation.ros.navfn._planner import Navfn
from daemon.navigation.ros.navfn._warmup import warm_up

__all__ = ["WITHOUT_EFFECT", "Navfn", "NavfnParameters", "warm_up"]
