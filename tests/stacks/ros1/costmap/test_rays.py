"""Which cells a scan clears and marks, one by one.

What is expected was followed on paper through the published costmap_2d (Noetic): the clipping in
``ObstacleLayer::raytraceFreespace``, the lines in ``Costmap2D::raytraceLine`` and ``bresenham2D``,
marking in ``ObstacleLayer::updateBounds``, the polygon in ``Costmap2D::convexFillCells``.
``rays.txt`` has scans (where the laser is, and where each ray ends) on cells of one metre, so that
a cell is the whole part of a coordinate, and what the costmap shows then: free, lethal, unknown.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from daemon.stacks.ros1.costmap import SensedScan
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.costmap.layers import LayeredCostmap, ObservationSource, ObstacleLayer
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2
from grammars.model.grid import OccupancyGrid
from tests.stacks.cases import cases, written

RAYS = Path(__file__).with_name("rays.txt")
SIGNS = {255: "?", 0: ".", 254: "#"}
SMALL = ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1))
SOURCE = ObservationSource("scan", "/scan", clearing=True, obstacle_range=0.0, raytrace_range=50.0)
"""Clears as far as it sees and marks nothing."""


def build(size=(12, 8), origin=(0.0, 0.0), under=None, **source):
    """Return a costmap of one layer; ``under`` is the footprint that is cleared, if any."""
    layer = ObstacleLayer(
        sources=(replace(SOURCE, **source),),
        footprint_clearing_enabled=under is not None,
        track_unknown_space=True,
    )
    parameters = LayeredCostmap(
        (layer,), "map", resolution=1.0, width=float(size[0]), height=float(size[1]),
        origin_x=float(origin[0]), origin_y=float(origin[1]), track_unknown_space=True,
    )  # fmt: skip
    nothing = OccupancyGrid(1.0, 0.0, 0.0, np.zeros((1, 1), dtype=np.int8))
    outline = np.array(under or SMALL, dtype=float)
    return Costmap(parameters, outline, FAST, nothing, lambda topic: ("",))


def scan_of(begin, ends, yaw=0.0, limits=(0.05, 60.0)):
    """Return a scan of rays from ``begin`` to each of ``ends``; the laser looks to ``yaw``."""
    ways = [(x - begin[0], y - begin[1]) for x, y in ends]
    ranges = np.array([math.hypot(x, y) for x, y in ways], dtype=np.float32)
    angles = np.array([math.atan2(y, x) - yaw for x, y in ways])
    return SensedScan(Pose2(*begin, yaw), ranges, angles, *limits)


def drawn(scans, origin=(0, 0), source=(), size=(12, 8), under=None, **laser):
    """Return the rows of the grid after some scans, the highest first."""
    costmap = build(size, origin, under, **dict(source))
    for points in scans or [[]]:
        begin, *ends = [(origin[0] + x, origin[1] + y) for x, y in points] or [None]
        costmap.update(Pose2(*origin), (scan_of(begin, ends, **laser),) if begin else ())
    return ["".join(SIGNS[int(cell)] for cell in row) for row in costmap.grid.cells[::-1]]


def test_cells_are_those_of_the_original(golden):
    told = []
    for name, lines in cases(RAYS):
        told += written((name, lines), drawn(**yaml.safe_load("\n".join(lines))))
    golden(RAYS.name, "\n".join(told) + "\n")


def test_points_are_moved_in_single_precision():
    """A point that rounds into another cell on its way (``doTransform`` of tf2_sensor_msgs).

    At 50 m a number of single precision is 3.8 um large. The laser stands at y = 50 + 1.7 um,
    which is 50 in single precision, and looks along y: 3.0000002 more makes 53.0000002, which is
    53. In double the sum is 53.0000019, which rounds to the next number, 53.0000038. With an edge
    of cells at 53.000002 that is one cell or the next.
    """
    scan = replace(
        scan_of((50.5, 50.0000017), [(50.5, 53.0)]),
        ranges=np.array([3.0000002], dtype=np.float32),
        angles=np.array([math.pi / 2]),
    )
    assert np.float32(50.0000017) == 50.0
    assert float(np.float32(50.0000017 + float(scan.ranges[0]))) > 53.000002
    costmap = build((2, 8), (50.0, 48.000002), obstacle_range=9.0)
    costmap.update(Pose2(), (scan,))
    assert costmap.grid.cells[:, 0].tolist() == [255, 0, 0, 0, 254, 255, 255, 255]
