"""A costmap: its layers, the master grid and the update cycle of costmap_2d (Noetic)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache
from typing import Final

import numpy as np

from daemon.model.kernels import machine_code
from daemon.stacks.ros1.cost_grid import EMPTY_WINDOW, FREE_SPACE, NO_INFORMATION, CostGrid, Window
from daemon.stacks.ros1.costmap._grids import OVERDUE, QUEUED, Cells, Frame, Grid, Numbers
from daemon.stacks.ros1.costmap._inflation import (
    column_gaps,
    inflate,
    inflate_in_order,
    inflation_table,
)
from daemon.stacks.ros1.costmap._live_layers import (
    InflatingLayer,
    LiveLayer,
    MapLayer,
    SensedLayer,
    Workspace,
    placed,
    shift_cells,
    show_map,
)
from daemon.stacks.ros1.costmap._observations import Hears, SensedScan
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObstacleLayer,
    StaticLayer,
    inscribed_radius,
)
from daemon.stacks.ros1.costmap.master_grid import (
    Inflated,
    Layers,
    follow_changes,
    list_disturbed,
    list_overdue,
    merge_window,
)
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2
from grammars.model.grid import OccupancyGrid

_NO_CELLS: Final = np.array((1 << 30, 1 << 30, -1, -1))
_IN_PLACE: Final = Pose2()
_NO_INFLATION: Final = InflationLayer(inflation_radius=0.0)


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


# Processes forked from one that has begun a run share the result. It takes half of the time for the
# costmap of the published building.
@lru_cache(maxsize=4)
def _inflated_map(
    below: bytes, frame: Frame, layer: InflationLayer, inscribed: float, in_order: bool
) -> tuple[Cells, Cells]:
    """Return the inflated cells over those ``below``, and their column gaps, for reading only."""
    table = inflation_table(layer, inscribed, frame.resolution)
    master = Grid(np.frombuffer(below, dtype=np.uint8).copy(), frame)
    gaps = np.empty_like(master.cells)
    if table.radius > 0:
        window, changed = (0, 0, frame.columns, frame.rows), np.array(_NO_CELLS)
        (inflate_in_order if in_order else inflate)(master, table, window, changed)
    column_gaps(master, table.radius, gaps)
    return master.cells, gaps


class Costmap:
    """A master grid that follows the robot's lasers.

    The cycle is costmap_2d's: each layer extends the bounds, the cells there are reset, and the
    layers are merged and inflated in their order. Cells outside keep their costs. A fixed grid
    without a layer above its inflation only follows changes, with the same result.

    Attributes:
        grid: the master grid. Others may free cells, as move_base and navfn do, if they ``touch``
            it.
    """

    def __init__(
        self,
        parameters: LayeredCostmap,
        footprint: Floats,
        quirks: Quirks,
        world: OccupancyGrid,
        hears: Hears,
    ) -> None:
        """Prepare the layers; ``footprint`` (k, 2) [m] is padded already.

        ``world`` is the map for static layers. A fixed grid with such a layer takes its size and
        place from it, regardless of its frame. ``hears`` gives the lasers on a topic. Raises
        ``ValueError`` for an inflation radius of more than 250 cells.
        """
        self._rolling, self._quirks = parameters.rolling_window, quirks
        shows_map = any(isinstance(layer, StaticLayer) for layer in parameters.layers)
        if shows_map and not self._rolling:
            min_x, min_y, resolution = world.x, world.y, world.resolution
            rows, columns = world.cells.shape
        else:
            min_x, min_y = parameters.origin_x, parameters.origin_y
            resolution = parameters.resolution
            rows, columns = grid_shape(parameters)
        default = NO_INFORMATION if parameters.track_unknown_space else FREE_SPACE
        cells = np.full(rows * columns, default, dtype=np.uint8)
        frame = Frame(rows, columns, float(min_x), float(min_y), float(resolution))
        self._master = Grid(cells, frame)
        self._work, self._reset = Workspace(rows * columns), False
        self._changed: Numbers = np.empty(4, dtype=np.int64)
        self._inscribed = inscribed_radius(footprint)
        layers: list[LiveLayer] = []
        merged: list[MapLayer | SensedLayer] = []
        own: Cells = np.empty((len(parameters.layers), cells.size), dtype=np.uint8)
        for layer in parameters.layers:
            row = own[len(merged)]
            if isinstance(layer, InflationLayer):
                table = inflation_table(layer, self._inscribed, frame.resolution)
                layers.append(InflatingLayer(layer, table))
            elif isinstance(layer, ObstacleLayer):
                # With the quirk, a layer above the map hides unknown cells unless it tracks them.
                tracks = layer.track_unknown_space or (
                    shows_map and not quirks.unknown_becomes_free
                )
                unseen = NO_INFORMATION if tracks else FREE_SPACE
                grid = Grid(row, frame)
                merged.append(SensedLayer(layer, unseen, footprint, hears, grid, self._work))
                layers.append(merged[-1])
            else:
                map_layer = MapLayer(layer, world, None if self._rolling else row)
                layers.append(map_layer)
                merged += [] if self._rolling else [map_layer]
        self._layers = tuple(layers)
        methods = np.array([layer.method for layer in merged], dtype=np.int32)
        self._merged = Layers(own[: len(merged)], methods, default)
        self._begin()
        self.grid = CostGrid(resolution, min_x, min_y, cells.reshape(rows, columns))
        self.grid.touch((0, 0, columns, rows))
        self.grid.disturbed = EMPTY_WINDOW

    def _begin(self) -> None:
        """Prepare the master for the first cycle, and compile the kernels of a cycle.

        A fixed grid begins inflated if its inflation is the topmost layer. It follows changes only
        if the nearest obstacle decides each cost. With ``inflation_queue_order`` any obstacle of
        the window may matter.
        """
        in_order, master = self._quirks.inflation_queue_order, self._master
        window = (0, 0, master.frame.columns, master.frame.rows)
        last = self._layers[-1] if self._layers else None
        layer = last.layer if isinstance(last, InflatingLayer) else _NO_INFLATION
        table = inflation_table(layer, self._inscribed, master.frame.resolution)
        self._merge = machine_code(merge_window, master, self._merged, window)
        self._inflate = machine_code(
            inflate_in_order if in_order else inflate, master, table, window, self._changed
        )
        self._inflated: Inflated | None = None
        inflating = [isinstance(layer, InflatingLayer) for layer in self._layers]
        whole = any(inflating) or any(isinstance(layer, MapLayer) for layer in self._layers)
        if self._rolling or not whole or any(inflating[:-1]):
            return
        self._merge(master, self._merged, window)
        below = master.cells.tobytes()
        cells, gaps = _inflated_map(below, master.frame, layer, self._inscribed, in_order)
        master.cells[:] = cells
        if in_order and table.radius > 0:
            return
        self._inflated = Inflated(master, table, gaps.copy())
        self._values: Cells = np.empty_like(gaps)
        self._follow = machine_code(
            follow_changes, self._inflated, self._merged, self._work.changes, window,
            self._values, self._changed,
        )  # fmt: skip

    def update(
        self, base: Pose2, scans: Sequence[SensedScan] = (), frame_in_map: Pose2 = _IN_PLACE
    ) -> None:
        """Run one cycle (``updateMap``) with the robot at ``base`` in the costmap's frame.

        ``scans`` are all scans that a source may remember, oldest first, also those of earlier
        cycles. ``frame_in_map`` is the pose of the costmap's frame in map, for static layers of a
        rolling window. Raises ``ValueError`` if a scan's numbers of ranges and angles differ.
        """
        work, changes = self._work, self._work.changes
        # The window rolls first: bounds are in the frame of the moved grid (``updateMap``).
        if self._rolling:
            self._shift(base)
        work.begin(base, scans)
        for layer in self._layers:
            layer.extend_bounds(work)
        window = work.window(self._master.frame)
        self._changed[:] = _NO_CELLS
        if self._inflated is None:
            changes.flags[changes.queue[: changes.counts[QUEUED]]] = 0
            changes.counts[QUEUED] = 0
            self._redo(window, frame_in_map)
        elif self._reset:
            # After a reset the window is the whole grid.
            self._redo(window, frame_in_map)
            column_gaps(self._master, self._inflated.table.radius, self._inflated.gaps)
            changes.flags[:] = 0
            changes.counts[:] = 0
            self._reset = False
        else:
            self._follow_changes(self._inflated, window)
        x0, y0, x1, y1 = self._changed.tolist()
        self.grid.touch((x0, y0, x1, y1))
        self.grid.disturbed = EMPTY_WINDOW

    def _redo(self, window: Window, frame_in_map: Pose2) -> None:
        """Recompute the window, layer by layer."""
        if not self._layers or window[0] >= window[2] or window[1] >= window[3]:
            return
        self._changed[:] = window
        master, (cells, methods, default) = self._master, self._merged
        x0, y0, x1, y1 = window
        self.grid.cells[y0:y1, x0:x1] = default
        row = 0
        for layer in self._layers:
            if isinstance(layer, InflatingLayer):
                if layer.table.radius > 0:
                    self._inflate(master, layer.table, window, self._changed)
            elif isinstance(layer, MapLayer) and self._rolling:
                show_map(master, window, layer.grid, placed(frame_in_map), layer.maximum)
            else:
                own = Layers(cells[row : row + 1], methods[row : row + 1], default)
                self._merge(master, own, window)
                row += 1

    def _follow_changes(self, master: Inflated, window: Window) -> None:
        """Merge and inflate the changed cells only, with the result of a whole window."""
        changes = self._work.changes
        if self.grid.disturbed != EMPTY_WINDOW:
            list_disturbed(master, changes, self.grid.disturbed)
        if changes.counts[OVERDUE] > 0:
            list_overdue(master, changes, window)
        self._follow(master, self._merged, changes, window, self._values, self._changed)

    def clear_square(self, base: Pose2, half: float) -> None:
        """Set the master free in a square of ``half`` its side [m] around ``base``.

        The layers keep their obstacles (move_base ``clearCostmapWindows``). A corner off the grid
        prevents it.
        """
        first = self.grid.cell(base.x - half, base.y - half)
        last = self.grid.cell(base.x + half, base.y + half)
        if first is None or last is None:
            return
        (x0, y0), (x1, y1) = first, last
        self.grid.cells[y0 : y1 + 1, x0 : x1 + 1] = FREE_SPACE
        self.grid.touch((x0, y0, x1 + 1, y1 + 1))

    def clear_layers(
        self, base: Pose2, side: float, names: Collection[str] | None, *, inside: bool = False
    ) -> tuple[str, ...]:
        """Clear layers outside (or ``inside``) a square of ``side`` [m] at ``base``.

        ``names`` selects layers, also static ones; without it all layers of lasers are cleared.
        Inflation layers have no content. Returns the names of the cleared layers. The master
        follows with the next update (clear_costmap_recovery).
        """
        cleared = []
        for layer in self._layers:
            name = layer.name.rsplit("/", 1)[-1]
            if isinstance(layer, InflatingLayer) or (names is not None and name not in names):
                continue
            if names is None and not isinstance(layer, SensedLayer):
                continue
            layer.clear(base, side, inside=inside)
            cleared.append(name)
            self._reset = True
        return tuple(cleared)

    def _shift(self, base: Pose2) -> None:
        """Move the window by whole cells and keep the cells in both."""
        rows, columns, min_x, min_y, resolution = self._master.frame
        # costmap_2d takes the centre of the last cell for the size.
        x = base.x - (columns - 0.5) * resolution / 2.0
        y = base.y - (rows - 0.5) * resolution / 2.0
        whole = int if self._quirks.truncated_window_shift else round
        right, up = whole((x - min_x) / resolution), whole((y - min_y) / resolution)
        if right == 0 and up == 0:
            return
        x, y = min_x + right * resolution, min_y + up * resolution
        frame = self._master.frame._replace(x=x, y=y)
        shift_cells(self._master.cells, frame, right, up, self._merged.default)
        self._master = Grid(self._master.cells, frame)
        for layer in self._layers:
            if isinstance(layer, SensedLayer):
                layer.shift(frame, right, up)
        self.grid.x, self.grid.y = frame.x, frame.y
        self.grid.touch((0, 0, columns, rows))
