"""Allocates what the kernels work in."""

from __future__ import annotations

import numpy as np

from daemon.navigation.kernels import Integers
from daemon.navigation.ros.dwa._decide import Room
from daemon.navigation.ros.dwa._distances import empty_set, everywhere_fit
from daemon.navigation.ros.dwa._score import Field
from daemon.navigation.ros.dwa._settings import Settings
from daemon.navigation.ros.grids import CostGrid
from grammars.values import Floats


def build_field(local: CostGrid, outline: Floats, banned: Integers) -> Field:
    """Return the field of a costmap; cells and ``banned`` are shared with their owners."""
    rows = local.cells.shape[0]
    return Field(
        cells=local.cells,
        frame=np.array((local.x, local.y, local.resolution)),
        outline=outline,
        path=everywhere_fit(local.cells.shape),
        goal=everywhere_fit(local.cells.shape),
        front=everywhere_fit(local.cells.shape),
        banned=banned,
        spans=np.zeros((rows, 2), dtype=np.int32),
    )


def build_room(shape: tuple[int, ...], settings: Settings, longest: int) -> Room:
    """Return room for a costmap of ``shape`` and trajectories of up to ``longest`` points."""
    numbers = [max(2, n) + 1 for n in (settings.x_samples, settings.y_samples)]
    numbers.append(max(2, settings.theta_samples) + 1)
    return Room(
        seeds=empty_set(shape),
        passable=empty_set(shape),
        wanted=empty_set(shape),
        fronts=np.array([empty_set(shape), empty_set(shape)]),
        speeds=np.zeros((3, 2)),
        samples=np.zeros((3, max(numbers))),
        counts=np.zeros(3, dtype=np.int32),
        pairs=np.zeros((numbers[0] * numbers[1], 4)),
        weights=np.zeros(6),
        ends=np.zeros((int(np.prod(numbers)), 2), dtype=np.int32),
        known=np.zeros((3, shape[0] * shape[1]), dtype=np.int32),
        digits=np.zeros(3, dtype=np.int32),
        lower=np.zeros(int(np.prod(numbers))),
        arcs=np.zeros((longest, 5)),
        points=np.zeros((longest, 5)),
        moving=np.zeros(3),
        answer=np.zeros(5),
    )
