"""costmap_2d of ROS Noetic: layers of the map, of laser scans and of inflation in one grid.

This package exports scans. Parameters are in :mod:`.layers`, the costmap with its kernels in
:mod:`.costmap`, so that checking parameters loads no compiler.
"""

from daemon.stacks.ros1.costmap._observations import SensedScan, point_height

__all__ = ["SensedScan", "point_height"]
