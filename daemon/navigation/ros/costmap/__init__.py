"""costmap_2d of ROS Noetic: a static, an obstacle and an inflation layer in one master grid."""

from __future__ import annotations

from daemon.navigation.ros.costmap._costmap import Costmap
from daemon.navigation.ros.costmap._footprint import (
    footprint_of_radius,
    padded_footprint,
    radii,
)
from daemon.navigation.ros.costmap._parameters import (
    SOURCE_WITHOUT_EFFECT,
    WITHOUT_EFFECT,
    CostmapParameters,
    ObservationSource,
)
from daemon.navigation.ros.costmap._reading import read_costmap
from daemon.navigation.ros.costmap._scan import SensedScan

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


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.navigation.ros.costmap._warmup import warm_up as run

    run()
