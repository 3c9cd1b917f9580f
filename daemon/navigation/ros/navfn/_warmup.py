"""Runs every kernel of the room once, with the argument types a run uses."""

from __future__ import annotations

import numpy as np

from daemon.navigation.ros.grids import CostGrid
from daemon.navigation.ros.navfn._field import Field
from daemon.navigation.ros.navfn._parameters import NavfnParameters
from daemon.navigation.ros.navfn._planner import Navfn
from daemon.navigation.ros.quirks import ORIGINAL
from grammars.values import Pose2


def warm_up() -> None:
    """Plan across a small costmap, whole and restricted, while its costs change."""
    # So large that the limit of cycles, which grows with it, leaves room for a restricted wave.
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((80, 80), dtype=np.uint8))
    field = Field(grid, allow_unknown=True, worthwhile=1)
    for step in range(4):
        grid.cells[15, 15] = 254 - step
        grid.touch((15, 15, 16, 16))
        field.path(1600 + step, 1610)
    Navfn(NavfnParameters(), ORIGINAL).plan(grid, Pose2(0.2, 0.2), Pose2(1.2, 0.7))
