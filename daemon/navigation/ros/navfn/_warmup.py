"""Runs every kernel of the room once, with the argument types a run uses."""

from __future__ import annotations

import numpy as np

from daemon.navigation.ros.grids import CostGrid
from daemon.navigation.ros.navfn._parameters import NavfnParameters
from daemon.navigation.ros.navfn._planner import Navfn
from daemon.navigation.ros.quirks import ORIGINAL
from grammars.values import Pose2


def warm_up() -> None:
    """Plan across a small empty costmap."""
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((20, 30), dtype=np.uint8))
    Navfn(NavfnParameters(), ORIGINAL).plan(grid, Pose2(0.2, 0.2), Pose2(1.2, 0.7))
