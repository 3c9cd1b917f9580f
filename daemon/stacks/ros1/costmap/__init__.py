"""costmap_2d of ROS Noetic: a static, an obstacle and an inflation layer in one master grid."""

from daemon.stacks.ros1.costmap._costmap import Costmap, warm_up
from daemon.stacks.ros1.costmap._footprint import footprint_of_radius, padded_footprint, radii
from daemon.stacks.ros1.costmap._obstacle_layer import SensedScan
from daemon.stacks.ros1.costmap._parameters import (
    SOURCE_WITHOUT_EFFECT,
    WITHOUT_EFFECT,
    CostmapParameters,
    ObservationSource,
    read_costmap,
)

__all__ = [
    "SOURCE_WITHOUT_EFFECT",
    "WITHOUT_EFFECT",
    "Costmap",
    "CostmapParameters",
    "ObservationSource",
    "SensedScan",
    "footprint_of_radius",
    "padded_footprint",
    "radii",
    "read_costmap",
    "warm_up",
]
