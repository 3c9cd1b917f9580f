"""Runs every kernel of the room once, with the argument types a run uses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from daemon.navigation.ros.amcl._amcl import Amcl
from daemon.navigation.ros.amcl._parameters import AmclParameters
from daemon.navigation.ros.quirks import ORIGINAL
from grammars.grid import FREE, OCCUPIED, OccupancyGrid
from grammars.robot import Laser
from grammars.values import Pose2


def warm_up() -> None:
    """Update a few small filters with a scan of nothing but walls, then of nothing at all."""
    cells = np.full((20, 20), FREE, dtype=np.int8)
    cells[0], cells[-1] = OCCUPIED, OCCUPIED
    grid = OccupancyGrid(0.1, 0.0, 0.0, cells)
    laser = Laser(Pose2(), 0.3, -math.pi / 2, math.pi / 2, 7, 0.05, 5.0, 10.0, 0.01, 0.0)
    few = AmclParameters(min_particles=4, max_particles=8, resample_interval=1)
    omni = replace(few, odom_model_type="omni-corrected")
    for parameters in (few, omni, replace(few, laser_model_type="beam")):
        seed = np.random.SeedSequence(0)
        amcl = Amcl(parameters, ORIGINAL, grid, laser, Pose2(1.0, 1.0), seed)
        for k, r in enumerate((0.8, math.inf)):
            amcl.scan(0.1 * k, np.full(7, r, dtype=np.float32), Pose2(0.3 * k))
