"""Whether a footprint can turn on the spot in a costmap."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.dwa import footprint_cost
from grammars.values import Floats


@kernel
def turn_is_free(
    cells: npt.NDArray[np.uint8],
    frame: Floats,
    footprint: Floats,
    pose: Floats,
    angle: float,
    granularity: float,
) -> bool:
    """Tell whether the outline of ``footprint`` (k, 2) stays free while it turns left by ``angle``.

    ``frame`` is x, y of the grid's lower left corner and its resolution [m], ``pose`` x, y, yaw.
    It is looked at every ``granularity`` [rad], at the end itself only by chance; what lies inside
    the outline does not count (rotate_recovery, ``CostmapModel::footprintCost``).
    """
    nothing = np.empty((0, 2), dtype=np.int32)
    here = np.empty(5)
    here[0], here[1] = pose[0], pose[1]
    turned = 0.0
    while turned < angle:
        here[2] = pose[2] + turned
        here[3], here[4] = math.cos(here[2]), math.sin(here[2])
        if footprint_cost(cells, frame, footprint, 1.0, here, nothing, False) < 0:
            return False
        turned += granularity
    return True
