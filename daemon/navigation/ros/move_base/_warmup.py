"""Runs every kernel of the room once, with the argument types a run uses."""

from __future__ import annotations

import numpy as np

from daemon.navigation.ros.move_base._footprint import turn_is_free


def warm_up() -> None:
    """Turn a square on an empty costmap."""
    cells = np.zeros((20, 20), np.uint8)
    ring = np.array([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)])
    turn_is_free(cells, np.array((0.0, 0.0, 0.05)), ring, np.full(3, 0.5), 0.1, 0.017)
