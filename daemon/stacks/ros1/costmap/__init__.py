"""costmap_2d of ROS Noetic: layers of the map, of what lasers see and of inflation in one grid.

Parameters and how they are read; the costmap itself, with its kernels, is in :mod:`.costmap`, so
that checking parameters loads no compiler.
"""

from daemon.stacks.ros1.costmap._footprint import footprint_of_radius, padded_footprint, radii
from daemon.stacks.ros1.costmap._layer_reading import CostmapContext
from daemon.stacks.ros1.costmap._layers import (
    InflationLayer,
    Layer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    VoxelColumn,
)
from daemon.stacks.ros1.costmap._namespaces import ParameterNamespace
from daemon.stacks.ros1.costmap._observations import SensedScan, hears_height, point_height
from daemon.stacks.ros1.costmap._reading import read_costmap
from daemon.stacks.ros1.costmap._sections import WRITTEN_SECTIONS

__all__ = [
    "WRITTEN_SECTIONS",
    "CostmapContext",
    "InflationLayer",
    "Layer",
    "LayeredCostmap",
    "ObservationSource",
    "ObstacleLayer",
    "ParameterNamespace",
    "SensedScan",
    "StaticLayer",
    "VoxelColumn",
    "footprint_of_radius",
    "hears_height",
    "padded_footprint",
    "point_height",
    "radii",
    "read_costmap",
    "warm_up",
]


def warm_up() -> None:
    """Update, clear and reset small costmaps of every sort."""
    from daemon.stacks.ros1.costmap import costmap

    costmap.warm_up()
