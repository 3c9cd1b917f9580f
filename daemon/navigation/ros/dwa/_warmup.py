"""Runs every kernel of the controller once, with the argument types a run uses."""

from __future__ import annotations

import numpy as np

from daemon.navigation.ros.dwa._dwa import Dwa
from daemon.navigation.ros.dwa._parameters import DwaParameters
from daemon.navigation.ros.grids import CostGrid
from daemon.navigation.ros.quirks import ORIGINAL
from grammars.values import Pose2, Twist2


def warm_up() -> None:
    """Take one step along a short plan, then turn at its end."""
    outline = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    dwa = Dwa(DwaParameters(), ORIGINAL, outline, 0.1)
    local = CostGrid(0.05, -1.5, -1.5, np.zeros((60, 60), dtype=np.uint8))
    dwa.set_plan(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 1.5]]))
    dwa.command(Pose2(), Twist2(), Pose2(), local)
    dwa.command(Pose2(1.0, 0.0, 0.0), Twist2(), Pose2(), local)
