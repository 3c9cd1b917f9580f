"""Allocates what the kernels work in."""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import Integers
from daemon.navigation.ros.dwa._decide import Room
from daemon.navigation.ros.dwa._search import Field
from daemon.navigation.ros.dwa._settings import Settings
from daemon.navigation.ros.grids import CostGrid
from grammars.values import Floats


def build_field(local: CostGrid, outline: Floats, banned: Integers) -> Field:
    """Return the field of a costmap; cells and ``banned`` are shared with their owners."""
    rows, columns = local.cells.shape
    return Field(
        cells=local.cells,
        frame=np.array((local.x, local.y, local.resolution)),
        outline=outline,
        path=np.zeros((rows, columns), dtype=np.int32),
        goal=np.zeros((rows, columns), dtype=np.int32),
        front=np.zeros((rows, columns), dtype=np.int32),
        banned=banned,
        spans=np.zeros((rows, 2), dtype=np.int32),
    )


def build_room(shape: tuple[int, ...], settings: Settings, longest: int) -> Room:
    """Return room for a costmap of ``shape`` and trajectories of up to ``longest`` points."""
    rows, columns = shape[0], shape[1]
    words = (columns + 63) // 64
    numbers = [max(2, n) + 1 for n in (settings.x_samples, settings.y_samples)]
    numbers.append(max(2, settings.theta_samples) + 1)
    return Room(
        seeds=np.zeros((rows, words), dtype=np.uint64),
        passable=np.zeros((rows, words), dtype=np.uint64),
        buffers=np.zeros((3, rows, words), dtype=np.uint64),
        box=np.zeros(4, dtype=np.int32),
        speeds=np.zeros((3, 2)),
        samples=np.zeros((3, max(numbers))),
        counts=np.zeros(3, dtype=np.int32),
        lower=np.zeros(int(np.prod(numbers))),
        arcs=np.zeros((longest, 5)),
        points=np.zeros((longest, 5)),
        moving=np.zeros(3),
        answer=np.zeros(5),
    )
