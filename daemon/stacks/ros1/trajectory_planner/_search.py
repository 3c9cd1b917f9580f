"""Search for the best trajectory (``createTrajectories``).

The original follows and scores arcs in turn and keeps the first of the cheapest. Then it tries
turns on the spot; one replaces the best so far if it costs no more and looks nearer to the goal.
If no motion is legal, it tries strafing and at last backs up. Here arcs first get a lower bound of
their cost, without footprints, and are scored in the order of their bounds until no bound can win.
Bounds sum the same terms in the same order as the cost, with a smaller term of the footprint, so
that rounding keeps them below the cost. Ties go to the arc that the original meets first.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.base_local_planner.map_grid import Bits, cell_of, distance_at
from daemon.stacks.ros1.trajectory_planner._rollout import (
    CENTRE,
    COLLIDES,
    RolloutGrid,
    follow_cells,
    score_trajectory,
    simulate_trajectory,
    total_cost,
)
from daemon.stacks.ros1.trajectory_planner._settings import RolloutSettings
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

    ``seeds``, ``passable``, ``standing``, ``targets`` and ``fronts`` are sets of cells as in
    :mod:`daemon.stacks.ros1.base_local_planner.map_grid`. ``standing`` is ``passable`` with the
    cells under the robot; ``columns`` (columns, 2) holds the first and last row under it.
    ``window`` (2, 2) is the dynamic window, ``arcs`` (most, 3) the velocities of arcs and ``lower``
    (most,) bounds of their costs. ``points`` (longest trajectory, 5), ``terms`` and ``best`` are
    a trajectory and its values.
    """

    seeds: Bits
    passable: Bits
    standing: Bits
    targets: Bits
    fronts: Bits
    columns: Integers
    window: Floats
    arcs: Floats
    lower: Floats
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
    """Write the best arc to ``r.best``, if any is legal.

    ``r.window`` is the dynamic window, ``plan`` (poses, 2) the plan near the robot.
    """
    points, terms, arcs, lower = r.points, r.terms, r.arcs, r.lower
    count = list_arcs(r.window, s, arcs)
    points[0, 0], points[0, 1], points[0, 2] = state[0], state[1], state[2]
    points[0, 3], points[0, 4] = math.cos(state[2]), math.sin(state[2])
    # Every arc begins at the robot.
    here = footprint_cost(f.cells, f.frame, f.outline, 1.0, points[0], f.spans)
    if here < 0:
        return
    for k in range(count):
        lower[k] = math.inf
        n = simulate_trajectory(state, arcs[k, 0], arcs[k, 1], arcs[k, 2], s, points)
        if follow_cells(points, n, plan, s, f, terms) == n:
            lower[k] = total_cost(max(terms[CENTRE], float(here)), terms, s)
    cheapest, winner = math.inf, -1
    for _ in range(count):
        first = 0
        for k in range(1, count):
            if lower[k] < lower[first]:
                first = k
        low, lower[first] = lower[first], math.inf
        # Equal bounds must still be scored: an earlier arc wins a tie.
        if low == math.inf or low > cheapest:
            break
        if low == cheapest and first > winner:
            continue
        n = simulate_trajectory(state, arcs[first, 0], arcs[first, 1], arcs[first, 2], s, points)
        cost = score_trajectory(points, n, plan, cheapest, s, f, terms)
        if cost >= 0.0 and (cost < cheapest or first < winner):
            cheapest, winner = cost, first
    if winner >= 0:
        r.best[VX], r.best[VY], r.best[WZ] = arcs[winner, 0], arcs[winner, 1], arcs[winner, 2]
        r.best[COST] = cheapest


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
