"""What of the building was covered: doors that moved and were met, floor seen and driven on."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.analysis.coverage._results import DoorCount, FloorArea, RoomArea
from daemon.analysis.coverage._rules import MOVED, RunFacts, articulated_objects
from daemon.model.kernels import kernel
from daemon.trace import MotionTrack, Trace
from grammars.model.behaviour import Hold, JointEvent, joint_event
from grammars.model.geometry import Floats, Point2, Pose2, Ring
from grammars.model.grid import FREE, OccupancyGrid
from grammars.model.movers import own_joints
from grammars.model.robot import Robot
from grammars.model.scene import Region, Scene, SceneObject
from templates.occupancy import occupancy_grid


@dataclass(frozen=True, slots=True)
class DoorRun:
    """What happened to an object in one recorded run; ``nearest`` [m], infinite without poses."""

    door: str
    planned: bool
    moved: bool
    triggered: bool
    nearest: float


def door_runs(facts: RunFacts, trace: Trace) -> tuple[DoorRun, ...]:
    """Return what a recorded run did to each articulated object of its scene."""
    moving = {b.joint for b in facts.spec.behaviours if not isinstance(b, Hold)}
    by_robot = (JointEvent.TRIGGERED, JointEvent.REACTS)
    acted = {e.source for e in trace.events if joint_event(e.text) in by_robot}
    found = []
    for door in articulated_objects(trace.scene):
        joints = {f"{door.name}.{joint.name}" for joint in own_joints(door.joints)}
        found.append(
            DoorRun(
                door.name,
                bool(joints & moving),
                _has_moved(trace, joints),
                bool(joints & acted),
                _nearest_distance(trace, door),
            )
        )
    return tuple(found)


def _has_moved(trace: Trace, joints: set[str]) -> bool:
    columns = [i for i, name in enumerate(trace.joints.names) if name in joints]
    # From where it started, not from the last sample: a slow door moves little between two.
    position = trace.joints.position[:, columns]
    return bool(position.size and (np.abs(position - position[0]) > MOVED).any())


def _nearest_distance(trace: Trace, door: SceneObject) -> float:
    truth = trace.ground_truth
    ways = [np.hypot(truth.x - x, truth.y - y) for x, y in meeting_points(door)]
    return min((float(way.min()) for way in ways if len(way)), default=float("inf"))


def meeting_points(door: SceneObject) -> tuple[Point2, ...]:
    """Return where a door is met: at its hinges as placed, or at its origin if it has none."""
    hinges = [j for j in own_joints(door.joints) if j.kind == "revolute"]
    anchors = [door.pose.apply(joint.anchor) for joint in hinges]
    return tuple(anchors) or ((door.pose.x, door.pose.y),)


def door_counts(scene: str, runs: Sequence[tuple[DoorRun, ...]], near: float) -> list[DoorCount]:
    """Sum up the doors of one scene over its recorded ``runs``; met is within ``near`` [m]."""
    found = []
    for one in zip(*runs, strict=True):
        nearest = min(run.nearest for run in one)
        found.append(
            DoorCount(
                scene=scene,
                door=one[0].door,
                runs=len(one),
                planned=sum(run.planned for run in one),
                moved=sum(run.moved for run in one),
                triggered=sum(run.triggered for run in one),
                met=sum(run.nearest <= near for run in one),
                nearest=nearest if np.isfinite(nearest) else None,
            )
        )
    return found


_Cells: TypeAlias = npt.NDArray[np.bool_]
_Ranges: TypeAlias = npt.NDArray[np.float32]
RESOLUTION: Final = 0.1
"""Edge of a cell [m]: fine enough for a doorway, and a floor of 1000 m² is 100 000 cells."""
SCAN_PERIOD: Final = 1.0
"""Scans are taken this far apart [s]: a robot goes a fraction of the laser's range in between."""
STRIDE: Final = 0.05
"""The footprint is placed again after such a way [m], or after turning by 0.1 rad."""


@dataclass(frozen=True, slots=True, eq=False)
class CoveredCells:
    """Cells of the free floor that one run has seen and driven on, eight to a byte."""

    seen: npt.NDArray[np.uint8]
    driven: npt.NDArray[np.uint8]


