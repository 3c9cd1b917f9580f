"""The layers of a costmap while it lives: what each keeps between two cycles.

In every cycle each layer, in its order, takes in what is new and extends the bounds of what is to
be redone (``updateBounds``); merging and inflating are the costmap's (:mod:`._costmap`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np

from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.cost_grid import FREE_SPACE, NO_INFORMATION
from daemon.stacks.ros1.costmap._inflation import InflationTable
from daemon.stacks.ros1.costmap._observations import Hears, ObservationTable, PackedScans
from daemon.stacks.ros1.costmap._obstacle_layer import Cells, observe
from daemon.stacks.ros1.costmap._static_layer import map_costs
from daemon.stacks.ros1.costmap._voxel_layer import UNKNOWN_COLUMN, heights_of, observe_voxels
from daemon.stacks.ros1.costmap.layers import ObstacleLayer, StaticLayer, VoxelLayer
from daemon.stacks.ros1.costmap.master_grid import (
    MAXIMUM,
    NOTHING,
    OVERWRITE,
    REPLACE,
    extend_for_inflation,
)
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OccupancyGrid

NOWHERE: Final = np.array((1e30, 1e30, -1e30, -1e30))
"""Bounds of nothing [m] (costmap_2d uses the same numbers)."""
_NO_FOOTPRINT: Final = np.empty((0, 2))


@dataclass(slots=True, eq=False)
class Workspace:
    """What the layers of one costmap share: its grid, the cycle's bounds, the list of changes."""

    shape: tuple[int, int]
    frame: Floats
    """x, y of the lower left corner and the resolution [m]."""
    flags: Cells
    queue: Integers
    bounds: Floats = field(default_factory=NOWHERE.copy)
    """Of the cycle [m]: x0, y0, x1, y1."""
    base: Floats = field(default_factory=lambda: np.zeros(3))
    """x, y, yaw of the base in the costmap's frame."""
    first: Integers = field(init=False)
    last: Integers = field(init=False)
    """Room for the spans of a polygon."""

    def __post_init__(self) -> None:
        self.first = np.zeros(self.shape[1], dtype=np.int32)
        self.last = np.zeros(self.shape[1], dtype=np.int32)

    def extend(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Let the bounds hold a rectangle [m]."""
        bounds = self.bounds
        bounds[0], bounds[1] = min(bounds[0], x0), min(bounds[1], y0)
        bounds[2], bounds[3] = max(bounds[2], x1), max(bounds[3], y1)


class _ClearedBounds:
    """Bounds that a reset left behind for the next cycle (``addExtraBounds``)."""

    def __init__(self) -> None:
        self._bounds: tuple[float, float, float, float] | None = None

    def note(self, shape: tuple[int, int], frame: Floats) -> None:
        left, low, resolution = frame.tolist()
        rows, columns = shape
        right, high = left + (columns - 0.5) * resolution, low + (rows - 0.5) * resolution
        self._bounds = (left, low, right, high)

    def use(self, work: Workspace) -> bool:
        """Extend the cycle's bounds by what was cleared; tell whether anything was."""
        if self._bounds is None:
            return False
        work.extend(*self._bounds)
        self._bounds = None
        return True


def _clear_area(
    cells: Cells, shape: tuple[int, int], frame: Floats, base: Pose2, side: float, *, inside: bool
) -> None:
    """Make cells outside (or ``inside``) a square of ``side`` [m] around ``base`` unknown.

    Unknown in a layer lets those below show through; free would hide them. The rim of the square
    counts as outside (``CostmapLayer::clearArea``).
    """
    left, low, resolution = frame.tolist()
    x0, y0 = base.x - side / 2.0, base.y - side / 2.0
    begin = int((x0 - left) / resolution), int((y0 - low) / resolution)
    end = int((x0 + side - left) / resolution), int((y0 + side - low) / resolution)
    square = (
        slice(max(0, begin[1] + 1), max(0, end[1])),
        slice(max(0, begin[0] + 1), max(0, end[0])),
    )
    grid = cells.reshape(shape)
    if inside:
        grid[square] = NO_INFORMATION
        return
    kept = grid[square].copy()
    grid[:] = NO_INFORMATION
    grid[square] = kept


class MapLayer:
    """A static layer; ``cells`` are its own where the grid follows the robot, else the grid's."""

    def __init__(self, layer: StaticLayer, world: OccupancyGrid, *, rolling: bool) -> None:
        self.name = layer.name
        self.maximum = layer.use_maximum
        self.method = MAXIMUM if layer.use_maximum else REPLACE
        self.cells = map_costs(world.cells, track_unknown=layer.track_unknown_space)
        self.shape = (int(world.cells.shape[0]), int(world.cells.shape[1]))
        self.frame = np.array((world.x, world.y, world.resolution))
        self._rolling, self._new, self._cleared = rolling, True, _ClearedBounds()

    def extend_bounds(self, work: Workspace) -> None:
        """Ask for the whole map when it is new or cleared, under a moving window always.

        The bounds are those of the map in its own frame, whatever the costmap's is.
        """
        if not self._cleared.use(work) and not self._new and not self._rolling:
            return
        left, low, resolution = self.frame.tolist()
        rows, columns = self.shape
        work.extend(
            left + 0.5 * resolution,
            low + 0.5 * resolution,
            left + (columns + 0.5) * resolution,
            low + (rows + 0.5) * resolution,
        )
        self._new = False

    def clear(self, base: Pose2, side: float, *, inside: bool) -> None:
        """Forget the map outside (or ``inside``) a square of ``side`` [m], for good."""
        _clear_area(self.cells, self.shape, self.frame, base, side, inside=inside)
        self._cleared.note(self.shape, self.frame)


class SensedLayer:
    """An obstacle or a voxel layer; ``cells`` are the costmap's row for it."""

    def __init__(
        self, layer: ObstacleLayer, default: int, footprint: Floats, hears: Hears | None
    ) -> None:
        self.name = layer.name
        self.default = default
        """What the layer says of a cell it never saw."""
        known = layer.combination_method in (OVERWRITE, MAXIMUM)
        self.method = layer.combination_method if known else NOTHING
        cleared = footprint if layer.footprint_clearing_enabled else _NO_FOOTPRINT
        self._footprint = np.ascontiguousarray(cleared, dtype=np.float64)
        self._heard, self._cleared = ObservationTable(layer, hears), _ClearedBounds()
        self._heights = heights_of(layer) if isinstance(layer, VoxelLayer) else None
        self.cells: Cells = np.empty(0, dtype=np.uint8)
        self.voxels = np.empty(0, dtype=np.uint32)

    def attach(self, cells: Cells) -> None:
        """Take the row of the costmap's cells that is this layer's."""
        self.cells = cells
        cells[:] = self.default
        if self._heights is not None:
            self.voxels = np.full(cells.size, UNKNOWN_COLUMN, dtype=np.uint32)

    def extend_bounds(self, work: Workspace, packed: PackedScans, listed: int) -> int:
        """Take in what was heard; return how many changed cells are on the list now."""
        self._cleared.use(work)
        rows = self._heard.rows(packed)
        if self._heights is None:
            return observe(
                self.cells, work.shape, work.frame, packed.ranges, packed.directions, work.base,
                packed.table, rows, packed.points, self._footprint, work.first, work.last,
                work.bounds, work.flags, work.queue, listed,
            )  # fmt: skip
        return observe_voxels(
            self.cells, self.voxels, self._heights, work.shape, work.frame, packed.ranges,
            packed.directions, work.base, packed.table, rows, packed.points, self._footprint,
            work.first, work.last, work.bounds, work.flags, work.queue, listed,
        )  # fmt: skip

    def clear(self, work: Workspace, base: Pose2, side: float, *, inside: bool) -> None:
        """Forget obstacles outside (or ``inside``) a square of ``side`` [m]; columns stay."""
        _clear_area(self.cells, work.shape, work.frame, base, side, inside=inside)
        self._cleared.note(work.shape, work.frame)


class InflatingLayer:
    """An inflation layer, with the bounds of the cycle before."""

    def __init__(self, name: str, radius: float, table: InflationTable) -> None:
        self.name, self.table = name, table
        self._radius = radius
        self._last = NOWHERE.copy()
        self._everything = True

    def extend_bounds(self, work: Workspace) -> None:
        """Ask for what inflation may change; for everything in the first cycle."""
        extend_for_inflation(work.bounds, self._last, self._radius, self._everything)
        self._everything = False


LiveLayer: TypeAlias = MapLayer | SensedLayer | InflatingLayer


def shift_cells(
    cells: np.ndarray, shape: tuple[int, int], right: int, up: int, default: int
) -> None:
    """Move flat ``cells`` so that their window goes ``right`` and ``up`` [cells]."""
    rows, columns = shape
    grid = cells.reshape(shape)
    if abs(up) >= rows or abs(right) >= columns:
        cells[:] = default
        return
    # One move of memory in place, in less than half the time of copying a large grid to and fro;
    # what it brings in from the rows beside lies in the columns that are new anyway.
    away = up * columns + right
    if away > 0:
        cells[:-away] = cells[away:]
    elif away < 0:
        cells[-away:] = cells[:away]
    grid[rows - up if up > 0 else 0 : rows if up > 0 else -up] = default
    grid[:, columns - right if right > 0 else 0 : columns if right > 0 else -right] = default


def merged_start(layers: tuple[LiveLayer, ...], size: int, default: int) -> Cells:
    """Return the merged cells before anything was seen."""
    below = np.full(size, default, dtype=np.uint8)
    for layer in layers:
        if isinstance(layer, InflatingLayer) or layer.method == NOTHING:
            continue
        if layer.method == REPLACE:
            below[:] = layer.cells
        elif isinstance(layer, MapLayer):
            known, unknown = layer.cells != NO_INFORMATION, below == NO_INFORMATION
            below = np.where(known & (unknown | (below < layer.cells)), layer.cells, below)
        elif layer.default == FREE_SPACE:
            everywhere = layer.method == OVERWRITE
            below[slice(None) if everywhere else below == NO_INFORMATION] = FREE_SPACE
    return below
