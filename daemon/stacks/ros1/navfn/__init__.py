"""navfn, the global planner of ROS Noetic's move_base (``navfn/NavfnROS``).

A wave spreads from the robot over the global costmap until it reaches the goal, and the path
descends from there (Konolige's gradient method). Update for update as in the original, because
its result depends on the order.

The whole wave covers everything nearer than the goal, and little of that matters. Once a goal
repeats, the wave is therefore restricted to cells from which, by a potential spread backward
from the goal, the way on is at most a margin longer than the best one. Three things hold such a
path to that of the whole wave, the last two checked for every plan:

- the margin: a wave that leaves the restricted cells and comes back is late by about as much;
- the descent looked at no cell that was left out, nor at one that such a wave could have reached;
- no cell left out took part, at its time, in anything that the looked at cells have gone through:
  the wave itself passes on which cells are doubtful.

A path that fails is planned again with a larger margin, in the end with the whole wave. This is
no full proof: a wave through cells left out might reach a cell of that history by way of cells
that the restricted wave had not come to by then, which that cannot show; only the margin
stands against that. On small random maps with margins drawn from 100 to 2500, instead of the
2000 and more used here, 8 paths in 1 315 180 differed; with those used here none in 118 125, nor
in a whole run of S1. Paths were counted when doubt was found
by reading a log of the wave backward; the tests hold what the wave passes on to that.
"""

from daemon.stacks.ros1.navfn._parameters import NavfnParameters

__all__ = ["NavfnParameters"]