@functools.lru_cache(maxsize=4)
def floor_grid(scene: Scene, laser_height: float) -> OccupancyGrid:
    """Return the floor of a scene without its objects, at the resolution of coverage."""
    # By touch: no cell counts as floor that a wall takes a part of.
    return occupancy_grid(
        scene, resolution=RESOLUTION, laser_height=laser_height, margin=RESOLUTION, rule="touch"
    )


def covered_cells(grid: OccupancyGrid, trace: Trace) -> CoveredCells:
    """Return what a recorded run has covered; needs its scans (``read_trace(scans=True)``)."""
    free = grid.cells == FREE
    return CoveredCells(*(np.packbits(f(grid, trace) & free) for f in (_seen_cells, _driven_cells)))


def _seen_cells(grid: OccupancyGrid, trace: Trace) -> _Cells:
    cells: _Cells = np.zeros(grid.cells.shape, np.bool_)
    if trace.scans is None or not len(trace.ground_truth.time):
        return cells
    for laser, scans in zip(trace.spec.robot.lasers, trace.scans, strict=True):
        if not len(scans.time):
            continue
        # By the true pose: what was seen, not what the robot believed to see.
        taken = _first_samples(scans.time, SCAN_PERIOD)
        poses = _mounted_poses(poses_at(trace.ground_truth, scans.time[taken]), laser.mount)
        paint_rays(
            cells, grid.x, grid.y, grid.resolution, poses,
            np.ascontiguousarray(scans.ranges[taken]),
            laser.angle_min, laser.angle_increment, laser.range_max,
        )  # fmt: skip
    return cells


def _driven_cells(grid: OccupancyGrid, trace: Trace) -> _Cells:
    cells: _Cells = np.zeros(grid.cells.shape, np.bool_)
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


def poses_at(motion: MotionTrack, time: Floats) -> Floats:
    """Return true poses (n, 3) at ``time`` (n,), interpolated; held beyond both ends."""
    # The heading unwrapped: halfway from 179 to -179 degrees is 180, not 0.
    x, y = (np.interp(time, motion.time, values) for values in (motion.x, motion.y))
    yaw = np.interp(time, motion.time, np.unwrap(motion.yaw))
    return np.column_stack((x, y, yaw))


def _mounted_poses(poses: Floats, mount: Pose2) -> Floats:
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * mount.x - s * mount.y
    y = poses[:, 1] + s * mount.x + c * mount.y
    return np.column_stack((x, y, poses[:, 2] + mount.yaw))


def _first_samples(time: Floats, period: float) -> npt.NDArray[np.intp]:
    """Return the first sample of each ``period``."""
    # 1e-6: a stamp that should be a whole number of periods may be a rounding error below it.
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


def floor_area(scene: Scene, grid: OccupancyGrid, runs: Sequence[CoveredCells]) -> FloorArea:
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


def _unpacked(packed: Sequence[npt.NDArray[np.uint8]], grid: OccupancyGrid) -> _Cells:
    """Return the cells that are set in any of the runs."""
    cells = grid.cells
    bits = np.unpackbits(np.bitwise_or.reduce(packed), count=cells.size)
    return bits.reshape(cells.shape).astype(np.bool_)


def _area(cells: _Cells, grid: OccupancyGrid) -> float:
    # Rounded, since 0.1 ** 2 is not 0.01: areas are read by people and compared by machines.
    return round(float(cells.sum()) * grid.resolution**2, 6)


def room_cells(grid: OccupancyGrid, region: Region) -> _Cells:
    """Return the cells whose centre lies in a region, by crossings of a line with its outline."""
    rows, columns = grid.cells.shape
    x: Floats = np.arange(0.5, columns) * grid.resolution + grid.x
    y: Floats = np.arange(0.5, rows) * grid.resolution + grid.y
    inside = _cells_inside(region.outline, x, y)
    for hole in region.holes:
        inside &= ~_cells_inside(hole, x, y)
    return inside


def _cells_inside(ring: Ring, x: Floats, y: Floats) -> _Cells:
    found: _Cells = np.zeros((len(y), len(x)), np.bool_)
    for (ax, ay), (bx, by) in zip(ring, (*ring[1:], *ring[:1]), strict=True):
        crossed = (ay > y) != (by > y)
        slope = (bx - ax) / (by - ay) if ay != by else 0.0
        left_of = x[None, :] < (ax + (y[crossed] - ay) * slope)[:, None]
        found[crossed] ^= left_of
    return found


