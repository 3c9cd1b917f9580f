"""The static layer: the map, in a grid of its own cells or under a window that moves over it."""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import FREE_SPACE, LETHAL, NO_INFORMATION
from daemon.stacks.ros1.costmap._obstacle_layer import Cells, cell_value
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OCCUPIED
from grammars.model.grid import UNKNOWN as UNKNOWN_IN_MAP


def map_costs(cells: np.ndarray, *, track_unknown: bool) -> Cells:
    """Return flat costs of map cells: occupied is lethal, the rest free or, tracked, unknown."""
    costs = np.zeros(cells.shape, dtype=np.uint8)
    costs[cells == OCCUPIED] = LETHAL
    costs[cells == UNKNOWN_IN_MAP] = NO_INFORMATION if track_unknown else FREE_SPACE
    return costs.ravel()


def placed(frame_in_map: Pose2) -> Floats:
    """Return the transform (6,) to map for :func:`show_map`: two rows of x, y, offset.

    The rotation is worked out from a quaternion, as tf2 does, which rounds differently from sine
    and cosine; none leaves coordinates as they are.
    """
    z, w = math.sin(frame_in_map.yaw / 2.0), math.cos(frame_in_map.yaw / 2.0)
    twice = z * (2.0 / (z * z + w * w))
    c, s = 1.0 - z * twice, w * twice
    return np.array((c, -s, frame_in_map.x, s, c, frame_in_map.y))


@kernel
def show_map(
    master: Cells,
    shape: tuple[int, int],
    frame: Floats,
    window: Integers,
    costs: Cells,
    map_shape: tuple[int, int],
    map_frame: Floats,
    to_map: Floats,
    maximum: bool,
) -> None:
    """Write the map over the window of a master grid of another place, size or frame.

    Each cell takes the value of the map cell its centre lies in; off the map it stays. With
    ``maximum`` the greater of the two values counts, of which unknown is the greatest
    (``StaticLayer::updateCosts`` in a rolling window).
    """
    for r in range(window[1], window[3]):
        for c in range(window[0], window[2]):
            x, y = frame[0] + (c + 0.5) * frame[2], frame[1] + (r + 0.5) * frame[2]
            u = to_map[0] * x + to_map[1] * y + to_map[2]
            v = to_map[3] * x + to_map[4] * y + to_map[5]
            if u < map_frame[0] or v < map_frame[1]:
                continue
            i, j = int((u - map_frame[0]) / map_frame[2]), int((v - map_frame[1]) / map_frame[2])
            if i >= map_shape[1] or j >= map_shape[0]:
                continue
            cell = r * shape[1] + c
            value = cell_value(costs, j * map_shape[1] + i)
            master[cell] = max(value, cell_value(master, cell)) if maximum else value
