"""The grid distances of a past sampling cycle, for commands that are only checked."""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.dwa._decide import Room
from daemon.navigation.ros.dwa._distances import box, only, passable_cells, spread_out
from daemon.navigation.ros.dwa._plan import walk
from daemon.navigation.ros.dwa._score import Field
from grammars.values import Floats


@kernel
def _complete(plan: Floats, old: Field, r: Room) -> None:
    rows, columns = old.cells.shape
    n = plan.shape[0]
    passable = np.empty_like(r.passable)
    passable_cells(old.cells, passable)
    box(0, columns, 0, rows, r.wanted)
    last = walk(plan, n, plan[n - 1], old.cells, old.frame, r.seeds)
    spread_out(r.seeds, passable, r.wanted, old.path, r.fronts)
    if last >= 0:
        only(last // columns, last % columns, r.seeds)
    spread_out(r.seeds, passable, r.wanted, old.goal, r.fronts)


class LastCycle:
    """What the last sampling cycle saw.

    That cycle needed its distances only near the robot; a check may need them elsewhere, for the
    costmap may have moved since, while the distances have not (``MapGridCostFunction``).
    """

    def __init__(self, plan: Floats, field: Field) -> None:
        self._plan = plan.copy()
        self._old = field._replace(cells=field.cells.copy(), frame=field.frame.copy())
        self._distances: Field | None = None

    def complete(self, field: Field, room: Room) -> Field:
        """Return ``field`` with that cycle's distances in every cell."""
        if self._distances is None:
            path, goal = np.empty_like(field.path), np.empty_like(field.goal)
            self._distances = self._old._replace(path=path, goal=goal)
            _complete(self._plan, self._distances, room)
        return field._replace(path=self._distances.path, goal=self._distances.goal)
