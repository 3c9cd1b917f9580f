"""Search for the best sample, without following every trajectory.

The original follows and scores every sample in turn and keeps the first of the cheapest. Here the
end of each trajectory first gives a lower bound of its cost. Samples are then scored in the order
of their bounds until no bound can win. Bounds sum the same terms in the same order as the cost,
with a smaller obstacle term, so that rounding keeps them below the cost. Ties go to the sample that
the original meets first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.base_local_planner.map_grid import cell_of, distance_at
from daemon.stacks.ros1.dwa._scoring import (
    FRONT,
    GOAL,
    PATH,
    ScoringGrid,
    oscillates,
    score_trajectory,
    total_cost,
)
from daemon.stacks.ros1.dwa.samples import (
    SLACK,
    DwaSettings,
    footprint_scale,
    points_for_turn,
    points_for_way,
    simulate_trajectory,
    translation_speed,
)
from grammars.model.geometry import Floats


class SearchBuffers(NamedTuple):
    """Buffers of a search, allocated once: every cycle overwrites them.

    ``samples`` (3, most) holds the speeds per axis, ``counts`` (3,) their numbers. Sample (i, j, k)
    has the index (i * counts[1] + j) * counts[2] + k, the order of the original's loops. ``pairs``
    (most, 5) holds shared values of all turning speeds of an (i, j), ``arcs`` (longest trajectory,
    5) those of samples with one turning speed and number of points. ``ends`` (all samples, 2) are
    the cells where samples end, ``by_cell`` (3, cells) distances by cell. ``lower`` (all samples)
    are the bounds, ``least`` (most,) the smallest of each (i, j). ``points`` (longest trajectory,
    5) and ``moving`` (3,) are a trajectory and its velocity. ``answer`` (5,) is the velocity of the
    winner, its cost and its index.
    """

    samples: Floats
    counts: Integers
    pairs: Floats
    arcs: Floats
    ends: Integers
    by_cell: Integers
    lower: Floats
    least: Floats
    points: Floats
    moving: Floats
    answer: Floats


def allocate_buffers(shape: tuple[int, ...], settings: DwaSettings, longest: int) -> SearchBuffers:
    """Return buffers for a costmap of ``shape`` and trajectories of up to ``longest`` points."""
    s = settings
    numbers = [max(2, n) + 1 for n in (s.vx_samples, s.vy_samples, s.vth_samples)]
    pairs, most = numbers[0] * numbers[1], math.prod(numbers)
    return SearchBuffers(
        samples=np.zeros((3, max(numbers))),
        counts=np.zeros(3, dtype=np.int32),
        pairs=np.zeros((pairs, 5)),
        arcs=np.zeros((longest, 5)),
        ends=np.zeros((most, 2), dtype=np.int32),
        by_cell=np.zeros((3, shape[0] * shape[1]), dtype=np.int32),
        lower=np.zeros(most),
        least=np.zeros(pairs),
        points=np.zeros((longest, 5)),
        moving=np.zeros(3),
        answer=np.zeros(5),
    )


@kernel
def _cell_if_sure(u: float, v: float, margin: float, rows: int, columns: int) -> int:
    """Return the cell of a point in units of cells that may be off by ``margin``, -1 off the grid.

    Returns -2 if the margin reaches another cell, always for a margin of a cell or more.
    """
    if u >= 0.0 and v >= 0.0:
        # Truncation is faster than rounding down, and equal here.
        column, row = int(u), int(v)
        across, up = u - column, v - row
        if margin < across < 1.0 - margin and margin < up < 1.0 - margin:
            return row * columns + column if column < columns and row < rows else -1
    beyond = u + margin < 0.0 or v + margin < 0.0 or u - margin >= columns or v - margin >= rows
    return -1 if beyond and margin < 1.0 else -2


@kernel
def _sum_headings(
    x: float, y: float, cw: float, sw: float, turn: float, steps: int
) -> tuple[float, float, float, float]:
    """Return the sum of the headings of ``steps`` Euler steps and the heading after them.

    Headings are unit vectors that start at (``x``, ``y``) and turn by ``turn`` each, at most 1 rad;
    ``cw`` and ``sw`` are cosine and sine of half of ``steps`` + 1 turns. The sum is a geometric
    series.
    """
    half = 0.5 * turn
    q = half * half
    # Taylor series up to the 12th power: up to 0.5 rad the error is 1e-13, without a library call.
    s3, s5, s7, s9, s11 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800
    c2, c4, c6, c8, c10, c12 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800, 1 / 479001600
    sh = half * (1.0 + q * (s3 + q * (s5 + q * (s7 + q * (s9 + q * s11)))))
    ch = 1.0 + q * (c2 + q * (c4 + q * (c6 + q * (c8 + q * (c10 + q * c12)))))
    # Half of all turns is half a turn less; the middle heading lies another half turn before.
    ca, sa = cw * ch + sw * sh, sw * ch - cw * sh
    cm, sm = ca * ch + sa * sh, sa * ch - ca * sh
    length = float(steps) if abs(sh) < 1e-9 else sa / sh
    mx, my = x * cm - y * sm, y * cm + x * sm
    # The heading after the last step lies half of all turns and half a turn after the middle.
    return length * mx, length * my, mx * cw - my * sw, my * cw + mx * sw


@kernel
def _rounding_slope(
    state: Floats, speed: float, turn: float, resolution: float, s: DwaSettings
) -> float:
    """Return the largest error [cells] of a point per step in single precision.

    Every step rounds coordinates and the yaw by half a unit in the last place; ``speed`` and
    ``turn`` are the largest. Returns one cell if trajectories must be followed anyway.
    """
    if not s.use_dwa or s.angular_sim_granularity > 1.0:
        return 1.0
    reach = speed * s.sim_time
    coordinate = max(abs(state[0]), abs(state[1])) + reach
    yaw = abs(state[2]) + turn * s.sim_time
    # 2**-24 is half a unit in the last place of 1.0 in single precision; 2 % more for the second
    # order.
    off = 2.0**-24 * 1.02 * (coordinate + yaw * (reach + abs(s.forward_point_distance)))
    return float(off / resolution)


@kernel
def _prepare_pairs(
    samples: Floats, counts: Integers, here: int, banned: Integers, s: DwaSettings, out: Floats
) -> float:
    """Write the shared values of all samples of a (vx, vy) to ``out``; return the highest speed.

    A row is the number of points for the way, cost at the first pose, vx, vy, and 1.0 if the pair
    is legal only with a turn. The cost is -1 if no sample of the pair is legal. ``here`` is the
    cost of the footprint at the robot. Grown footprints count as 0.
    """
    fastest = 0.0
    for i in range(counts[0]):
        for j in range(counts[1]):
            vx, vy = samples[0, i], samples[1, j]
            pair = i * counts[1] + j
            speed = translation_speed(vx, vy)
            out[pair, 0], out[pair, 1] = points_for_way(speed, s), 0.0
            out[pair, 2], out[pair, 3] = vx, vy
            out[pair, 4] = 1.0 if speed + SLACK < s.min_vel_trans else 0.0
            if s.use_dwa:
                if footprint_scale(speed, s) == 1.0 and s.occdist_scale != 0.0:
                    out[pair, 1] = here
                if oscillates(banned, vx, vy, 0.0):
                    out[pair, 1] = -1.0
            if speed - SLACK > s.max_vel_trans:
                out[pair, 1] = -1.0
            if out[pair, 1] >= 0.0:
                fastest = max(fastest, speed)
    return fastest


@kernel
def _predict_end_cells(state: Floats, s: DwaSettings, f: ScoringGrid, r: SearchBuffers) -> None:
    """Write the cells where centre and nose of every sample end to ``r.ends``.

    -1 off the grid, -2 where rounding could put it into another cell, -3 for an illegal sample.
    """
    points, samples, pairs, arcs, ends = r.points, r.samples, r.pairs, r.arcs, r.ends
    points[0, 0], points[0, 1], points[0, 2] = state[0], state[1], state[2]
    x0, y0 = math.cos(state[2]), math.sin(state[2])
    points[0, 3], points[0, 4] = x0, y0
    here = footprint_cost(f.cells, f.frame, f.outline, 1.0, points[0], f.spans)
    fastest = _prepare_pairs(samples, r.counts, here, f.banned, s, pairs)
    rows, columns = f.cells.shape
    forward = s.forward_point_distance
    number, turns = r.counts[0] * r.counts[1], r.counts[2]
    turn = max(abs(samples[2, 0]), abs(samples[2, turns - 1]))
    slope = _rounding_slope(state, fastest, turn, f.frame[2], s)
    by_cell = 1.0 / f.frame[2]
    u0, v0 = (state[0] - f.frame[0]) * by_cell, (state[1] - f.frame[1]) * by_cell
    # More than the rounding of the prediction itself in double precision.
    least = 1e-9 * by_cell
    arcs[:, 4] = -1.0
    # Turning speeds outermost: samples of one turning speed and as many points share an arc.
    for k in range(turns):
        wz = samples[2, k]
        oscillating = s.use_dwa and oscillates(f.banned, 0.0, 0.0, wz)
        slow, turning = abs(wz) + SLACK < s.min_vel_theta, points_for_turn(wz, s)
        cw, sw = math.cos(0.5 * wz * s.sim_time), math.sin(0.5 * wz * s.sim_time)
        for pair in range(number):
            index = pair * turns + k
            ends[index, 0] = -3
            if oscillating or pairs[pair, 1] < 0.0 or (slow and pairs[pair, 4] != 0.0):
                continue
            n = int(max(pairs[pair, 0], turning))
            if n == 0:
                continue
            if arcs[n, 4] != k:
                dt = s.sim_time / n
                x, y, c, d = _sum_headings(x0, y0, cw, sw, wz * dt, n - 1)
                arcs[n, 0], arcs[n, 1] = x * dt * by_cell, y * dt * by_cell
                arcs[n, 2], arcs[n, 3] = c * forward * by_cell, d * forward * by_cell
                arcs[n, 4] = k
            margin = min(1.0, least + n * slope)
            vx, vy = pairs[pair, 2], pairs[pair, 3]
            u = u0 + (vx * arcs[n, 0] - vy * arcs[n, 1])
            v = v0 + (vx * arcs[n, 1] + vy * arcs[n, 0])
            ends[index, 0] = _cell_if_sure(u, v, margin, rows, columns)
            u, v = u + arcs[n, 2], v + arcs[n, 3]
            ends[index, 1] = _cell_if_sure(u, v, margin, rows, columns)


@kernel
def _bound_costs(
    state: Floats, weights: Floats, s: DwaSettings, f: ScoringGrid, r: SearchBuffers
) -> None:
    """Write the lower bound of every sample's cost to ``r.lower``, infinite if it cannot win.

    Also write the smallest bound of each (i, j) to ``r.least``.
    """
    cells, frame, digits = f.cells, f.frame, f.digits
    path, goal, front = f.distances[PATH], f.distances[GOAL], f.distances[FRONT]
    samples, pairs, ends, out = r.samples, r.pairs, r.ends, r.lower
    points, moving, forward = r.points, r.moving, s.forward_point_distance
    number, turns = r.counts[0] * r.counts[1], r.counts[2]
    # One pass over all samples with every look-up cached by cell; several functions would have to
    # pass fifteen arrays.
    r.by_cell[:] = -1
    by_path, by_goal, by_front = r.by_cell[0], r.by_cell[1], r.by_cell[2]
    rows, columns = cells.shape
    size = cells.size
    anywhere = weights[0] == 0.0 and weights[3] == 0.0 and weights[4] == 0.0
    noses = weights[1] != 0.0 or weights[2] != 0.0
    strict_path, strict_goal = weights[3] != 0.0, weights[4] != 0.0
    twirling = weights[5] != 0.0
    flat = cells.reshape(-1)
    for pair in range(number):
        smallest = bound = math.inf
        last_at = last_nose = -3
        for k in range(turns):
            index = pair * turns + k
            at, nose = ends[index, 0], ends[index, 1]
            if at == -3:
                out[index] = math.inf
                continue
            wz = samples[2, k]
            if at == -2 or nose == -2:
                vx, vy = pairs[pair, 2], pairs[pair, 3]
                n = simulate_trajectory(state, vx, vy, wz, s, points, moving)
                wz = moving[2]
                x, y = points[n - 1, 0], points[n - 1, 1]
                at = cell_of(x, y, frame, rows, columns)
                x, y = x + forward * points[n - 1, 3], y + forward * points[n - 1, 4]
                nose = cell_of(x, y, frame, rows, columns)
            # Samples of neighbouring turning speeds usually end in the same cells.
            if at == last_at and nose == last_nose and not twirling:
                out[index] = bound
                continue
            last_at, last_nose = at, nose
            out[index] = bound = math.inf
            if (at < 0 and not anywhere) or (nose < 0 and noses):
                continue
            at, nose = max(at, 0), max(nose, 0)
            from_path = by_path[at]
            if from_path < 0:
                from_path = distance_at(path, at // columns, at % columns, size, digits[PATH])
                by_path[at] = from_path
            from_goal = by_goal[at]
            if from_goal < 0:
                from_goal = distance_at(goal, at // columns, at % columns, size, digits[GOAL])
                by_goal[at] = from_goal
            if (from_path >= size and strict_path) or (from_goal >= size and strict_goal):
                continue
            ahead = by_front[nose]
            if ahead < 0:
                ahead = distance_at(front, nose // columns, nose % columns, size, digits[FRONT])
                by_front[nose] = ahead
            along = by_path[nose]
            if along < 0:
                along = distance_at(path, nose // columns, nose % columns, size, digits[PATH])
                by_path[nose] = along
            below = max(int(pairs[pair, 1]), int(flat[at]))
            bound = total_cost(float(below), ahead, along, from_path, from_goal, wz, weights)
            out[index] = bound
            smallest = min(smallest, bound)
        r.least[pair] = smallest


@kernel
def _first_smallest(values: Floats, begin: int, end: int) -> int:
    """Return the first index of the smallest of ``values`` from ``begin`` to ``end``."""
    best = begin
    for k in range(begin + 1, end):
        if values[k] < values[best]:
            best = k
    return best


@kernel
def find_best_sample(
    state: Floats, weights: Floats, s: DwaSettings, f: ScoringGrid, r: SearchBuffers
) -> int:
    """Return the number of points of the winning trajectory, 0 if no sample is legal.

    ``state`` is x, y, yaw, vx, vy, wz in single precision. ``r`` holds the samples and receives the
    answer and the trajectory. The bounds of followed samples become infinite.
    """
    _predict_end_cells(state, s, f, r)
    _bound_costs(state, weights, s, f, r)
    samples, lower, points, moving = r.samples, r.lower, r.points, r.moving
    sideways, turns = r.counts[1], r.counts[2]
    number, least = r.counts[0] * sideways, r.least
    cheapest, winner, followed, n = math.inf, -1, -1, 0
    while True:
        pair = _first_smallest(least, 0, number)
        low = least[pair]
        if low == math.inf or low > cheapest:
            break
        index = _first_smallest(lower, pair * turns, (pair + 1) * turns)
        # An earlier sample wins a tie, so equal bounds must still be scored up to the winner.
        if low == cheapest and index > winner:
            break
        lower[index] = math.inf
        least[pair] = lower[_first_smallest(lower, pair * turns, (pair + 1) * turns)]
        vx, vy = samples[0, pair // sideways], samples[1, pair % sideways]
        n = simulate_trajectory(state, vx, vy, samples[2, index % turns], s, points, moving)
        followed = index
        cost = score_trajectory(points, n, moving, weights, cheapest, s, f)
        if cost < 0.0:
            continue
        if cost < cheapest or (cost == cheapest and index < winner):
            cheapest, winner = cost, index
    if winner < 0:
        return 0
    if winner != followed:
        # Samples scored later have overwritten its points.
        pair, k = winner // turns, winner % turns
        vx, vy = samples[0, pair // sideways], samples[1, pair % sideways]
        n = simulate_trajectory(state, vx, vy, samples[2, k], s, points, moving)
    for axis in range(3):
        r.answer[axis] = moving[axis]
    r.answer[3], r.answer[4] = cheapest, winner
    return n
