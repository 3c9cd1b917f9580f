"""Search for the best trajectory (``createTrajectories``), and the distances it needs.

It follows and scores arcs in turn and keeps the first of the cheapest. Then it tries turns on the
spot; one replaces the best so far if it costs no more and looks nearer to the goal. If no motion is
legal, it tries strafing and at last backs up.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.map_grid import (
    Bits,
    add_cell,
    cell_of,
    compute_distances,
    distance_at,
    empty_set,
    mark_plan_cells,
    place_of,
    unrestricted_distances,
    write_reach,
    write_single_cell,
)
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.trajectory_planner._rollout import (
    COLLIDES,
    TERMS,
    RolloutGrid,
    RolloutSettings,
    score_trajectory,
    simulate_trajectory,
)
from grammars.model.geometry import Floats

NUDGE: Final = 0.1
"""[m/s] Speed ahead and sideways of the two arcs that strafe a little."""
NO_RIGHT_TURN, NO_LEFT_TURN, NO_LEFT_STRAFE, NO_RIGHT_STRAFE = range(4)
"""Indices of the flags of oscillation (the original's ``stuck_left``, ``stuck_right``,
``stuck_left_strafe`` and ``stuck_right_strafe``)."""
VX, VY, WZ, COST, AHEAD = range(5)
"""Indices of the values of the best trajectory; the last is the distance of its look ahead to the
goal."""
NO_BEST: Final = (0.0, 0.0, 0.0, COLLIDES, math.inf)
"""Values without a legal trajectory."""


class RolloutBuffers(NamedTuple):
    """Buffers of a search, allocated once: every cycle overwrites them.

    ``passable`` is a set of cells as in :mod:`daemon.stacks.ros1.base_local_planner.map_grid`.
    ``window`` (2, 2) is the dynamic window, ``arcs`` (most, 3) are the velocities of arcs.
    ``points`` (longest trajectory, 5), ``terms`` and ``best`` are a trajectory and its values.
    """

    passable: Bits
    window: Floats
    arcs: Floats
    points: Floats
    terms: Floats
    best: Floats


@kernel
def velocity_window(state: Floats, distance: float, s: RolloutSettings, out: Floats) -> None:
    """Write the lowest and highest speeds ahead and of turning to ``out``, shape (2, 2).

    ``distance`` [m] is that to the end of the local plan. The lowest turning speed may exceed the
    highest if the robot is faster than its limits.
    """
    reach = s.period if s.dwa else s.sim_time
    most = min(s.max_vel_x, distance / s.sim_time)
    out[0, 0] = max(s.min_vel_x, state[3] - s.acc_lim_x * reach)
    out[0, 1] = max(min(most, state[3] + s.acc_lim_x * reach), s.min_vel_x)
    out[1, 0] = max(s.min_vel_theta, state[5] - s.acc_lim_theta * reach)
    out[1, 1] = min(s.max_vel_theta, state[5] + s.acc_lim_theta * reach)


@kernel
def add_footprint_cells(
    state: Floats,
    outline: Floats,
    frame: Floats,
    shape: tuple[int, int],
    out: Bits,
) -> None:
    """Add the cells under the robot to ``out`` (base_local_planner ``getFootprintCells``).

    Each column is filled from its first to its last cell of the outline. With a corner off the grid
    only the sides before it count, without the inside; with fewer than two corners only the cell of
    the centre.
    """
    rows, columns = shape
    corners = outline.shape[0]
    if corners < 2:
        row, column = place_of(state[0], state[1], frame, rows, columns)
        if row >= 0:
            add_cell(out, row, column)
        return
    spans = np.empty((columns, 2), dtype=np.int32)
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
    marks them in one of the two grids).
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
    seeds, targets = np.empty_like(r.passable), np.empty_like(r.passable)
    standing = r.passable.copy()
    add_footprint_cells(state, f.outline, f.frame, shape, standing)
    last = mark_plan_cells(plan, plan[-1], f.cells, f.frame, seeds)
    write_reach(state[0], state[1], reach, f.frame, shape, targets)
    f.digits[0] = compute_distances(seeds, standing, targets, f.path)
    if last >= 0:
        write_single_cell(last // columns, last % columns, seeds)
    write_reach(state[0], state[1], reach + s.heading_lookahead, f.frame, shape, targets)
    f.digits[1] = compute_distances(seeds, r.passable, targets, f.goal)


@kernel
def _turn_step(window: Floats, s: RolloutSettings) -> float:
    """Return the step between turning speeds; infinite for a single sample, as in C++."""
    width = window[1, 1] - window[1, 0]
    if s.vtheta_samples > 1:
        return float(width / (s.vtheta_samples - 1))
    return math.inf if width >= 0.0 else -math.inf


@kernel
def list_arcs(window: Floats, s: RolloutSettings, out: Floats) -> int:
    """Write the velocities of all arcs to ``out``, shape (most, 3), and return their number.

    For every speed ahead: straight on, then all turning speeds except the highest. Speeds are
    summed up step by step, with the original's rounding.
    """
    step = 0.0
    if s.vx_samples > 1:
        step = (window[0, 1] - window[0, 0]) / (s.vx_samples - 1)
    turn = _turn_step(window, s)
    n = 0
    vx = window[0, 0]
    for _ in range(s.vx_samples):
        out[n, 0], out[n, 1], out[n, 2] = vx, 0.0, 0.0
        n += 1
        wz = window[1, 0]
        for _ in range(s.vtheta_samples - 1):
            out[n, 0], out[n, 1], out[n, 2] = vx, 0.0, wz
            n += 1
            wz += turn
        vx += step
    if s.holonomic_robot:
        for side in (NUDGE, -NUDGE):
            out[n, 0], out[n, 1], out[n, 2] = NUDGE, side, 0.0
            n += 1
    return n


@kernel
def find_best_arc(
    state: Floats, plan: Floats, s: RolloutSettings, f: RolloutGrid, r: RolloutBuffers
) -> None:
    """Write the best arc to ``r.best``, if any is legal: the first of the cheapest.

    ``r.window`` is the dynamic window, ``plan`` (poses, 2) the plan near the robot.
    """
    arcs, best = r.arcs, r.best
    cheapest = math.inf
    for k in range(list_arcs(r.window, s, arcs)):
        n = simulate_trajectory(state, arcs[k, 0], arcs[k, 1], arcs[k, 2], s, r.points)
        cost = score_trajectory(r.points, n, plan, cheapest, s, f, r.terms)
        if 0.0 <= cost < cheapest:
            cheapest = cost
            best[VX], best[VY], best[WZ], best[COST] = arcs[k, 0], arcs[k, 1], arcs[k, 2], cost


@kernel
def _try_on_the_spot(
    state: Floats,
    vy: float,
    wz: float,
    plan: Floats,
    s: RolloutSettings,
    f: RolloutGrid,
    r: RolloutBuffers,
) -> None:
    """Take a turn on the spot or a strafe as the best if it looks nearer to the goal.

    It must not cost more than the best so far, unless that strafes or does not exist.
    """
    n = simulate_trajectory(state, 0.0, vy, wz, s, r.points)
    rows, columns = f.cells.shape
    end = r.points[n - 1]
    x, y = end[0] + s.heading_lookahead * end[3], end[1] + s.heading_lookahead * end[4]
    ahead = cell_of(x, y, f.frame, rows, columns)
    if ahead < 0:
        return
    distance = distance_at(f.goal, ahead // columns, ahead % columns, f.cells.size, f.digits[1])
    if distance >= r.best[AHEAD]:
        return
    limit = math.inf if r.best[COST] < 0.0 else r.best[COST]
    if vy == 0.0 and r.best[VY] != 0.0:
        limit = math.inf
    cost = score_trajectory(r.points, n, plan, limit, s, f, r.terms)
    if cost >= 0.0:
        r.best[VX], r.best[VY], r.best[WZ] = 0.0, vy, wz
        r.best[COST], r.best[AHEAD] = cost, distance


@kernel
def find_best(
    state: Floats,
    plan: Floats,
    forbidden: Integers,
    strafes: Floats,
    s: RolloutSettings,
    f: RolloutGrid,
    r: RolloutBuffers,
) -> int:
    """Write the best trajectory to ``r.points``; return its number of points, 0 for none.

    ``r.best`` holds the best arc and receives the best of all. This tries turns on the spot, and
    strafes if nothing else is legal. ``forbidden`` (4,) are the flags of oscillation, ``strafes``
    the speeds of strafing.
    """
    best, window = r.best, r.window
    turn = _turn_step(window, s)
    wz = window[1, 0]
    for _ in range(s.vtheta_samples):
        # Slow turns are skipped before they are raised to the slowest possible one.
        if wz > turn or wz < -turn:
            if wz < 0.0 and not forbidden[NO_RIGHT_TURN]:
                _try_on_the_spot(state, 0.0, min(wz, -s.slowest_turn), plan, s, f, r)
            elif wz > 0.0 and not forbidden[NO_LEFT_TURN]:
                _try_on_the_spot(state, 0.0, max(wz, s.slowest_turn), plan, s, f, r)
        wz += turn
    if best[COST] < 0.0 and s.holonomic_robot:
        for vy in strafes:
            if (vy > 0.0 and not forbidden[NO_LEFT_STRAFE]) or (
                vy < 0.0 and not forbidden[NO_RIGHT_STRAFE]
            ):
                _try_on_the_spot(state, vy, 0.0, plan, s, f, r)
    if best[COST] < 0.0:
        return 0
    # Follow it once more, because trajectories scored later have overwritten its points.
    return simulate_trajectory(state, best[VX], best[VY], best[WZ], s, r.points)


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
        passable=empty_set(shape),
        window=np.zeros((2, 2)),
        arcs=np.zeros((arcs, 3)),
        points=np.zeros((longest, 5)),
        terms=np.zeros(TERMS),
        best=np.zeros(5),
    )
