"""Global planners of ROS Noetic: navfn (``navfn/NavfnROS``), ``global_planner/GlobalPlanner``.

GlobalPlanner is built in as it is usually configured: with the wave and the descent of navfn, but
other costs and ends. A*, plain potentials, paths from cell to cell and orientations other than
forward are refused. Every update is that of the originals (by Konolige; by Lu and Marder-Eppstein),
because the result depends on their order.

A wave spreads from the robot over the global costmap until it reaches the goal, and the path
descends from there (Konolige's gradient method).

The whole wave covers everything nearer than the goal, and little of that matters. A potential
spread backward from the goal gives the remaining way from each cell. If a goal repeats, the wave
is therefore restricted to cells whose way is at most a margin longer than the best one. Three
things keep such a path equal to that of the whole wave; every plan checks the last two:

- the margin: a wave that leaves the restricted cells and comes back is late by about as much;
- the descent read no excluded cell, nor one that such a wave could have reached;
- no excluded cell took part in the history of the cells that the descent read. The wave itself
  passes on which cells are doubtful.

A path that fails is planned again with a larger margin, in the end with the whole wave. This is no
full proof. A wave through excluded cells might reach a cell of that history through cells that the
restricted wave had not reached by then. The check cannot show that; only the margin prevents it. On
small random maps with margins from 100 to 2500, instead of the 2000 and more used here, 8 paths in
1 315 180 differed. With the margins used here none of 118 125 differed, nor any in a run of S1.
These counts come from a log of the wave read backward; tests compare the wave's doubts with it.
"""

from daemon.stacks.ros1.navfn._parameters import GlobalPlannerParameters, NavfnParameters

__all__ = ["GlobalPlannerParameters", "NavfnParameters"]
