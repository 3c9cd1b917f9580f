"""Which sample wins, without following every trajectory.

The original follows and scores every sample in turn and keeps the first of the cheapest. Here a
lower bound of the cost of every sample comes first, from where its trajectory ends; samples are
then scored in the order of their bounds until no bound can win. Bounds sum the same terms in the
same order as the cost, the obstacle term replaced by a smaller one, so that rounding keeps them
below the cost; ties go to the sample the original meets first.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.base_local_planner.map_grid import cell_of, distance_at
from daemon.stacks.ros1.dwa._parameters import DwaSettings
from daemon.stacks.ros1.dwa._scoring import ScoringGrid, oscillates, score_trajectory, total_cost
from daemon.stacks.ros1.dwa.samples import (
    count_points,
    footprint_scale,
    simulate_trajectory,
    translation_speed,
)
from grammars.model.geometry import Floats


@kernel
def _cell_if_sure(x: float, y: float, frame: Floats, margin: float, rows: int, columns: int) -> int:
    """Return the cell of a point that may be off by ``margin`` [cells], -1 off the grid.

    -2 when the margin reaches into another cell.
    """
    u, v = (x - frame[0]) / frame[2], (y - frame[1]) / frame[2]
    column, row = math.floor(u), math.floor(v)
    if min(u - column, v - row) < margin or max(u - column, v - row) > 1.0 - margin:
        return -2
    if column < 0 or row < 0 or column >= columns or row >= rows:
        return -1
    return int(row) * columns + int(column)


@kernel
def _sum_headings(heading: Floats, turn: float, steps: int, out: Floats) -> None:
    """Write the sum of the headings of ``steps`` Euler steps and the heading after them.

    Headings are unit vectors that start at ``heading`` and turn by ``turn`` each; ``out`` becomes
    sum x, sum y, x, y. A geometric series, so that no step has to be taken.
    """
    half = 0.5 * turn
    ch, sh = math.cos(half), math.sin(half)
    inner = (steps - 1) * half
    ci, si = math.cos(inner), math.sin(inner)
    cm, sm = heading[0] * ci - heading[1] * si, heading[1] * ci + heading[0] * si
    ahead_c, ahead_s = ch * ci - sh * si, sh * ci + ch * si
    length = float(steps) if abs(sh) < 1e-9 else ahead_s / sh
    out[0], out[1] = length * cm, length * sm
    ahead_c, ahead_s = ahead_c * ch - ahead_s * sh, ahead_s * ch + ahead_c * sh
    out[2], out[3] = cm * ahead_c - sm * ahead_s, sm * ahead_c + cm * ahead_s


@kernel
def _rounding_margin(
    state: Floats, speed: float, turn: float, n: int, s: DwaSettings, f: ScoringGrid
) -> float:
    """Return how far [cells] single precision puts a point off within ``n`` steps, at most.

    Every step rounds coordinates and the yaw by half a unit in the last place; ``speed`` and
    ``turn`` are the largest. One cell when trajectories must be followed anyway.
    """
    if not s.use_dwa or s.angular_granularity > 1.0:
        return 1.0
    reach = speed * s.sim_time
    coordinate = max(abs(state[0]), abs(state[1])) + reach
    yaw = abs(state[2]) + turn * s.sim_time
    # 2**-24 is half a unit in the last place of 1.0 in single precision; 2 % and 1e-9 m more for
    # the second order and for the double precision of the prediction itself.
    off = 1e-9 + n * 2.0**-24 * 1.02 * (coordinate + yaw * (reach + abs(s.forward)))
    return float(min(1.0, off / f.frame[2]))


@kernel
def _prepare_pairs(
    samples: Floats, counts: Integers, here: int, s: DwaSettings, f: ScoringGrid, out: Floats
) -> float:
    """Write what all samples of a (vx, vy) share to ``out``, and return the highest speed.

    A row is speed, cost at the first pose, vx, vy. The cost is -1 when no sample of the pair is
    legal; ``here`` is that of the footprint where the robot is. Grown footprints count as 0.
    """
    fastest = 0.0
    for i in range(counts[0]):
        for j in range(counts[1]):
            vx, vy = samples[0, i], samples[1, j]
            pair = i * counts[1] + j
            speed = translation_speed(vx, vy)
            out[pair, 0], out[pair, 1] = speed, 0.0
            out[pair, 2], out[pair, 3] = vx, vy
            if s.use_dwa:
                if footprint_scale(speed, s) == 1.0 and s.obstacle_scale != 0.0:
                    out[pair, 1] = here
                # 1e-4 m/s is the slack of the original's own test (``generateTrajectory``).
                if oscillates(f.banned, vx, vy, 0.0) or speed - 1e-4 > s.max_trans:
                    out[pair, 1] = -1.0
            if out[pair, 1] >= 0.0:
                fastest = max(fastest, speed)
    return fastest


@kernel
def _predict_end_cells(
    state: Floats,
    samples: Floats,
    counts: Integers,
    pairs: Floats,
    arcs: Floats,
    heading: Floats,
    margin: float,
    s: DwaSettings,
    f: ScoringGrid,
    out: Integers,
) -> None:
    """Write the cells where centre and nose of every sample end to ``out``, shape (samples, 2).

    -1 off the grid, -2 where rounding could put it into another cell, -3 for an illegal sample.
    """
    frame, forward, sim_time = f.frame, s.forward, s.sim_time
    rows, columns = f.cells.shape
    number, turns = counts[0] * counts[1], counts[2]
    arcs[:, 4] = -1.0
    # Turning speeds outermost: samples of one turning speed and as many points share an arc.
    for k in range(turns):
        wz = samples[2, k]
        oscillating = s.use_dwa and oscillates(f.banned, 0.0, 0.0, wz)
        for pair in range(number):
            index = pair * turns + k
            out[index, 0] = -3
            if oscillating or pairs[pair, 1] < 0.0:
                continue
            n = count_points(pairs[pair, 0], wz, s)
            if n == 0:
                continue
            dt = sim_time / n
            arc = arcs[n]
            if arc[4] != k:
                _sum_headings(heading, wz * dt, n - 1, arc)
                arc[4] = k
            vx, vy = pairs[pair, 2], pairs[pair, 3]
            x = state[0] + dt * (vx * arc[0] - vy * arc[1])
            y = state[1] + dt * (vx * arc[1] + vy * arc[0])
            out[index, 0] = _cell_if_sure(x, y, frame, margin, rows, columns)
            x, y = x + forward * arc[2], y + forward * arc[3]
            out[index, 1] = _cell_if_sure(x, y, frame, margin, rows, columns)


@kernel
def bound_costs(
    state: Floats,
    samples: Floats,
    counts: Integers,
    weights: Floats,
    pairs: Floats,
    arcs: Floats,
    ends: Integers,
    known: Integers,
    digits: Integers,
    points: Floats,
    moving: Floats,
    s: DwaSettings,
    f: ScoringGrid,
    out: Floats,
) -> None:
    """Write the lower bound of every sample's cost to ``out``, infinite when it cannot win.

    ``samples`` (3, most) holds the speeds per axis, ``counts`` how many; sample (i, j, k) stands
    at (i * counts[1] + j) * counts[2] + k, the order of the original's loops. Room: ``pairs``
    (most, 4) for what all turning speeds share, ``arcs`` (longest trajectory, 5) for what samples
    of one turning speed and number of points share, ``ends`` (samples, 2) and ``known`` (3, cells).
    ``digits`` (3,) is how many digits the distances of path, goal and front use.
    """
    points[0, 0], points[0, 1], points[0, 2] = state[0], state[1], state[2]
    points[0, 3], points[0, 4] = math.cos(state[2]), math.sin(state[2])
    cells, frame, path, goal, front = f.cells, f.frame, f.path, f.goal, f.front
    here = footprint_cost(cells, frame, f.outline, 1.0, points[0], f.spans, not s.perimeter_only)
    fastest = _prepare_pairs(samples, counts, here, s, f, pairs)
    number, turns = counts[0] * counts[1], counts[2]
    turn = max(abs(samples[2, 0]), abs(samples[2, turns - 1]))
    by_speed = fastest * s.sim_time / s.granularity
    most = math.ceil(max(by_speed, turn * s.sim_time / s.angular_granularity))
    margin = _rounding_margin(state, fastest, turn, most, s, f)
    _predict_end_cells(state, samples, counts, pairs, arcs, points[0, 3:5], margin, s, f, ends)
    # One pass over all samples with every lookup cached by cell; taken apart it would hand
    # fifteen arrays from part to part.
    known[:] = -1
    by_path, by_goal, by_front = known[0], known[1], known[2]
    rows, columns = cells.shape
    size = cells.size
    anywhere = weights[0] == 0.0 and weights[3] == 0.0 and weights[4] == 0.0
    noses = weights[1] != 0.0 or weights[2] != 0.0
    strict_path, strict_goal = weights[3] != 0.0, weights[4] != 0.0
    flat = cells.reshape(-1)
    for pair in range(number):
        for k in range(turns):
            index = pair * turns + k
            out[index] = math.inf
            at, nose = ends[index, 0], ends[index, 1]
            if at == -3:
                continue
            wz = samples[2, k]
            if at == -2 or nose == -2:
                vx, vy = pairs[pair, 2], pairs[pair, 3]
                n = simulate_trajectory(state, vx, vy, wz, s, points, moving)
                wz = moving[2]
                x, y = points[n - 1, 0], points[n - 1, 1]
                at = cell_of(x, y, frame, rows, columns)
                x, y = x + s.forward * points[n - 1, 3], y + s.forward * points[n - 1, 4]
                nose = cell_of(x, y, frame, rows, columns)
            if (at < 0 and not anywhere) or (nose < 0 and noses):
                continue
            at, nose = max(at, 0), max(nose, 0)
            from_path = by_path[at]
            if from_path < 0:
                from_path = distance_at(path, at // columns, at % columns, size, digits[0])
                by_path[at] = from_path
            from_goal = by_goal[at]
            if from_goal < 0:
                from_goal = distance_at(goal, at // columns, at % columns, size, digits[1])
                by_goal[at] = from_goal
            if (from_path >= size and strict_path) or (from_goal >= size and strict_goal):
                continue
            ahead = by_front[nose]
            if ahead < 0:
                ahead = distance_at(front, nose // columns, nose % columns, size, digits[2])
                by_front[nose] = ahead
            along = by_path[nose]
            if along < 0:
                along = distance_at(path, nose // columns, nose % columns, size, digits[0])
                by_path[nose] = along
            below = max(int(pairs[pair, 1]), int(flat[at]))
            out[index] = total_cost(float(below), ahead, along, from_path, from_goal, wz, weights)


@kernel
def find_best_sample(
    state: Floats,
    samples: Floats,
    counts: Integers,
    weights: Floats,
    points: Floats,
    moving: Floats,
    s: DwaSettings,
    f: ScoringGrid,
    lower: Floats,
    answer: Floats,
) -> int:
    """Return the number of points of the winning trajectory, 0 when no sample is legal.

    ``lower`` are the bounds, which are used up. ``answer`` (5,) receives the velocity of the
    winner, its cost and its place in the order of the samples; ``points`` its trajectory.
    """
    total = counts[0] * counts[1] * counts[2]
    cheapest, winner = math.inf, -1
    for _ in range(total):
        index = int(np.argmin(lower[:total]))
        low = lower[index]
        # Equal bounds must still be scored: an earlier sample wins a tie.
        if low == math.inf or low > cheapest:
            break
        lower[index] = math.inf
        if low == cheapest and index > winner:
            continue
        i, rest = index // (counts[1] * counts[2]), index % (counts[1] * counts[2])
        j, k = rest // counts[2], rest % counts[2]
        n = simulate_trajectory(
            state, samples[0, i], samples[1, j], samples[2, k], s, points, moving
        )
        cost = score_trajectory(points, n, moving, weights, cheapest, s, f)
        if cost < 0.0:
            continue
        if cost < cheapest or (cost == cheapest and index < winner):
            cheapest, winner = cost, index
    if winner < 0:
        return 0
    i, rest = winner // (counts[1] * counts[2]), winner % (counts[1] * counts[2])
    j, k = rest // counts[2], rest % counts[2]
    # Followed once more: its points were overwritten by the samples scored after it.
    n = simulate_trajectory(state, samples[0, i], samples[1, j], samples[2, k], s, points, moving)
    answer[:3] = moving
    answer[3], answer[4] = cheapest, winner
    return n
