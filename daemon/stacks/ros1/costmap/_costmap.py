"""One costmap: the layers, the master grid and the update cycle of costmap_2d (Noetic)."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from daemon.stacks.ros1.cost_grid import EMPTY_WINDOW, FREE_SPACE, NO_INFORMATION, CostGrid
from daemon.stacks.ros1.costmap._footprint import radii
from daemon.stacks.ros1.costmap._inflation import column_gaps, inflation_table
from daemon.stacks.ros1.costmap._obstacle_layer import SensedScan, observe, polygon_spans
from daemon.stacks.ros1.costmap._parameters import CostmapParameters, ObservationSource
from daemon.stacks.ros1.costmap.master_grid import (
    cycle_window,
    inflated_map,
    static_layer,
    unknown_value,
    update_changed_cells,
    update_whole_window,
)
from daemon.stacks.ros1.quirks import ORIGINAL, Quirks
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OccupancyGrid


def grid_shape(parameters: CostmapParameters) -> tuple[int, int]:
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


def shift_cells(cells: npt.NDArray[np.uint8], right: int, up: int, default: int) -> None:
    """Move the content of ``cells`` so that its window goes ``right`` and ``up`` [cells]."""
    rows, columns = cells.shape
    old = cells.copy()
    cells[:] = default
    if abs(up) >= rows or abs(right) >= columns:
        return
    target = (
        slice(max(0, -up), rows - max(0, up)),
        slice(max(0, -right), columns - max(0, right)),
    )
    source = (
        slice(max(0, up), rows - max(0, -up)),
        slice(max(0, right), columns - max(0, -right)),
    )
    cells[target] = old[source]


_NOWHERE: Final = (1e30, 1e30, -1e30, -1e30)
_NO_CELLS: Final = (1 << 30, 1 << 30, -1, -1)
_NO_RANGES: Final = np.empty(0, dtype=np.float32)
_NO_SOURCES: Final = np.empty((0, 5))
_NO_FOOTPRINT: Final = np.empty((0, 2))


class Costmap:
    """A master grid that follows what the robot's laser sees.

    The cycle is costmap_2d's: each layer extends the bounds of what is to be redone, the cells
    there are reset, merged from the layers and inflated; cells outside keep their costs. A grid
    that stands still does that by following changes only, which leaves the same cells.

    Attributes:
        grid: the master grid. Others may set cells of it free, as move_base and navfn do, if they
            ``touch`` it.
    """

    def __init__(
        self,
        parameters: CostmapParameters,
        footprint: Floats,
        quirks: Quirks,
        static: OccupancyGrid | None = None,
    ) -> None:
        """Prepare the layers; ``footprint`` (k, 2) [m] is padded already.

        ``static`` is the map, needed with ``static_map``: the planner's costmap has one, that of
        the controller rolls along with the robot. Raises ``ValueError`` for an inflation radius
        of more than 250 cells, or without the map that is asked for.
        """
        if parameters.static_map and static is None:
            raise ValueError("static_map is true, but the costmap was given no map")
        self._parameters, self._quirks = parameters, quirks
        tracked = bool(parameters.track_unknown_space)
        if parameters.static_map and static is not None:
            frame = (static.x, static.y, static.resolution)
            shape = (int(static.cells.shape[0]), int(static.cells.shape[1]))
            below = static_layer(static.cells, unknown_value(parameters.track_unknown_space))
            # The layer above the map lets unknown cells show only if it tracks them itself.
            tracked = tracked or not quirks.unknown_becomes_free
        else:
            frame = (parameters.origin_x, parameters.origin_y, parameters.resolution)
            shape = grid_shape(parameters)
            unknown = NO_INFORMATION if tracked else FREE_SPACE
            below = np.full(shape[0] * shape[1], unknown, dtype=np.uint8)
        self._shape, self._frame = shape, np.array(frame)
        self._default = NO_INFORMATION if tracked else FREE_SPACE
        self._set_up_inflation(footprint)
        below.flags.writeable = False
        start = inflated_map(below, shape, self._layer_default, self._table)
        self._static, self._master = start.static, start.master.copy()
        self._gaps = start.gaps if parameters.rolling_window else start.gaps.copy()
        self.grid = CostGrid(frame[2], frame[0], frame[1], self._master.reshape(shape))
        self.grid.touch((0, 0, shape[1], shape[0]))
        self.grid.disturbed = EMPTY_WINDOW
        self._set_up_layer(footprint)

    def _set_up_inflation(self, footprint: Floats) -> None:
        parameters = self._parameters
        inscribed, _ = radii(footprint)
        self._radius = parameters.inflation_radius if parameters.inflation_layer else 0.0
        self._table = inflation_table(
            self._radius,
            parameters.cost_scaling_factor,
            inscribed,
            float(self._frame[2]),
            over_unknown=parameters.inflate_unknown,
        )
        self._last = np.array(_NOWHERE)
        self._to_inflate = parameters.inflation_layer

    def _set_up_layer(self, footprint: Floats) -> None:
        parameters, count = self._parameters, self._master.size
        cleared = footprint if parameters.footprint_clearing_enabled else _NO_FOOTPRINT
        self._footprint = np.ascontiguousarray(cleared, dtype=np.float64)
        self._now = np.zeros(8)
        self._layer = np.full(count, self._layer_default, dtype=np.uint8)
        self._flags = np.zeros(count, dtype=np.uint8)
        self._queue = np.empty(count, dtype=np.int32)
        self._left = 0
        self._new_map, self._reset = parameters.static_map, False
        self._sources = tuple(
            source
            for source in (parameters.sources if parameters.obstacle_layer else ())
            if source.data_type == "LaserScan"
        )
        self._tables: dict[float, Floats] = {}
        self._angles = np.empty(0)
        self._directions = np.empty((0, 2))
        self._points = np.empty((0, 2), dtype=np.float32)
        self._bounds, self._window = np.empty(4), np.zeros(4, dtype=np.int32)
        self._changed, self._disturbed = np.zeros(4, dtype=np.int32), np.zeros(4, dtype=np.int32)
        columns = self._shape[1]
        self._first, self._final = np.zeros(columns, dtype=np.int32), np.zeros(columns, np.int32)

    @property
    def _layer_default(self) -> int:
        """What the obstacle layer says of a cell it never saw; without the layer, nothing."""
        return self._default if self._parameters.obstacle_layer else NO_INFORMATION

    def update(self, base: Pose2, scan: SensedScan | None) -> None:
        """Run one cycle (``updateMap``) with the robot at ``base`` in the global frame.

        ``scan`` is the latest scan received, the same as last time if none came since, or ``None``
        if none ever came. Raises ``ValueError`` for a scan with more or fewer ranges than angles.
        """
        # The window rolls first: bounds are in the frame of the moved grid (``updateMap``).
        if self._parameters.rolling_window:
            self._shift(base)
        self._bounds[:] = _NOWHERE
        if self._new_map or self._reset:
            self._extend_to_the_map()
        listed = self._observe(base, scan) if self._parameters.obstacle_layer else 0
        cycle_window(
            self._bounds,
            self._last,
            self._radius,
            self._parameters.inflation_layer,
            self._to_inflate,
            self._shape,
            self._frame,
            self._window,
        )
        self._changed[:] = _NO_CELLS
        if self._parameters.rolling_window or self._reset:
            self._redo(listed)
        else:
            self._settle(listed)
        self._new_map = self._reset = self._to_inflate = False
        if self._changed[2] >= 0:
            x0, y0, x1, y1 = self._changed.tolist()
            self.grid.touch((x0, y0, x1, y1))
        self.grid.disturbed = EMPTY_WINDOW

    def clear_square(self, base: Pose2, half: float) -> None:
        """Set the master free in a square of ``half`` its side [m] around ``base``.

        The layers keep their obstacles (move_base ``clearCostmapWindows``). Nothing happens when a
        corner lies off the grid.
        """
        x, y = base.x, base.y
        corners = np.array(
            [
                (x - half, y - half),
                (x + half, y - half),
                (x + half, y + half),
                (x - half, y + half),
            ]
        )
        begin, end = polygon_spans(corners, self._shape, self._frame, self._first, self._final)
        if begin >= end:
            return
        low, high = int(self._first[begin]), int(self._final[begin]) + 1
        self.grid.cells[low:high, begin:end] = FREE_SPACE
        self.grid.touch((begin, low, end, high))

    def clear_obstacles_outside(self, base: Pose2, side: float) -> None:
        """Forget obstacles outside a square of ``side`` [m] around ``base``; the map stays.

        This is what the reset recoveries do where they find the layer (clear_costmap_recovery with
        ``reset_distance``). The master follows with the next update.
        """
        left, low, resolution = self._frame.tolist()
        x0, y0 = base.x - side / 2.0, base.y - side / 2.0
        columns = range(int((x0 - left) / resolution) + 1, int((x0 + side - left) / resolution))
        rows = range(int((y0 - low) / resolution) + 1, int((y0 + side - low) / resolution))
        layer = self._layer.reshape(self._shape)
        inside = (
            slice(max(0, rows.start), max(0, rows.stop)),
            slice(max(0, columns.start), max(0, columns.stop)),
        )
        kept = layer[inside].copy()
        # Unknown in the layer lets the map below show through; free would hide its walls.
        layer[:] = NO_INFORMATION
        layer[inside] = kept
        self._reset = True

    def _extend_to_the_map(self) -> None:
        left, low, resolution = self._frame.tolist()
        rows, columns = self._shape
        self._bounds[:] = (left, low, left + columns * resolution, low + rows * resolution)

    def _shift(self, base: Pose2) -> None:
        """Move the window by whole cells, keep what lies in both."""
        left, low, resolution = self._frame.tolist()
        rows, columns = self._shape
        # Half of what costmap_2d takes for the size: the centre of the last cell.
        x = base.x - (columns - 0.5) * resolution / 2.0
        y = base.y - (rows - 0.5) * resolution / 2.0
        whole = int if self._quirks.truncated_window_shift else round
        right, up = whole((x - left) / resolution), whole((y - low) / resolution)
        if right == 0 and up == 0:
            return
        for cells, default in (
            (self._master, int(self._static[0])),
            (self._layer, self._layer_default),
        ):
            shift_cells(cells.reshape(self._shape), right, up, default)
        self._frame[:2] = left + right * resolution, low + up * resolution
        self.grid.x, self.grid.y = float(self._frame[0]), float(self._frame[1])
        self.grid.touch((0, 0, columns, rows))

    def _observe(self, base: Pose2, scan: SensedScan | None) -> int:
        """Bring the obstacle layer up to date, return how many of its cells changed."""
        sources, ranges, now = _NO_SOURCES, _NO_RANGES, self._now
        now[0], now[1], now[2] = base.x, base.y, base.yaw
        if scan is not None and self._sources:
            sources, ranges, laser = self._table_for(scan.height), scan.ranges, scan.laser
            now[3], now[4], now[5] = laser.x, laser.y, laser.yaw
            now[6], now[7] = scan.range_min, scan.range_max
            if scan.angles is not self._angles:
                self._take_angles(scan.angles)
            if len(ranges) != len(self._angles):
                raise ValueError(f"{len(ranges)} ranges at {len(self._angles)} angles are no scan")
        return observe(
            self._layer,
            self._shape,
            self._frame,
            ranges,
            self._directions,
            now,
            sources,
            self._points,
            self._footprint,
            self._first,
            self._final,
            self._bounds,
            self._flags,
            self._queue,
        )

    def _take_angles(self, angles: Floats) -> None:
        self._angles = angles
        self._directions = np.column_stack((np.cos(angles), np.sin(angles)))
        self._points = np.empty((len(angles), 2), dtype=np.float32)

    def _table_for(self, height: float) -> Floats:
        """Return the rows of the sources that take a laser at ``height`` [m]."""
        if height not in self._tables:
            rows = [
                self._row(source, height)
                for source in self._sources
                if source.min_obstacle_height <= height <= source.max_obstacle_height
            ]
            self._tables[height] = np.array(rows, dtype=np.float64).reshape(len(rows), 5)
        return self._tables[height]

    def _row(self, source: ObservationSource, height: float) -> tuple[float, ...]:
        parameters = self._parameters
        marking, clearing = source.obstacle_range, source.raytrace_range
        return (
            parameters.obstacle_range if marking is None else marking,
            parameters.raytrace_range if clearing is None else clearing,
            float(source.marking and height <= parameters.max_obstacle_height),
            float(source.clearing),
            float(source.inf_is_valid),
        )

    def _redo(self, listed: int) -> None:
        """Do the window over; the list of changes is not needed."""
        self._flags[self._queue[:listed]] = 0
        table = self._table
        update_whole_window(
            self._master,
            self._static,
            self._layer,
            self._shape,
            self._window,
            table.costs,
            table.widths,
            table.least,
            self._changed,
        )
        if not self._parameters.rolling_window:
            column_gaps(self._master, self._shape, table.radius, self._gaps)
            self._flags[:] = 0
            self._left = 0

    def _settle(self, listed: int) -> None:
        """Follow the listed changes."""
        self._disturbed[:] = self.grid.disturbed
        table = self._table
        self._left = update_changed_cells(
            self._master,
            self._static,
            self._layer,
            self._gaps,
            self._shape,
            self._window,
            self._disturbed,
            table.costs,
            table.widths,
            table.least,
            self._flags,
            self._queue,
            listed,
            self._left,
            self._changed,
        )


def warm_up() -> None:
    """Update, clear and reset a small global and a small local costmap."""
    source = ObservationSource(data_type="LaserScan", clearing=True)
    still = CostmapParameters(static_map=True, sources=(source,))
    moving = CostmapParameters(rolling_window=True, width=2.0, height=2.0, sources=(source,))
    cells = np.zeros((40, 40), dtype=np.int8)
    cells[30] = 100
    footprint = still.padded_footprint()
    scan = SensedScan(
        Pose2(1.0, 1.0), np.ones(3, dtype=np.float32), np.array([-0.1, 0.0, 0.1]), 0.05, 5.6
    )
    for costmap in (
        Costmap(still, footprint, ORIGINAL, OccupancyGrid(0.05, 0.0, 0.0, cells)),
        Costmap(moving, footprint, ORIGINAL),
    ):
        for sensed in (None, scan):
            costmap.update(Pose2(1.0, 1.0), sensed)
        costmap.clear_square(Pose2(1.0, 1.0), 0.2)
        costmap.update(Pose2(1.0, 1.0), scan)
        costmap.clear_obstacles_outside(Pose2(1.0, 1.0), 0.5)
        costmap.update(Pose2(1.0, 1.0), scan)
