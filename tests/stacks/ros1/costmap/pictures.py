"""Small costmaps drawn with characters: cells of one metre, the lowest row at the bottom."""

import math
from dataclasses import fields, replace

import numpy as np

from daemon.stacks.ros1.costmap import (
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    SensedScan,
    VoxelLayer,
)
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2

SIGNS = {255: "?", 0: ".", 254: "#"}
SMALL = ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1))
SOURCE = ObservationSource("scan", "/scan", clearing=True, obstacle_range=0.0, raytrace_range=50.0)
"""Clears as far as it sees and marks nothing."""
HERE = Pose2()
"""Where the robot is does not matter to a grid that stands still and frees no footprint."""


def build(
    columns,
    rows,
    *,
    origin=(0.0, 0.0),
    rolling=False,
    unknown=True,
    layer_unknown=True,
    under=None,
    **source,
):
    """Return a costmap of one obstacle layer that is told what nobody has looked at.

    ``under`` is the footprint that is cleared, none where it is not given.
    """
    layer = ObstacleLayer(
        sources=(replace(SOURCE, **source),),
        footprint_clearing_enabled=under is not None,
        track_unknown_space=layer_unknown,
    )
    parameters = LayeredCostmap(
        (layer,), "odom" if rolling else "map", rolling_window=rolling, resolution=1.0,
        width=float(columns), height=float(rows), origin_x=origin[0], origin_y=origin[1],
        track_unknown_space=unknown,
    )  # fmt: skip
    return Costmap(parameters, np.array(under or SMALL, dtype=float), FAST)


def with_voxels(layer, **column):
    """Return an obstacle layer as a voxel layer."""
    return VoxelLayer(**{f.name: getattr(layer, f.name) for f in fields(layer)}, **column)


def rays(begin, *ends, yaw=0.0, nearest=0.05, farthest=60.0):
    """Return a scan of rays from ``begin`` to each of ``ends``; the laser looks to ``yaw``."""
    ways = [(x - begin[0], y - begin[1]) for x, y in ends]
    ranges = np.array([math.hypot(x, y) for x, y in ways], dtype=np.float32)
    angles = np.array([math.atan2(y, x) - yaw for x, y in ways])
    return SensedScan(Pose2(*begin, yaw), ranges, angles, nearest, farthest)


def drawn(costmap):
    """Return the rows of the grid, the highest first."""
    return ["".join(SIGNS[int(cell)] for cell in row) for row in costmap.grid.cells[::-1]]


def free(costmap):
    """Return the cells (column, row) that are free."""
    return {(int(x), int(y)) for y, x in np.argwhere(costmap.grid.cells == 0)}


def marked(costmap):
    """Return the cells (column, row) that are lethal."""
    return {(int(x), int(y)) for y, x in np.argwhere(costmap.grid.cells == 254)}
