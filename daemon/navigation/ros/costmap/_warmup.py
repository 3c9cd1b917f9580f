"""Runs every kernel of the package once, with the argument types a run uses."""

from __future__ import annotations

import numpy as np

from daemon.navigation.ros.costmap._costmap import Costmap
from daemon.navigation.ros.costmap._parameters import CostmapParameters, ObservationSource
from daemon.navigation.ros.costmap._scan import SensedScan
from daemon.navigation.ros.quirks import ORIGINAL
from grammars.grid import OccupancyGrid
from grammars.values import Pose2


def warm_up() -> None:
    """Update, clear and reset a small global and a small local costmap."""
    source = ObservationSource(data_type="LaserScan", clearing=True)
    still = CostmapParameters(static_map=True, sources=(source,))
    moving = CostmapParameters(rolling_window=True, width=2.0, height=2.0, sources=(source,))
    cells = np.zeros((40, 40), dtype=np.int8)
    cells[30] = 100
    footprint = still.padded_footprint()
    scan = SensedScan(
        Pose2(1.0, 1.0), np.ones(3, dtype=np.float32), np.array([-0.1, 0.0, 0.1]), 0.05, 5.6
    )
    for costmap in (
        Costmap.global_(still, footprint, ORIGINAL, OccupancyGrid(0.05, 0.0, 0.0, cells)),
        Costmap.local(moving, footprint, ORIGINAL),
    ):
        for heard in (None, scan):
            costmap.update(Pose2(1.0, 1.0), heard)
        costmap.clear_square(Pose2(1.0, 1.0), 0.2)
        costmap.update(Pose2(1.0, 1.0), scan)
        costmap.clear_obstacles_outside(Pose2(1.0, 1.0), 0.5)
        costmap.update(Pose2(1.0, 1.0), scan)
