"""Floor of a building: the cells that lasers have seen and that the footprint has covered."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from daemon.analysis.coverage._results import FloorArea, RoomArea
from daemon.analysis.coverage._rules import region_polygon
from daemon.model.kernels import kernel
from daemon.trace import MotionTrack, Trace
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import FREE, OccupancyGrid
from grammars.model.robot import Laser
from grammars.model.scene import Region, Scene
from templates.occupancy import occupancy_grid

_Cells: TypeAlias = npt.NDArray[np.bool_]
PackedCells: TypeAlias = npt.NDArray[np.uint8]
"""Cells of a grid, eight to a byte."""
RESOLUTION: Final = 0.1
"""Edge of a cell [m]: fine enough for a doorway, and a floor of 1000 m² is 100 000 cells."""
SCAN_PERIOD: Final = 1.0
"""Time between evaluated scans [s], in which a robot drives a fraction of the laser's range."""
STRIDE: Final = 0.05
"""The footprint is placed again after this way [m], or after turning by 0.1 rad."""


@functools.lru_cache(maxsize=4)
def floor_grid(scene: Scene, laser_height: float) -> OccupancyGrid:
    """Return the floor of a scene without its objects, at the resolution of coverage."""
    # Rule "touch": a cell that a wall partly covers is not floor.
    return occupancy_grid(
        scene, resolution=RESOLUTION, laser_height=laser_height, margin=RESOLUTION, rule="touch"
    )


def covered_cells(grid: OccupancyGrid, trace: Trace) -> tuple[PackedCells, PackedCells]:
    """Return the cells of the free floor that a recorded run has seen and driven on.

    Needs its scans (``read_trace(scans=True)``).
    """
    free = grid.cells == FREE
    visible, driven = (f(grid, trace) & free for f in (_visible_cells, _driven_cells))
    return np.packbits(visible), np.packbits(driven)


def _visible_cells(grid: OccupancyGrid, trace: Trace) -> _Cells:
    cells: _Cells = np.zeros(grid.cells.shape, np.bool_)
    if trace.scans is None or not len(trace.ground_truth.time):
        return cells
    for laser, scans in zip(trace.spec.robot.lasers, trace.scans, strict=True):
        if not len(scans.time):
            continue
        # 1e-6 covers stamps that are a rounding error below a whole number of periods.
        slots = np.floor((scans.time - scans.time[0]) / SCAN_PERIOD + 1e-6)
        first = np.unique(slots, return_index=True)[1]
        # The true pose gives the floor that was really seen, not the one the robot believed to see.
        poses = _laser_poses(trace.ground_truth, scans.time[first], laser.mount)
        cells |= ray_cells(grid, poses, scans.ranges[first], laser)
    return cells


def _laser_poses(motion: MotionTrack, time: Floats, mount: Pose2) -> Floats:
    """Return true poses (n, 3) of a laser at ``time`` (n,), interpolated; held at both ends."""
    # Unwrap the heading: halfway from 179 to -179 degrees is 180, not 0.
    tracks = (motion.x, motion.y, np.unwrap(motion.yaw))
    x, y, yaw = (np.interp(time, motion.time, track) for track in tracks)
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = x + c * mount.x - s * mount.y, y + s * mount.x + c * mount.y
    return np.column_stack((x, y, yaw + mount.yaw))


def ray_cells(
    grid: OccupancyGrid, poses: Floats, ranges: npt.NDArray[np.float32], laser: Laser
) -> _Cells:
    """Return the cells on rays, sampled at every half cell from the laser to the return.

    ``poses`` (n, 3) of the laser, ``ranges`` (n, rays) [m]. A ray without return (inf) reaches as
    far as the laser; a lost ray (nan) and one with a too near return (-inf) have no cells.
    """
    reach: Floats = np.minimum(ranges, laser.range_max, dtype=np.float64)
    scan, ray = np.nonzero(reach > 0.0)
    steps = (reach[scan, ray] / (0.5 * grid.resolution)).astype(np.intp) + 1
    angle = poses[scan, 2] + laser.angle_min + laser.angle_increment * ray
    rows, columns = grid.cells.shape
    # In cells, with a border of one cell for all spots outside the grid.
    start = (poses[scan, :2] - (grid.x, grid.y)) / grid.resolution + 1.0
    stride = 0.5 * np.column_stack((np.cos(angle), np.sin(angle)))
    passed: _Cells = np.zeros((rows + 2, columns + 2), np.bool_)
    mark_rays(passed, start, stride, steps)
    return passed[1:-1, 1:-1]


