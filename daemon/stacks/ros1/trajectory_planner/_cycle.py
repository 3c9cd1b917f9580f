"""The distances one control cycle needs, the cells under the robot, and room to work in."""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.map_grid import (
    Bits,
    add_cell,
    cell_of,
    compute_distances,
    empty_set,
    mark_plan_cells,
    unrestricted_distances,
    write_reach,
    write_single_cell,
)
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.trajectory_planner._rollout import TERMS, RolloutGrid
from daemon.stacks.ros1.trajectory_planner._search import NUDGE, RolloutBuffers
from daemon.stacks.ros1.trajectory_planner._settings import RolloutSettings
from grammars.model.geometry import Floats


@kernel
def _add_line(start: int, end: int, width: int, spans: Integers, out: Bits) -> None:
    """Add the cells of a line to ``out`` (Bresenham as in base_local_planner ``getLineCells``).

    ``spans`` collects the first and last row per column.
    """
    x, y, to_x, to_y = start % width, start // width, end % width, end // width
    dx, dy = abs(to_x - x), abs(to_y - y)
    step_x, step_y = (1 if to_x >= x else -1), (1 if to_y >= y else -1)
    steep = dy > dx
    length, across = (dy, dx) if steep else (dx, dy)
    rest = length // 2
    for _ in range(length + 1):
        add_cell(out, y, x)
        spans[x, 0], spans[x, 1] = min(spans[x, 0], y), max(spans[x, 1], y)
        rest += across
        turn = rest >= length
        if turn:
            rest -= length
        if steep or turn:
            y += step_y
        if turn or not steep:
            x += step_x


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

    Each column from its first to its last cell of the outline. With a corner off the grid only
    the sides before it, and nothing inside; with fewer than two corners the cell of the centre.
    """
    rows, columns = shape
    corners = outline.shape[0]
    if corners < 2:
        at = cell_of(state[0], state[1], frame, rows, columns)
        if at >= 0:
            add_cell(out, at // columns, at % columns)
        return
    spans[:, 0], spans[:, 1] = rows, -1
    c, d = math.cos(state[2]), math.sin(state[2])
    before = -1
    for k in range(corners + 1):
        x, y = outline[k % corners, 0], outline[k % corners, 1]
        at = cell_of(state[0] + (x * c - y * d), state[1] + (x * d + y * c), frame, rows, columns)
        if at < 0:
            return
        if k > 0:
            _add_line(before, at, columns, spans, out)
        before = at
    for column in range(columns):
        for row in range(spans[column, 0], spans[column, 1] + 1):
            add_cell(out, row, column)


@kernel
def _reach(state: Floats, strafes: Floats, s: RolloutSettings, r: RolloutBuffers) -> float:
    """Return how far [m] a trajectory may lead from the robot."""
    ahead = max(abs(state[3]), abs(r.window[0, 0]), abs(r.window[0, 1]), abs(s.escape))
    sideways = abs(state[4])
    if s.holonomic:
        ahead, sideways = max(ahead, NUDGE), max(sideways, NUDGE)
        for vy in strafes:
            sideways = max(sideways, abs(vy))
    return math.hypot(ahead, sideways) * s.sim_time


@kernel
def fill_distances(
    state: Floats,
    plan: Floats,
    m: int,
    strafes: Floats,
    s: RolloutSettings,
    f: RolloutGrid,
    r: RolloutBuffers,
) -> None:
    """Fill the distances of ``f`` as far from the robot as its centre and its look ahead can get.

    What the robot stands on counts as free on the way to the path, not on the way to the goal
    (``findBestPath`` marks it in one of the two grids). ``r.window`` is the dynamic window.
    """
    shape, (x, y) = f.cells.shape, (state[0], state[1])
    r.standing[:] = r.passable
    add_footprint_cells(state, f.outline, f.frame, shape, r.columns, r.standing)
    last = mark_plan_cells(plan, m, plan[m - 1], f.cells, f.frame, r.seeds)
    reach = _reach(state, strafes, s, r)
    write_reach(x, y, reach, f.frame, shape, r.wanted)
    f.digits[0] = compute_distances(r.seeds, r.standing, r.wanted, f.path, r.fronts)
    if last >= 0:
        write_single_cell(last // shape[1], last % shape[1], r.seeds)
    write_reach(x, y, reach + s.lookahead, f.frame, shape, r.wanted)
    f.digits[1] = compute_distances(r.seeds, r.passable, r.wanted, f.goal, r.fronts)


def allocate_grid(local: CostGrid, outline: Floats) -> RolloutGrid:
    """Return the grid of a costmap; its cells are shared with it."""
    shape = local.cells.shape
    return RolloutGrid(
        cells=local.cells,
        frame=np.array((local.x, local.y, local.resolution)),
        outline=outline,
        path=unrestricted_distances(shape),
        goal=unrestricted_distances(shape),
        digits=np.zeros(2, dtype=np.int32),
        spans=np.zeros((shape[0], 2), dtype=np.int32),
    )


def allocate_buffers(
    shape: tuple[int, ...], settings: RolloutSettings, longest: int
) -> RolloutBuffers:
    """Return room for a costmap of ``shape`` and trajectories of up to ``longest`` points."""
    arcs = settings.x_samples * settings.theta_samples + 2
    return RolloutBuffers(
        seeds=empty_set(shape),
        passable=empty_set(shape),
        standing=empty_set(shape),
        wanted=empty_set(shape),
        fronts=np.array([empty_set(shape), empty_set(shape)]),
        columns=np.zeros((shape[1], 2), dtype=np.int32),
        window=np.zeros((2, 2)),
        arcs=np.zeros((arcs, 3)),
        lower=np.zeros(arcs),
        points=np.zeros((longest, 5)),
        terms=np.zeros(TERMS),
        best=np.zeros(5),
    )
