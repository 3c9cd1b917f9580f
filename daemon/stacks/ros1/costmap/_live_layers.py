"""Layers of a running costmap, with their state between two cycles.

In every cycle each layer, in its order, takes new data and extends the bounds of the cycle
(``updateBounds``). The costmap itself merges and inflates (:mod:`.costmap`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np

from daemon.model.kernels import kernel, machine_code
from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import LETHAL, NO_INFORMATION, Window
from daemon.stacks.ros1.costmap._grids import (
    Cells,
    Changes,
    Frame,
    Grid,
    cell_at,
    cell_value,
)
from daemon.stacks.ros1.costmap._inflation import InflationTable
from daemon.stacks.ros1.costmap._observations import (
    Hears,
    ObservedScan,
    SensedScan,
    observations,
)
from daemon.stacks.ros1.costmap._obstacle_layer import (
    LaserPose,
    clear_rays,
    free_footprint,
    mark,
    project,
)
from daemon.stacks.ros1.costmap._voxel_layer import (
    UNKNOWN_COLUMN,
    Columns,
    Voxels,
    clear_voxels,
    mark_voxels,
    voxels_of,
)
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    ObstacleLayer,
    StaticLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.costmap.master_grid import MAXIMUM, NOTHING, OVERWRITE, REPLACE
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OCCUPIED, OccupancyGrid

_NOWHERE: Final = np.array((1e30, 1e30, -1e30, -1e30))
"""Empty bounds [m] (costmap_2d uses the same numbers)."""
_FAR: Final = float(np.finfo(np.float32).max)
_EVERYWHERE: Final = (-_FAR, -_FAR, _FAR, _FAR)
"""Bounds of the whole map [m] (costmap_2d uses the same numbers)."""
_NO_LASER: Final = LaserPose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_NO_POINTS: Final = np.empty((0, 2), dtype=np.float32)


class Workspace:
    """Shared state of the layers of one costmap: the cycle's scans and the list of changes."""

    def __init__(self, size: int) -> None:
        """Prepare for grids of ``size`` cells."""
        self.changes = Changes(
            np.zeros(size, dtype=np.uint8),
            np.empty(size, dtype=np.int32),
            np.zeros(2, dtype=np.int64),
            np.empty(4),
        )
        self.base = Pose2()
        """Pose of the robot in the costmap's frame."""
        self.scans: Sequence[SensedScan] = ()
        self._directions: dict[str, tuple[Floats, Floats]] = {}
        self._project = machine_code(
            project, _NO_LASER, np.empty(0, np.float32), np.empty((0, 2)), False, _NO_POINTS
        )

    def begin(self, base: Pose2, scans: Sequence[SensedScan]) -> None:
        """Begin a cycle; raises ``ValueError`` for a scan without a range at each angle."""
        self.base, self.scans = base, scans
        self.changes.bounds[:] = _NOWHERE
        for scan in scans:
            if len(scan.ranges) != len(scan.angles):
                message = f"a scan has {len(scan.ranges)} ranges at {len(scan.angles)} angles"
                raise ValueError(message)

    def reaching(self, observation: ObservedScan) -> tuple[LaserPose, Singles]:
        """Return the laser and the end points (n, 2) [m] of its rays that reach the source."""
        scan, pose = observation.scan, observation.scan.pose
        laser = LaserPose(pose.x, pose.y, pose.yaw, scan.height, scan.range_min, scan.range_max)
        if not observation.has_points:
            return laser, _NO_POINTS
        points = np.empty((len(scan.ranges), 2), dtype=np.float32)
        # Machine code does not check types, so ensure the one it was compiled for.
        ranges = np.ascontiguousarray(scan.ranges, dtype=np.float32)
        infinite = observation.source.inf_is_valid
        return laser, points[: self._project(laser, ranges, self._rays(scan), infinite, points)]

    def _rays(self, scan: SensedScan) -> Floats:
        """Return unit vectors (n, 2) along the rays; a laser keeps its angles for a run."""
        angles, directions = self._directions.get(scan.laser, (None, None))
        if directions is None or angles is not scan.angles:
            directions = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))
            self._directions[scan.laser] = scan.angles, directions
        return directions

    def extend(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Extend the bounds to include a rectangle [m]."""
        bounds = self.changes.bounds
        bounds[0], bounds[1] = min(bounds[0], x0), min(bounds[1], y0)
        bounds[2], bounds[3] = max(bounds[2], x1), max(bounds[3], y1)

    def window(self, frame: Frame) -> Window:
        """Return the window of a grid's cells that the bounds touch; empty for empty bounds."""
        x0, y0, x1, y1 = self.changes.bounds.tolist()
        return (
            _cell(x0, frame.x, frame.resolution, frame.columns),
            _cell(y0, frame.y, frame.resolution, frame.rows),
            min(frame.columns, _cell(x1, frame.x, frame.resolution, frame.columns) + 1),
            min(frame.rows, _cell(y1, frame.y, frame.resolution, frame.rows) + 1),
        )


def _cell(at: float, begin: float, resolution: float, cells: int) -> int:
    """Return the row or column nearest to a coordinate [m]."""
    away = at - begin
    if away < 0.0:
        return 0
    return cells - 1 if at >= resolution * cells + begin else int(away / resolution)


class _Resets:
    """Resets of a layer, with the bounds for the next cycle (``addExtraBounds``)."""

    def __init__(self) -> None:
        self._bounds: tuple[float, float, float, float] | None = None

    def clear(self, grid: Grid, base: Pose2, side: float, *, inside: bool) -> None:
        """Make cells outside (or ``inside``) a square of ``side`` [m] around ``base`` unknown.

        An unknown cell lets the layers below show through; a free one would hide them. The rim of
        the square counts as outside (``CostmapLayer::clearArea``).
        """
        rows, columns, min_x, min_y, resolution = grid.frame
        x0, y0 = base.x - side / 2.0, base.y - side / 2.0
        begin = int((x0 - min_x) / resolution), int((y0 - min_y) / resolution)
        end = int((x0 + side - min_x) / resolution), int((y0 + side - min_y) / resolution)
        square = (
            slice(max(0, begin[1] + 1), max(0, end[1])),
            slice(max(0, begin[0] + 1), max(0, end[0])),
        )
        cells = grid.cells.reshape(rows, columns)
        if inside:
            cells[square] = NO_INFORMATION
        else:
            inner = cells[square].copy()
            cells[:] = NO_INFORMATION
            cells[square] = inner
        max_x, max_y = min_x + (columns - 0.5) * resolution, min_y + (rows - 0.5) * resolution
        self._bounds = (min_x, min_y, max_x, max_y)

    def use(self, work: Workspace) -> bool:
        """Extend the cycle's bounds by the latest reset; return whether there was one."""
        if self._bounds is None:
            return False
        work.extend(*self._bounds)
        self._bounds = None
        return True


def map_grid(world: OccupancyGrid, layer: StaticLayer) -> Grid:
    """Return the costs of a map (``StaticLayer::interpretValue``).

    Unknown cells of a map are -1, as an unsigned byte 255.
    """
    values = world.cells.astype(np.uint8)
    threshold = min(layer.lethal_cost_threshold, OCCUPIED)
    between = 0.0 if layer.trinary_costmap else values / threshold * LETHAL
    costs = np.where(values >= threshold, LETHAL, between).astype(np.uint8)
    unknown = NO_INFORMATION if layer.track_unknown_space else 0
    costs[values == layer.unknown_cost_value % 256] = unknown
    rows, columns = world.cells.shape
    return Grid(costs.ravel(), Frame(rows, columns, world.x, world.y, world.resolution))


def placed(frame_in_map: Pose2) -> Floats:
    """Return the transform (6,) to map for :func:`show_map`: two rows of x, y, offset.

    The rotation comes from a quaternion, as in tf2, which rounds differently from sine and cosine.
    The identity leaves coordinates unchanged.
    """
    z, w = math.sin(frame_in_map.yaw / 2.0), math.cos(frame_in_map.yaw / 2.0)
    twice = z * (2.0 / (z * z + w * w))
    c, s = 1.0 - z * twice, w * twice
    return np.array((c, -s, frame_in_map.x, s, c, frame_in_map.y))


@kernel
def show_map(master: Grid, window: Window, world: Grid, to_map: Floats, maximum: bool) -> None:
    """Write the map ``world`` over the window of a master grid of another place, size or frame.

    Each cell takes the value of the map cell under its centre; off the map it stays. With
    ``maximum`` the greater value counts, and unknown is the greatest
    (``StaticLayer::updateCosts`` in a rolling window).
    """
    frame = master.frame
    for r in range(window[1], window[3]):
        for c in range(window[0], window[2]):
            x, y = (
                frame.x + (c + 0.5) * frame.resolution,
                frame.y + (r + 0.5) * frame.resolution,
            )
            column, row = cell_at(
                world.frame,
                to_map[0] * x + to_map[1] * y + to_map[2],
                to_map[3] * x + to_map[4] * y + to_map[5],
            )
            if column < 0:
                continue
            cell = r * frame.columns + c
            value = cell_value(world.cells, row * world.frame.columns + column)
            master.cells[cell] = max(value, cell_value(master.cells, cell)) if maximum else value


class MapLayer:
    """A static layer; ``grid`` holds the costs of the map.

    The costmap merges its ``row`` of cells. Without a row it shows the map under a moving window.
    """

    def __init__(self, layer: StaticLayer, world: OccupancyGrid, row: Cells | None) -> None:
        self.name = layer.name
        self.maximum = layer.use_maximum
        self.method = MAXIMUM if layer.use_maximum else REPLACE
        self.grid = map_grid(world, layer)
        if row is not None:
            row[:] = self.grid.cells
            self.grid = self.grid._replace(cells=row)
        self._rolling, self._new, self._cleared = row is None, True, _Resets()

    def extend_bounds(self, work: Workspace) -> None:
        """Request the whole map if it is new, cleared, or under a moving window.

        The bounds are those of the map in its own frame, regardless of the costmap's frame.
        """
        if not self._cleared.use(work) and not self._new and not self._rolling:
            return
        rows, columns, min_x, min_y, resolution = self.grid.frame
        work.extend(
            min_x + 0.5 * resolution,
            min_y + 0.5 * resolution,
            min_x + (columns + 0.5) * resolution,
            min_y + (rows + 0.5) * resolution,
        )
        self._new = False

    def clear(self, base: Pose2, side: float, *, inside: bool) -> None:
        """Clear the map outside (or ``inside``) a square of ``side`` [m] for good."""
        self._cleared.clear(self.grid, base, side, inside=inside)


class SensedLayer:
    """An obstacle or a voxel layer; the cells of its ``grid`` are its row in the costmap.

    ``default`` is the value of unseen cells.
    """

    def __init__(
        self,
        layer: ObstacleLayer,
        default: int,
        footprint: Floats,
        hears: Hears,
        grid: Grid,
        work: Workspace,
    ) -> None:
        self.name, self.default, self.grid = layer.name, default, grid
        grid.cells[:] = default
        method = layer.combination_method
        self.method = method if method in (OVERWRITE, MAXIMUM) else NOTHING
        self._footprint = np.ascontiguousarray(footprint, dtype=np.float64)
        self._layer, self._cleared = layer, _Resets()
        self._lasers = [frozenset(hears(source.topic)) for source in layer.sources]
        self._voxels: Voxels | None = None
        kernels: tuple[Callable[..., None], ...] = (clear_rays, mark)
        if isinstance(layer, VoxelLayer):
            self._voxels = voxels_of(layer, grid.cells.size)
            kernels = (clear_voxels, mark_voxels)
        sample = (*self._target(work), _NO_LASER, _NO_POINTS, 0.0)
        self._clear, self._mark = (machine_code(each, *sample) for each in kernels)
        at = (0.0, 0.0, 0.0)
        self._free = machine_code(free_footprint, grid, work.changes, self._footprint, *at)

    def _target(self, work: Workspace) -> tuple[Grid | Changes | Voxels, ...]:
        """Return the records that clearing and marking change."""
        if self._voxels is None:
            return self.grid, work.changes
        return self.grid, work.changes, self._voxels

    def extend_bounds(self, work: Workspace) -> None:
        """Clear and mark by the observations, then free the footprint."""
        self._cleared.use(work)
        target, reaching = self._target(work), work.reaching
        seen = [
            (each, *reaching(each)) for each in observations(self._layer, self._lasers, work.scans)
        ]
        # All sources clear before one marks, as in ``updateBounds``, so that marked cells survive
        # the rays of other sources.
        for observation, laser, points in seen:
            if observation.source.clearing:
                self._clear(*target, laser, points, observation.source.raytrace_range)
        for observation, laser, points in seen:
            if observation.marks:
                self._mark(*target, laser, points, observation.source.obstacle_range)
        # The footprint comes last: the robot's place is free in spite of marks. Its columns of
        # voxels do not change.
        if self._layer.footprint_clearing_enabled:
            base = work.base
            self._free(self.grid, work.changes, self._footprint, base.x, base.y, base.yaw)

    def shift(self, frame: Frame, right: int, up: int) -> None:
        """Move to ``frame``, which lies ``right`` and ``up`` [cells] from the last one."""
        shift_cells(self.grid.cells, frame, right, up, self.default)
        if self._voxels is not None:
            shift_cells(self._voxels.columns, frame, right, up, UNKNOWN_COLUMN)
        self.grid = Grid(self.grid.cells, frame)

    def clear(self, base: Pose2, side: float, *, inside: bool) -> None:
        """Clear obstacles outside (or ``inside``) a square of ``side`` [m]; columns stay."""
        self._cleared.clear(self.grid, base, side, inside=inside)


class InflatingLayer:
    """An inflation layer, with the bounds of the previous cycle."""

    def __init__(self, layer: InflationLayer, table: InflationTable) -> None:
        self.name, self.layer, self.table = layer.name, layer, table
        self._last: tuple[float, ...] | None = None

    def extend_bounds(self, work: Workspace) -> None:
        """Request everything in the first cycle, later the area that inflation may change.

        That area is ``radius`` [m] around the bounds of this cycle and of the previous one.
        """
        bounds, radius = work.changes.bounds, self.layer.inflation_radius
        last, self._last = self._last, bounds.tolist()
        if last is None:
            bounds[:] = _EVERYWHERE
            return
        (x0, y0, x1, y1), (u0, v0, u1, v1) = self._last, last
        bounds[0], bounds[1] = min(x0, u0) - radius, min(y0, v0) - radius
        bounds[2], bounds[3] = max(x1, u1) + radius, max(y1, v1) + radius


LiveLayer: TypeAlias = MapLayer | SensedLayer | InflatingLayer


def shift_cells(cells: Cells | Columns, frame: Frame, right: int, up: int, default: int) -> None:
    """Move ``cells`` for a window of ``frame`` that goes ``right`` and ``up`` [cells]."""
    rows, columns = frame[:2]
    if abs(up) >= rows or abs(right) >= columns:
        cells[:] = default
        return
    # One move of memory in place takes less than half the time of copying a large grid to and fro.
    # Values from neighbouring rows end up in the new columns only.
    away = up * columns + right
    if away > 0:
        cells[:-away] = cells[away:]
    elif away < 0:
        cells[-away:] = cells[:away]
    table = cells.reshape(rows, columns)
    table[rows - up if up > 0 else 0 : rows if up > 0 else -up] = default
    table[:, columns - right if right > 0 else 0 : columns if right > 0 else -right] = default
