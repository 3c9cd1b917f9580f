"""Static layer: the map as a grid of its own, or under a moving window."""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.ros1.cost_grid import LETHAL, NO_INFORMATION, Window
from daemon.stacks.ros1.costmap._grids import Frame, Grid, cell_at, cell_value
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OCCUPIED, OccupancyGrid
from grammars.model.grid import UNKNOWN as UNKNOWN_IN_MAP


def map_grid(world: OccupancyGrid, *, track_unknown: bool) -> Grid:
    """Return the costs of a map: lethal, free, and with ``track_unknown`` unknown."""
    costs = np.zeros(world.cells.shape, dtype=np.uint8)
    costs[world.cells == OCCUPIED] = LETHAL
    if track_unknown:
        costs[world.cells == UNKNOWN_IN_MAP] = NO_INFORMATION
    rows, columns = world.cells.shape
    return Grid(costs.ravel(), Frame(rows, columns, world.x, world.y, world.resolution))


def placed(frame_in_map: Pose2) -> Floats:
    """Return the transform (6,) to map for :func:`show_map`: two rows of x, y, offset.

    The rotation comes from a quaternion, as in tf2, which rounds differently from sine and cosine.
    The identity leaves coordinates unchanged.
    """
    z, w = math.sin(frame_in_map.yaw / 2.0), math.cos(frame_in_map.yaw / 2.0)
    twice = z * (2.0 / (z * z + w * w))
    c, s = 1.0 - z * twice, w * twice
    return np.array((c, -s, frame_in_map.x, s, c, frame_in_map.y))


@kernel
def show_map(master: Grid, window: Window, world: Grid, to_map: Floats, maximum: bool) -> None:
    """Write the map ``world`` over the window of a master grid of another place, size or frame.

    Each cell takes the value of the map cell under its centre; off the map it stays. With
    ``maximum`` the greater value counts, and unknown is the greatest
    (``StaticLayer::updateCosts`` in a rolling window).
    """
    frame = master.frame
    for r in range(window[1], window[3]):
        for c in range(window[0], window[2]):
            x, y = (
                frame.x + (c + 0.5) * frame.resolution,
                frame.y + (r + 0.5) * frame.resolution,
            )
            column, row = cell_at(
                world.frame,
                to_map[0] * x + to_map[1] * y + to_map[2],
                to_map[3] * x + to_map[4] * y + to_map[5],
            )
            if column < 0:
                continue
            cell = r * frame.columns + c
            value = cell_value(world.cells, row * world.frame.columns + column)
            master.cells[cell] = max(value, cell_value(master.cells, cell)) if maximum else value
