"""Distances of one control cycle, cells under the robot, and buffers."""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.map_grid import (
    Bits,
    add_cell,
    compute_distances,
    empty_set,
    mark_plan_cells,
    place_of,
    unrestricted_distances,
    write_reach,
    write_single_cell,
)
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.trajectory_planner._rollout import TERMS, RolloutGrid
from daemon.stacks.ros1.trajectory_planner._search import NUDGE, RolloutBuffers, velocity_window
from daemon.stacks.ros1.trajectory_planner._settings import RolloutSettings
from grammars.model.geometry import Floats


@kernel
def add_footprint_cells(
    state: Floats,
    outline: Floats,
    frame: Floats,
    shape: tuple[int, int],
    spans: Integers,
    out: Bits,
) -> None:
    """Add the cells under the robot to ``out`` (base_local_planner ``getFootprintCells``).

    Each column is filled from its first to its last cell of the outline (``spans``, shape
    (columns, 2)). With a corner off the grid only the sides before it count, without the inside;
    with fewer than two corners only the cell of the centre.
    """
    rows, columns = shape
    corners = outline.shape[0]
    if corners < 2:
        row, column = place_of(state[0], state[1], frame, rows, columns)
        if row >= 0:
            add_cell(out, row, column)
        return
    spans[:, 0], spans[:, 1] = rows, -1
    c, d = math.cos(state[2]), math.sin(state[2])
    before_row, before_column = place_of(state[0], state[1], frame, rows, columns)
    for k in range(corners + 1):
        x, y = outline[k % corners, 0], outline[k % corners, 1]
        x, y = x * c - y * d, x * d + y * c
        row, column = place_of(state[0] + x, state[1] + y, frame, rows, columns)
        if row < 0:
            return
        # Bresenham's line as in :func:`line_cost`, cell by cell from its beginning.
        up, across = row - before_row, column - before_column
        length = max(abs(up), abs(across)) if k > 0 else -1
        for i in range(length + 1):
            passed = length // 2 + i * abs(up), length // 2 + i * abs(across)
            y_steps, x_steps = passed[0] // max(length, 1), passed[1] // max(length, 1)
            y_cell = before_row + (y_steps if up >= 0 else -y_steps)
            x_cell = before_column + (x_steps if across >= 0 else -x_steps)
            add_cell(out, y_cell, x_cell)
            spans[x_cell, 0] = min(spans[x_cell, 0], y_cell)
            spans[x_cell, 1] = max(spans[x_cell, 1], y_cell)
        before_row, before_column = row, column
    for column in range(columns):
        for row in range(spans[column, 0], spans[column, 1] + 1):
            add_cell(out, row, column)


@kernel
def fill_distances(
    state: Floats,
    plan: Floats,
    distance: float,
    strafes: Floats,
    s: RolloutSettings,
    f: RolloutGrid,
    r: RolloutBuffers,
) -> None:
    """Fill the distances of ``f`` within the reach of the robot's centre and its look ahead.

    ``r.window`` receives the dynamic window at ``distance`` [m] from the end of the ``plan``. Cells
    under the robot count as free on the way to the path but not to the goal (``findBestPath``
    marks them in one of the two grids). ``r.standing`` must equal ``r.passable`` before.
    """
    velocity_window(state, distance, s, r.window)
    ahead = max(abs(state[3]), abs(r.window[0, 0]), abs(r.window[0, 1]), abs(s.escape_vel))
    sideways = abs(state[4])
    if s.holonomic_robot:
        ahead, sideways = max(ahead, NUDGE), max(sideways, NUDGE)
        for vy in strafes:
            sideways = max(sideways, abs(vy))
    reach = math.hypot(ahead, sideways) * s.sim_time
    shape, columns = f.cells.shape, f.cells.shape[1]
    add_footprint_cells(state, f.outline, f.frame, shape, r.columns, r.standing)
    last = mark_plan_cells(plan, plan[-1], f.cells, f.frame, r.seeds)
    write_reach(state[0], state[1], reach, f.frame, shape, r.targets)
    f.digits[0] = compute_distances(r.seeds, r.standing, r.targets, f.path, r.fronts)
    if last >= 0:
        write_single_cell(last // columns, last % columns, r.seeds)
    write_reach(state[0], state[1], reach + s.heading_lookahead, f.frame, shape, r.targets)
    f.digits[1] = compute_distances(r.seeds, r.passable, r.targets, f.goal, r.fronts)


def allocate_grid(local: CostGrid, settings: RolloutSettings, outline: Floats) -> RolloutGrid:
    """Return the grid of a costmap, with shared cells."""
    shape = local.cells.shape
    rows = 0 if settings.perimeter_only else shape[0]
    return RolloutGrid(
        cells=local.cells,
        frame=np.array((local.x, local.y, local.resolution)),
        outline=outline,
        path=unrestricted_distances(shape),
        goal=unrestricted_distances(shape),
        digits=np.zeros(2, dtype=np.int32),
        spans=np.zeros((rows, 2), dtype=np.int32),
    )


def allocate_buffers(
    shape: tuple[int, ...], settings: RolloutSettings, longest: int
) -> RolloutBuffers:
    """Return buffers for a costmap of ``shape`` and trajectories of up to ``longest`` points."""
    arcs = settings.vx_samples * settings.vtheta_samples + 2
    return RolloutBuffers(
        seeds=empty_set(shape),
        passable=empty_set(shape),
        standing=empty_set(shape),
        targets=empty_set(shape),
        fronts=np.array([empty_set(shape), empty_set(shape)]),
        columns=np.zeros((shape[1], 2), dtype=np.int32),
        window=np.zeros((2, 2)),
        arcs=np.zeros((arcs, 3)),
        lower=np.zeros(arcs),
        points=np.zeros((longest, 5)),
        terms=np.zeros(TERMS),
        best=np.zeros(5),
    )
