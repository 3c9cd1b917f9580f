"""One costmap: its layers, the master grid and the update cycle of costmap_2d (Noetic)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.stacks.ros1.cost_grid import EMPTY_WINDOW, FREE_SPACE, NO_INFORMATION, CostGrid
from daemon.stacks.ros1.costmap._inflation import InflationTable, column_gaps, inflation_table
from daemon.stacks.ros1.costmap._live_layers import (
    NOWHERE,
    InflatingLayer,
    LiveLayer,
    MapLayer,
    SensedLayer,
    Workspace,
    merged_start,
    shift_cells,
)
from daemon.stacks.ros1.costmap._observations import Hears, PackedScans, SensedScan
from daemon.stacks.ros1.costmap._obstacle_layer import Cells, polygon_spans
from daemon.stacks.ros1.costmap._static_layer import placed, show_map
from daemon.stacks.ros1.costmap._voxel_layer import UNKNOWN_COLUMN
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObstacleLayer,
    StaticLayer,
    radii,
)
from daemon.stacks.ros1.costmap.master_grid import (
    bounds_to_window,
    inflate_window,
    inflated_map,
    merge_window,
    update_changed_cells,
)
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OccupancyGrid

_NO_CELLS: Final = np.array((1 << 30, 1 << 30, -1, -1), dtype=np.int32)
_IN_PLACE: Final = Pose2()


def grid_shape(parameters: LayeredCostmap) -> tuple[int, int]:
    """Return (rows, columns); raises ``ValueError`` for a grid without cells."""
    shape = (
        int(parameters.height / parameters.resolution),
        int(parameters.width / parameters.resolution),
    )
    if min(shape) < 1:
        raise ValueError(
            f"a costmap of {parameters.width:g} m x {parameters.height:g} m has no cell of "
            f"{parameters.resolution:g} m"
        )
    return shape


@dataclass(frozen=True, slots=True)
class _Merge:
    """Rows of cells to merge over the master, or ``anew`` over what it is without layers."""

    begin: int
    end: int
    anew: bool


class Costmap:
    """A master grid that follows what the robot's lasers see.

    The cycle is costmap_2d's: each layer extends the bounds of what is to be redone, the cells
    there are reset and the layers merged and inflated in their order; cells outside keep their
    costs. A grid that stands still, with no layer above its inflation, does that by following
    changes only, which leaves the same cells.

    Attributes:
        grid: the master grid. Others may set cells of it free, as move_base and navfn do, if they
            ``touch`` it.
    """

    def __init__(
        self,
        parameters: LayeredCostmap,
        footprint: Floats,
        quirks: Quirks,
        static: OccupancyGrid | None = None,
        hears: Hears | None = None,
    ) -> None:
        """Prepare the layers; ``footprint`` (k, 2) [m] is padded already.

        ``static`` is the map, needed by static layers: a grid that stands still gets its size from
        it and lies where the map lies, whatever its frame. ``hears`` tells from a topic which
        lasers are published on it; without it every source hears every laser. Raises ``ValueError``
        for an inflation radius of more than 250 cells, and without the map that is asked for.
        """
        self._rolling, self._quirks = parameters.rolling_window, quirks
        self._default = NO_INFORMATION if parameters.track_unknown_space else FREE_SPACE
        shows_map = any(isinstance(layer, StaticLayer) for layer in parameters.layers)
        if shows_map and static is None:
            raise ValueError("a static layer shows the map, but the costmap was given no map")
        if static is not None and shows_map and not self._rolling:
            frame = (static.x, static.y, static.resolution)
            shape = (int(static.cells.shape[0]), int(static.cells.shape[1]))
        else:
            frame = (parameters.origin_x, parameters.origin_y, parameters.resolution)
            shape = grid_shape(parameters)
        size = shape[0] * shape[1]
        self._work = Workspace(
            shape, np.array(frame), np.zeros(size, dtype=np.uint8), np.empty(size, dtype=np.int32)
        )
        self._packed = PackedScans()
        inscribed, _ = radii(footprint)
        layers: list[LiveLayer] = []
        for layer in parameters.layers:
            if isinstance(layer, InflationLayer):
                table = _table(layer, inscribed, frame[2])
                layers.append(InflatingLayer(layer.name, layer.inflation_radius, table))
            elif isinstance(layer, ObstacleLayer):
                # With the quirk, a layer above the map hides unknown cells unless it tracks them.
                tracks = layer.track_unknown_space or (
                    shows_map and not quirks.unknown_becomes_free
                )
                default = NO_INFORMATION if tracks else FREE_SPACE
                layers.append(SensedLayer(layer, default, footprint, hears))
            elif static is not None:
                layers.append(MapLayer(layer, static, rolling=self._rolling))
        self._layers = tuple(layers)
        self._window = np.zeros(4, dtype=np.int32)
        self._changed, self._disturbed = np.zeros(4, dtype=np.int32), np.zeros(4, dtype=np.int32)
        last = self._layers[-1] if self._layers else None
        self._table = last.table if isinstance(last, InflatingLayer) else _no_inflation()
        self._begins_inflated = self._can_begin_inflated()
        self._follows_changes = self._can_follow_changes()
        self._start(size)
        self.grid = CostGrid(frame[2], frame[0], frame[1], self._master.reshape(shape))
        self.grid.touch((0, 0, shape[1], shape[0]))
        self.grid.disturbed = EMPTY_WINDOW

    def _can_follow_changes(self) -> bool:
        """Tell whether the grid begins inflated and the nearest obstacle decides on each cost.

        Where it is the first to be passed on, any obstacle of the window may have its part in it.
        """
        ordered = self._table.radius > 0 and self._quirks.inflation_queue_order
        return self._begins_inflated and not ordered

    def _can_begin_inflated(self) -> bool:
        """Tell whether the grid stands still, begins as a whole and nothing lies over inflation."""
        inflating = [isinstance(layer, InflatingLayer) for layer in self._layers]
        whole = any(inflating) or any(isinstance(layer, MapLayer) for layer in self._layers)
        return not self._rolling and whole and not any(inflating[:-1])

    def _start(self, size: int) -> None:
        """Lay the merged layers out, and the master as it is before the first cycle."""
        own = [
            layer
            for layer in self._layers
            if isinstance(layer, SensedLayer) or (isinstance(layer, MapLayer) and not self._rolling)
        ]
        self._rows: Cells = np.empty((len(own), size), dtype=np.uint8)
        self._methods = np.array([layer.method for layer in own], dtype=np.int32)
        for row, layer in zip(self._rows, own, strict=True):
            if isinstance(layer, SensedLayer):
                layer.attach(row)
            else:
                row[:] = layer.cells
                layer.cells = row
        self._left, self._reset = 0, False
        if self._begins_inflated:
            below = merged_start(self._layers, size, self._default)
            ordered = self._quirks.inflation_queue_order
            start = inflated_map(below, self._work.shape, self._table, in_order=ordered)
            self._master = start.master
        else:
            self._master = np.full(size, self._default, dtype=np.uint8)
        if self._follows_changes:
            self._values: Cells = np.empty(size, dtype=np.uint8)
            self._gaps = start.gaps
        else:
            self._steps = self._plan_steps()

    def _plan_steps(self) -> list[_Merge | InflatingLayer | MapLayer]:
        """Return what is done to a window, in order; neighbouring rows are merged in one go."""
        steps: list[_Merge | InflatingLayer | MapLayer] = [_Merge(0, 0, True)]
        row = 0
        for layer in self._layers:
            last = steps[-1]
            if isinstance(layer, InflatingLayer) or (isinstance(layer, MapLayer) and self._rolling):
                steps.append(layer)
                continue
            if isinstance(last, _Merge):
                steps[-1] = _Merge(last.begin, row + 1, last.anew)
            else:
                steps.append(_Merge(row, row + 1, False))
            row += 1
        return steps

    def update(
        self, base: Pose2, scans: Sequence[SensedScan] = (), frame_in_map: Pose2 = _IN_PLACE
    ) -> None:
        """Run one cycle (``updateMap``) with the robot at ``base`` in the costmap's frame.

        ``scans`` are those received, the oldest first, as far back as any source remembers them;
        the same as last time if none came since. ``frame_in_map`` is the pose of the costmap's
        frame in map, which static layers of a rolling window need. Raises ``ValueError`` for a scan
        with more or fewer ranges than angles.
        """
        work = self._work
        # The window rolls first: bounds are in the frame of the moved grid (``updateMap``).
        if self._rolling:
            self._shift(base)
        work.base[:] = base.x, base.y, base.yaw
        work.bounds[:] = NOWHERE
        self._packed.take(scans)
        listed = 0
        for layer in self._layers:
            if isinstance(layer, SensedLayer):
                listed = layer.extend_bounds(work, self._packed, listed)
            else:
                layer.extend_bounds(work)
        bounds_to_window(work.bounds, work.shape, work.frame, self._window)
        self._changed[:] = _NO_CELLS
        if not self._follows_changes:
            self._redo(listed, frame_in_map)
        elif self._reset:
            self._begin_anew()
        else:
            self._settle(listed)
        if self._changed[2] >= 0:
            x0, y0, x1, y1 = self._changed.tolist()
            self.grid.touch((x0, y0, x1, y1))
        self.grid.disturbed = EMPTY_WINDOW

    def clear_square(self, base: Pose2, half: float) -> None:
        """Set the master free in a square of ``half`` its side [m] around ``base``.

        The layers keep their obstacles (move_base ``clearCostmapWindows``). Nothing happens when a
        corner lies off the grid.
        """
        x, y, work = base.x, base.y, self._work
        corners = np.array(
            [
                (x - half, y - half),
                (x + half, y - half),
                (x + half, y + half),
                (x - half, y + half),
            ]
        )
        begin, end = polygon_spans(corners, work.shape, work.frame, work.first, work.last)
        if begin >= end:
            return
        low, high = int(work.first[begin]), int(work.last[begin]) + 1
        self.grid.cells[low:high, begin:end] = FREE_SPACE
        self.grid.touch((begin, low, end, high))

    def clear_layers(
        self, base: Pose2, side: float, names: Collection[str] | None, *, inside: bool = False
    ) -> tuple[str, ...]:
        """Forget what layers know outside (or ``inside``) a square of ``side`` [m] at ``base``.

        Those called as ``names`` say, static ones as well, or without names all that lasers fill;
        an inflation layer has nothing to forget. Returns the names of the layers cleared; the
        master follows with the next update (clear_costmap_recovery).
        """
        cleared = []
        for layer in self._layers:
            name = layer.name.rsplit("/", 1)[-1]
            if isinstance(layer, InflatingLayer) or (names is not None and name not in names):
                continue
            if isinstance(layer, SensedLayer):
                layer.clear(self._work, base, side, inside=inside)
            elif names is None:
                continue
            else:
                layer.clear(base, side, inside=inside)
            cleared.append(name)
            self._reset = True
        return tuple(cleared)

    def _shift(self, base: Pose2) -> None:
        """Move the window by whole cells, keep what lies in both."""
        work = self._work
        left, low, resolution = work.frame.tolist()
        rows, columns = work.shape
        # Half of what costmap_2d takes for the size: the centre of the last cell.
        x = base.x - (columns - 0.5) * resolution / 2.0
        y = base.y - (rows - 0.5) * resolution / 2.0
        whole = int if self._quirks.truncated_window_shift else round
        right, up = whole((x - left) / resolution), whole((y - low) / resolution)
        if right == 0 and up == 0:
            return
        shift_cells(self._master, work.shape, right, up, self._default)
        for layer in self._layers:
            if isinstance(layer, SensedLayer):
                shift_cells(layer.cells, work.shape, right, up, layer.default)
                if layer.voxels.size:
                    shift_cells(layer.voxels, work.shape, right, up, UNKNOWN_COLUMN)
        work.frame[:2] = left + right * resolution, low + up * resolution
        self.grid.x, self.grid.y = float(work.frame[0]), float(work.frame[1])
        self.grid.touch((0, 0, columns, rows))

    def _redo(self, listed: int, frame_in_map: Pose2) -> None:
        """Do the window over, layer by layer; the list of changes is not needed."""
        work, window = self._work, self._window
        work.flags[work.queue[:listed]] = 0
        x0, y0, x1, y1 = window.tolist()
        if not self._layers or x0 >= x1 or y0 >= y1:
            return
        for step in self._steps:
            if isinstance(step, _Merge):
                merge_window(
                    self._master, self._rows, self._methods, step.begin, step.end, self._default,
                    step.anew, work.shape[1], window,
                )  # fmt: skip
            elif isinstance(step, InflatingLayer):
                table = step.table
                inflate_window(
                    self._master, work.shape, window, table.costs, table.widths, table.least,
                    self._quirks.inflation_queue_order, self._changed,
                )  # fmt: skip
            else:
                show_map(
                    self._master, work.shape, work.frame, window, step.cells, step.shape,
                    step.frame, placed(frame_in_map), step.maximum,
                )  # fmt: skip
        self._changed[:2] = np.minimum(self._changed[:2], window[:2])
        self._changed[2:] = np.maximum(self._changed[2:], window[2:])

    def _begin_anew(self) -> None:
        """Merge and inflate the window, which is the whole grid after a reset."""
        work, table = self._work, self._table
        merge_window(
            self._master, self._rows, self._methods, 0, len(self._rows), self._default, True,
            work.shape[1], self._window,
        )  # fmt: skip
        inflate_window(
            self._master, work.shape, self._window, table.costs, table.widths, table.least, False,
            self._changed,
        )  # fmt: skip
        column_gaps(self._master, work.shape, table.radius, self._gaps)
        work.flags[:] = 0
        self._left, self._reset = 0, False

    def _settle(self, listed: int) -> None:
        """Follow the listed changes."""
        work, table = self._work, self._table
        self._disturbed[:] = self.grid.disturbed
        self._left = update_changed_cells(
            self._master, self._rows, self._methods, self._default, self._gaps, work.shape,
            self._window, self._disturbed, table.costs, table.widths, table.least, work.flags,
            work.queue, self._values, listed, self._left, self._changed,
        )  # fmt: skip


def _table(layer: InflationLayer, inscribed: float, resolution: float) -> InflationTable:
    return inflation_table(
        layer.inflation_radius,
        layer.cost_scaling_factor,
        inscribed,
        resolution,
        over_unknown=layer.inflate_unknown,
    )


def _no_inflation() -> InflationTable:
    return inflation_table(0.0, 1.0, 0.0, 1.0, over_unknown=False)
