"""The grid distances of a past sampling cycle, for commands that are only checked."""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.dwa._decide import Room
from daemon.navigation.ros.dwa._distances import open_cells, spread_out
from daemon.navigation.ros.dwa._plan import walk
from daemon.navigation.ros.dwa._search import Field
from grammars.values import Floats


@kernel
def _complete(plan: Floats, old: Field, r: Room) -> None:
    rows, columns = old.cells.shape
    passable = np.empty_like(r.passable)
    open_cells(old.cells, passable)
    r.box[0], r.box[1], r.box[2], r.box[3] = 0, 0, columns, rows
    last = walk(plan, plan.shape[0], plan[plan.shape[0] - 1], old.cells, old.frame, r.seeds)
    spread_out(r.seeds, passable, r.box, old.path, r.buffers)
    r.seeds[:] = np.uint64(0)
    if last >= 0:
        column = last % columns
        r.seeds[last // columns, column >> 6] = np.uint64(1) << np.uint64(column & 63)
    spread_out(r.seeds, passable, r.box, old.goal, r.buffers)


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