@kernel
def mark_rays(
    passed: _Cells, start: Floats, stride: Floats, steps: npt.NDArray[np.intp]
) -> None:  # fmt: skip
    """Mark the cells that rays pass, each from ``start`` (n, 2) by ``steps`` (n,) strides (n, 2).

    Coordinates are in cells, along x and y. A run has millions of spots: numpy takes five times as
    long.
    """
    last_row, last_column = passed.shape[0] - 1.0, passed.shape[1] - 1.0
    for ray in range(len(steps)):
        x, y, along_x, along_y = start[ray, 0], start[ray, 1], stride[ray, 0], stride[ray, 1]
        for step in range(steps[ray]):
            column = min(max(x + step * along_x, 0.0), last_column)
            row = min(max(y + step * along_y, 0.0), last_row)
            passed[int(row), int(column)] = True


def _driven_cells(grid: OccupancyGrid, trace: Trace) -> _Cells:
    """Return the cells whose centre the footprint covers at one of the poses."""
    truth = trace.ground_truth
    poses = np.column_stack((truth.x - grid.x, truth.y - grid.y, truth.yaw))
    x, y, yaw = poses[_strides(poses)].T[:, :, None, None]
    footprint = shapely.Polygon(trace.spec.robot.footprint)
    reach = math.ceil(np.hypot(*np.transpose(trace.spec.robot.footprint)).max() / grid.resolution)
    around = np.arange(-reach, reach + 1)
    column = (x // grid.resolution).astype(np.intp) + around[None, :]
    row = (y // grid.resolution).astype(np.intp) + around[:, None]
    # The centre of each cell as the robot sees it [m].
    along_x, along_y = (column + 0.5) * grid.resolution - x, (row + 0.5) * grid.resolution - y
    ahead = np.cos(yaw) * along_x + np.sin(yaw) * along_y
    aside = np.cos(yaw) * along_y - np.sin(yaw) * along_x
    covered: _Cells = np.zeros(grid.cells.shape, np.bool_)
    rows, columns = covered.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    inside &= shapely.intersects_xy(footprint, ahead, aside)
    row, column = np.broadcast_arrays(row, column)
    covered[row[inside], column[inside]] = True
    return covered


def _strides(poses: Floats) -> npt.NDArray[np.intp]:
    """Return the first pose after each stride of way or turn, and the last one."""
    if not len(poses):
        return np.empty(0, np.intp)
    way = np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T)
    turn = np.abs(np.diff(np.unwrap(poses[:, 2]), prepend=poses[0, 2]))
    slots = np.floor(np.cumsum(way) / STRIDE + np.cumsum(turn) / 0.1)
    first = np.unique(slots, return_index=True)[1]
    return np.union1d(first, [len(poses) - 1]).astype(np.intp)


def floor_area(
    scene: Scene, grid: OccupancyGrid, runs: Sequence[tuple[PackedCells, PackedCells]]
) -> FloorArea:
    """Return the areas that any run of a scene has seen and driven on."""
    free = grid.cells == FREE
    visible, driven = (_unpacked([run[i] for run in runs], grid) for i in (0, 1))
    rooms = ((region.name, room_cells(grid, region)) for region in scene.regions)
    return FloorArea(
        scene=scene.name,
        resolution=grid.resolution,
        runs=len(runs),
        free=_area(free, grid),
        seen=_area(visible, grid),
        driven=_area(driven, grid),
        rooms=tuple(
            RoomArea(name, *(_area(cells & room, grid) for cells in (free, visible, driven)))
            for name, room in rooms
        ),
    )


def _unpacked(packed: Sequence[PackedCells], grid: OccupancyGrid) -> _Cells:
    """Return the cells that are set in any of the runs."""
    cells = grid.cells
    bits = np.unpackbits(np.bitwise_or.reduce(packed), count=cells.size)
    return bits.reshape(cells.shape).astype(np.bool_)


def _area(cells: _Cells, grid: OccupancyGrid) -> float:
    # Round, since 0.1 ** 2 is not 0.01, and people and programs read areas.
    return round(float(cells.sum()) * grid.resolution**2, 6)


def room_cells(grid: OccupancyGrid, region: Region) -> _Cells:
    """Return the cells whose centre lies in a region."""
    rows, columns = grid.cells.shape
    x: Floats = np.arange(0.5, columns) * grid.resolution + grid.x
    y: Floats = np.arange(0.5, rows) * grid.resolution + grid.y
    polygon = region_polygon(region)
    west, south, east, north = polygon.bounds
    # A room is a small part of a large building, so test only its bounds.
    row = slice(*np.searchsorted(y, (south, north)))
    column = slice(*np.searchsorted(x, (west, east)))
    inside: _Cells = np.zeros(grid.cells.shape, np.bool_)
    inside[row, column] = shapely.intersects_xy(polygon, x[None, column], y[row, None])
    return inside
