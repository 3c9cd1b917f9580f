"""costmap_2d of ROS Noetic: layers of the map, of laser scans and of inflation in one grid.

This package exports parameters and scans. The costmap itself, with its kernels, is in
:mod:`.costmap`, so that checking parameters loads no compiler.
"""

from daemon.stacks.ros1.costmap._observations import SensedScan, hears_height, point_height
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    VoxelLayer,
    radii,
)

__all__ = [
    "InflationLayer",
    "LayeredCostmap",
    "ObservationSource",
    "ObstacleLayer",
    "SensedScan",
    "StaticLayer",
    "VoxelLayer",
    "hears_height",
    "point_height",
    "radii",
]