@kernel
def paint_rays(
    cells: _Cells, x0: float, y0: float, resolution: float, poses: Floats, ranges: _Ranges,
    angle_min: float, step: float, range_max: float,
) -> None:  # fmt: skip
    """Mark the cells that rays pass: those at every half a cell from the laser to the return.

    ``poses`` (n, 3) of the laser, ``ranges`` (n, rays). No return (inf) is a look as far as
    ``range_max``; a lost ray (nan) and one that met something too near (-inf) see nothing.
    """
    rows, columns = cells.shape
    flat, width = cells.reshape(-1), float(columns)
    longest = 0.0
    for i in range(len(poses)):
        for k in range(ranges.shape[1]):
            reach = min(float(ranges[i, k]), range_max)
            if reach > longest:  # a lost ray is not
                longest = reach
    # Marched, not traversed cell by cell: half a cell a step misses only cells that a ray crosses
    # at a corner, and the loop has no branches that depend on the direction.
    along = np.empty(int(longest / (0.5 * resolution)) + 1)
    for j in range(len(along)):
        along[j] = 0.5 * j * resolution
    passed = np.empty(len(along))
    for i in range(len(poses)):
        x, y, yaw = poses[i, 0] - x0, poses[i, 1] - y0, poses[i, 2]
        for k in range(ranges.shape[1]):
            reach = min(float(ranges[i, k]), range_max)
            if not reach > 0.0:
                continue
            angle = yaw + angle_min + k * step
            dx, dy = math.cos(angle), math.sin(angle)
            count = int(reach / (0.5 * resolution)) + 1
            far_x, far_y = x + along[count - 1] * dx, y + along[count - 1] * dy
            if (
                min(x, far_x) > resolution
                and max(x, far_x) < (columns - 1) * resolution
                and min(y, far_y) > resolution
                and max(y, far_y) < (rows - 1) * resolution
            ):
                # Inside of the grid with a cell to spare, as nearly always. Numbers of cells as
                # floats, by themselves: such a loop becomes vector instructions, which halves it.
                for j in range(count):
                    row = np.floor((y + along[j] * dy) / resolution)
                    passed[j] = row * width + np.floor((x + along[j] * dx) / resolution)
                for j in range(count):
                    flat[np.uint32(passed[j])] = True
                continue
            for j in range(count):
                at_column = math.floor((x + along[j] * dx) / resolution)
                at_row = math.floor((y + along[j] * dy) / resolution)
                if 0 <= at_row < rows and 0 <= at_column < columns:
                    cells[at_row, at_column] = True


@kernel
def paint_footprints(
    cells: _Cells, x0: float, y0: float, resolution: float, poses: Floats, ring: Floats,
    reach: float,
) -> None:  # fmt: skip
    """Mark the cells whose centre a convex ``ring`` (m, 2), counter-clockwise, covers at a pose.

    ``reach`` is the distance of its farthest corner from the base.
    """
    rows, columns = cells.shape
    corners = len(ring)
    for i in range(len(poses)):
        x, y = poses[i, 0] - x0, poses[i, 1] - y0
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        bottom = max(0, math.floor((y - reach) / resolution))
        top = min(rows - 1, math.floor((y + reach) / resolution))
        left = max(0, math.floor((x - reach) / resolution))
        right = min(columns - 1, math.floor((x + reach) / resolution))
        for row in range(bottom, top + 1):
            for column in range(left, right + 1):
                if cells[row, column]:
                    continue
                u, v = (column + 0.5) * resolution - x, (row + 0.5) * resolution - y
                px, py = c * u + s * v, c * v - s * u
                covered = True
                for k in range(corners):
                    ax, ay = ring[k, 0], ring[k, 1]
                    bx, by = ring[(k + 1) % corners, 0], ring[(k + 1) % corners, 1]
                    if (bx - ax) * (py - ay) - (by - ay) * (px - ax) < 0.0:
                        covered = False
                        break
                if covered:
                    cells[row, column] = True
