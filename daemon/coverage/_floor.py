"""Floor seen by the laser and driven on, as cells of the free floor."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.coverage._kernels import Cells, paint_footprints, paint_rays
from daemon.coverage._types import FloorArea, RoomArea
from daemon.trace import Motion, Trace
from grammars.grid import FREE, OccupancyGrid
from grammars.robot import Robot
from grammars.scene import Region, Scene
from grammars.values import Floats, Pose2, Ring
from templates.occupancy import occupancy_grid

RESOLUTION: Final = 0.1
"""Edge of a cell [m]."""
SCAN_PERIOD: Final = 1.0
"""Scans are taken this far apart [s]: a robot goes a fraction of the laser's range in between."""
STRIDE: Final = 0.05
"""The footprint is placed again after such a way [m], or after turning by 0.1 rad."""


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """Cells of the free floor that one run has seen and driven on, eight to a byte."""

    seen: npt.NDArray[np.uint8]
    driven: npt.NDArray[np.uint8]


@functools.lru_cache(maxsize=4)
def floor_grid(scene: Scene, laser_height: float) -> OccupancyGrid:
    """Return the floor of a scene without its objects, at the resolution of coverage."""
    return occupancy_grid(
        scene, resolution=RESOLUTION, laser_height=laser_height, margin=RESOLUTION
    )


def painted(grid: OccupancyGrid, trace: Trace) -> Painted:
    """Return what a recorded run has covered; needs its scans (``read_trace(scans=True)``)."""
    free = grid.cells == FREE
    return Painted(*(np.packbits(f(grid, trace) & free) for f in (_seen, _driven)))


def _seen(grid: OccupancyGrid, trace: Trace) -> Cells:
    cells: Cells = np.zeros(grid.cells.shape, np.bool_)
    if trace.scans is None or not len(trace.scans.time) or not len(trace.ground_truth.time):
        return cells
    laser = trace.spec.robot.laser
    taken = _apart(trace.scans.time, SCAN_PERIOD)
    poses = _mounted(poses_at(trace.ground_truth, trace.scans.time[taken]), laser.mount)
    ranges = np.ascontiguousarray(trace.scans.ranges[taken])
    step = (laser.angle_max - laser.angle_min) / max(1, laser.rays - 1)
    paint_rays(
        cells, grid.x, grid.y, grid.resolution, poses, ranges,
        laser.angle_min, step, laser.range_max,
    )  # fmt: skip
    return cells


def _driven(grid: OccupancyGrid, trace: Trace) -> Cells:
    cells: Cells = np.zeros(grid.cells.shape, np.bool_)
    truth = trace.ground_truth
    poses = np.column_stack((truth.x, truth.y, truth.yaw))
    poses = np.ascontiguousarray(poses[_strides(poses)])
    ring = counter_clockwise(trace.spec.robot)
    reach = float(np.hypot(ring[:, 0], ring[:, 1]).max())
    paint_footprints(cells, grid.x, grid.y, grid.resolution, poses, ring, reach)
    return cells


def counter_clockwise(robot: Robot) -> Floats:
    """Return the footprint's corners (m, 2), counter-clockwise."""
    ring = np.array(robot.footprint, dtype=np.float64)
    following = np.roll(ring, -1, axis=0)
    area = float((ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]).sum())
    return ring if area > 0.0 else np.ascontiguousarray(ring[::-1])


def poses_at(motion: Motion, time: Floats) -> Floats:
    """Return true poses (n, 3) at ``time`` (n,), interpolated; held beyond both ends."""
    x, y = (np.interp(time, motion.time, values) for values in (motion.x, motion.y))
    yaw = np.interp(time, motion.time, np.unwrap(motion.yaw))
    return np.column_stack((x, y, yaw))


def _mounted(poses: Floats, mount: Pose2) -> Floats:
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * mount.x - s * mount.y
    y = poses[:, 1] + s * mount.x + c * mount.y
    return np.column_stack((x, y, poses[:, 2] + mount.yaw))


def _apart(time: Floats, period: float) -> npt.NDArray[np.intp]:
    """Return the first sample of each ``period``."""
    slots = np.floor((time - time[0]) / period + 1e-6)
    return np.unique(slots, return_index=True)[1]


def _strides(poses: Floats) -> npt.NDArray[np.intp]:
    """Return the first pose after each stride of way or turn, and the last one."""
    if not len(poses):
        return np.empty(0, np.intp)
    way = np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T)
    turn = np.abs(np.diff(np.unwrap(poses[:, 2]), prepend=poses[0, 2]))
    slots = np.floor(np.cumsum(way) / STRIDE + np.cumsum(turn) / 0.1)
    first = np.unique(slots, return_index=True)[1]
    return np.union1d(first, [len(poses) - 1]).astype(np.intp)


def floor_area(scene: Scene, grid: OccupancyGrid, runs: Sequence[Painted]) -> FloorArea:
    """Return the areas that any of the runs of one scene has covered."""
    free = grid.cells == FREE
    seen = _unpacked([run.seen for run in runs], grid)
    driven = _unpacked([run.driven for run in runs], grid)
    rooms = ((region.name, room_cells(grid, region)) for region in scene.regions)
    return FloorArea(
        scene=scene.name,
        resolution=grid.resolution,
        runs=len(runs),
        free=_area(free, grid),
        seen=_area(seen, grid),
        driven=_area(driven, grid),
        rooms=tuple(
            RoomArea(name, *(_area(cells & room, grid) for cells in (free, seen, driven)))
            for name, room in rooms
        ),
    )


def _unpacked(packed: Sequence[npt.NDArray[np.uint8]], grid: OccupancyGrid) -> Cells:
    """Return the cells that are set in any of the runs."""
    cells = grid.cells
    bits = np.unpackbits(np.bitwise_or.reduce(packed), count=cells.size)
    return bits.reshape(cells.shape).astype(np.bool_)


def _area(cells: Cells, grid: OccupancyGrid) -> float:
    return round(float(cells.sum()) * grid.resolution**2, 6)


def room_cells(grid: OccupancyGrid, region: Region) -> Cells:
    """Return the cells whose centre lies in a region, by crossings of a line with its outline."""
    rows, columns = grid.cells.shape
    x: Floats = np.arange(0.5, columns) * grid.resolution + grid.x
    y: Floats = np.arange(0.5, rows) * grid.resolution + grid.y
    return _inside(region.outline, x, y)


def _inside(ring: Ring, x: Floats, y: Floats) -> Cells:
    found: Cells = np.zeros((len(y), len(x)), np.bool_)
    for (ax, ay), (bx, by) in zip(ring, (*ring[1:], *ring[:1]), strict=True):
        crossed = (ay > y) != (by > y)
        slope = (bx - ax) / (by - ay) if ay != by else 0.0
        left_of = x[None, :] < (ax + (y[crossed] - ay) * slope)[:, None]
        found[crossed] ^= left_of
    return found
