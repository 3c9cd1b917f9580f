"""Which sample wins, without following every trajectory.

The original follows and scores every sample in turn and keeps the first of the cheapest. Here a
lower bound of the cost of every sample comes first, from where its trajectory ends; samples are
then scored in the order of their bounds until no bound can win. Bounds sum the same terms in the
same order as the cost, the obstacle term replaced by a smaller one, so that rounding keeps them
below the cost; ties go to the sample the original meets first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.navigation.kernels import Integers, kernel
from daemon.navigation.ros.dwa._footprint import footprint_cost, growth
from daemon.navigation.ros.dwa._plan import Cells, cell_of
from daemon.navigation.ros.dwa._samples import steps_of
from daemon.navigation.ros.dwa._settings import Settings
from daemon.navigation.ros.dwa._trajectory import simulate
from grammars.values import Floats


class Field(NamedTuple):
    """What trajectories are scored on.

    ``frame`` is x, y and resolution of the ``cells``; ``outline`` the footprint, (corners, 2) in
    metres; ``path``, ``goal`` and ``front`` are grid distances, the latter to the goal pushed
    ahead; ``banned`` (6,) the signs of vx, vy, wz that oscillation forbids: negative vx, positive
    vx, and so on; ``spans`` is room for a rasterised footprint.
    """

    cells: Cells
    frame: Floats
    outline: Floats
    path: Integers
    goal: Integers
    front: Integers
    banned: Integers
    spans: Integers


@kernel
def _oscillates(banned: Integers, vx: float, vy: float, wz: float) -> bool:
    return bool(
        (banned[0] and vx < 0.0)
        or (banned[1] and vx > 0.0)
        or (banned[2] and vy < 0.0)
        or (banned[3] and vy > 0.0)
        or (banned[4] and wz < 0.0)
        or (banned[5] and wz > 0.0)
    )


@kernel
def _total(
    obstacle: float, at: int, nose: int, wz: float, aligned: bool, s: Settings, f: Field
) -> float:
    """Sum the critics in the original's order, or return -1 where the end is illegal.

    ``at`` and ``nose`` are the cells of the last pose and of its nose. Critics of weight 0 are
    not asked, so they reject nothing either.
    """
    columns = f.cells.shape[1]
    blocked = f.cells.size
    row, column = at // columns, at % columns
    nose_row, nose_column = nose // columns, nose % columns
    cost = 0.0
    if s.obstacle_scale != 0.0:
        cost += obstacle * s.obstacle_scale
    if s.goal_scale != 0.0:
        cost += f.front[nose_row, nose_column] * s.goal_scale
    if aligned:
        cost += f.path[nose_row, nose_column] * s.path_scale
    if s.path_scale != 0.0:
        steps = f.path[row, column]
        if steps >= blocked:
            return -1.0
        cost += steps * s.path_scale
    if s.goal_scale != 0.0:
        steps = f.goal[row, column]
        if steps >= blocked:
            return -1.0
        cost += steps * s.goal_scale
    if s.twirling_scale != 0.0:
        cost += abs(wz) * s.twirling_scale
    return cost


@kernel
def _nose(x: float, y: float, c: float, d: float, s: Settings, f: Field) -> int:
    rows, columns = f.cells.shape
    return cell_of(x + s.forward * c, y + s.forward * d, f.frame, rows, columns)


@kernel
def _needs_cells(s: Settings) -> bool:
    """Whether a critic of distances is asked at all, which rejects what leaves the window."""
    return s.goal_scale != 0.0 or s.path_scale != 0.0


@kernel
def score(
    points: Floats, n: int, moving: Floats, aligned: bool, limit: float, s: Settings, f: Field
) -> float:
    """Return the cost of a trajectory, negative when it is illegal.

    Gives up with -1 as soon as the cost is above ``limit``. A trajectory without points costs 0,
    as the original has it (``SimpleScoredSamplingPlanner::scoreTrajectory``).
    """
    if n == 0:
        return 0.0
    if _oscillates(f.banned, moving[0], moving[1], moving[2]):
        return -1.0
    rows, columns = f.cells.shape
    blocked = f.cells.size
    cells = _needs_cells(s)
    noses = s.goal_scale != 0.0 or aligned
    at, nose = 0, 0
    for i in range(n if cells else 0):
        at = cell_of(points[i, 0], points[i, 1], f.frame, rows, columns)
        if at < 0:
            return -1.0
        row, column = at // columns, at % columns
        if s.path_scale != 0.0 and f.path[row, column] >= blocked:
            return -1.0
        if s.goal_scale != 0.0 and f.goal[row, column] >= blocked:
            return -1.0
        if noses:
            nose = _nose(points[i, 0], points[i, 1], points[i, 3], points[i, 4], s, f)
            if nose < 0:
                return -1.0
    obstacle = 0.0
    if s.obstacle_scale != 0.0:
        scale = growth(moving[0], moving[1], s)
        inside = not s.perimeter_only
        for i in range(n):
            cost = footprint_cost(f.cells, f.frame, f.outline, scale, points[i], f.spans, inside)
            if cost < 0:
                return -1.0
            if s.sum_scores:
                obstacle += cost
            elif cost > obstacle:
                obstacle = float(cost)
            else:
                continue
            if _total(obstacle, at, nose, moving[2], aligned, s, f) > limit:
                return -1.0
    return _total(obstacle, at, nose, moving[2], aligned, s, f)


@kernel
def _sure(value: float, origin: float, resolution: float, margin: float) -> bool:
    """Whether a coordinate stays in its cell when it moves by ``margin`` [m] either way."""
    cells = (value - origin) / resolution
    rest = cells - math.floor(cells)
    return rest * resolution > margin and (1.0 - rest) * resolution > margin


@kernel
def _arc(heading: Floats, turn: float, steps: int, out: Floats) -> None:
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
def bound(
    state: Floats,
    vx: float,
    vy: float,
    wz: float,
    n: int,
    arc: Floats,
    start: int,
    aligned: bool,
    points: Floats,
    moving: Floats,
    s: Settings,
    f: Field,
) -> float:
    """Return a lower bound of the cost of a sample, infinite when its end is illegal.

    ``arc`` is what :func:`_arc` wrote for n - 1 steps, ``start`` the cost at the first pose. Where
    single precision could put the end into another cell the trajectory is followed.
    """
    rows, columns = f.cells.shape
    dt = s.sim_time / n
    c, d = arc[2], arc[3]
    x = state[0] + dt * (vx * arc[0] - vy * arc[1])
    y = state[1] + dt * (vx * arc[1] + vy * arc[0])
    reach = (abs(vx) + abs(vy)) * s.sim_time
    far = max(abs(state[0]), abs(state[1])) + reach
    turned = (abs(state[2]) + abs(wz) * s.sim_time) * (reach + abs(s.forward))
    margin = 1e-9 + n * 6.1e-8 * (far + turned)
    nose_x, nose_y = x + s.forward * c, y + s.forward * d
    if not (
        s.use_dwa
        and abs(wz) * dt < 1.0
        and _sure(x, f.frame[0], f.frame[2], margin)
        and _sure(y, f.frame[1], f.frame[2], margin)
        and _sure(nose_x, f.frame[0], f.frame[2], margin)
        and _sure(nose_y, f.frame[1], f.frame[2], margin)
    ):
        n = simulate(state, vx, vy, wz, s, points, moving)
        x, y, c, d = points[n - 1, 0], points[n - 1, 1], points[n - 1, 3], points[n - 1, 4]
        nose_x, nose_y = x + s.forward * c, y + s.forward * d
        wz = moving[2]
    at = cell_of(x, y, f.frame, rows, columns)
    nose = cell_of(nose_x, nose_y, f.frame, rows, columns)
    if at < 0 and (s.obstacle_scale != 0.0 or _needs_cells(s)):
        return math.inf
    if nose < 0 and (s.goal_scale != 0.0 or aligned):
        return math.inf
    at = max(at, 0)
    below = max(start, int(f.cells[at // columns, at % columns]))
    total = _total(float(below), at, max(nose, 0), wz, aligned, s, f)
    return math.inf if total < 0.0 else total


@kernel
def bounds(
    state: Floats,
    samples: Floats,
    counts: Integers,
    aligned: bool,
    arcs: Floats,
    points: Floats,
    moving: Floats,
    s: Settings,
    f: Field,
    out: Floats,
) -> None:
    """Write the lower bound of every sample to ``out``, infinite for those that cannot win.

    ``samples`` (3, most) holds the speeds per axis, ``counts`` how many; sample (i, j, k) stands
    at (i * counts[1] + j) * counts[2] + k, the order of the original's loops. ``arcs`` (longest
    trajectory, 5) keeps arcs of one turning speed by the number of points.
    """
    arcs[:, 4] = -1.0
    points[0, 0], points[0, 1], points[0, 2] = state[0], state[1], state[2]
    points[0, 3], points[0, 4] = math.cos(state[2]), math.sin(state[2])
    inside = not s.perimeter_only
    here = footprint_cost(f.cells, f.frame, f.outline, 1.0, points[0], f.spans, inside)
    for k in range(counts[2]):
        wz = samples[2, k]
        for i in range(counts[0]):
            vx = samples[0, i]
            for j in range(counts[1]):
                vy = samples[1, j]
                index = (i * counts[1] + j) * counts[2] + k
                out[index] = math.inf
                n = steps_of(vx, vy, wz, s)
                if n == 0:
                    continue
                normal = growth(vx, vy, s) == 1.0 or not s.use_dwa
                if s.use_dwa and _oscillates(f.banned, vx, vy, wz):
                    continue
                if normal and here < 0 and s.obstacle_scale != 0.0 and s.use_dwa:
                    continue
                if arcs[n, 4] != k:
                    _arc(points[0, 3:5], wz * (s.sim_time / n), n - 1, arcs[n])
                    arcs[n, 4] = k
                start = here if normal and s.use_dwa else 0
                out[index] = bound(
                    state, vx, vy, wz, n, arcs[n], start, aligned, points, moving, s, f
                )


@kernel
def best(
    state: Floats,
    samples: Floats,
    counts: Integers,
    aligned: bool,
    points: Floats,
    moving: Floats,
    s: Settings,
    f: Field,
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
        if low == math.inf or low > cheapest:
            break
        lower[index] = math.inf
        if low == cheapest and index > winner:
            continue
        i, rest = index // (counts[1] * counts[2]), index % (counts[1] * counts[2])
        j, k = rest // counts[2], rest % counts[2]
        n = simulate(state, samples[0, i], samples[1, j], samples[2, k], s, points, moving)
        cost = score(points, n, moving, aligned, cheapest, s, f)
        if cost < 0.0:
            continue
        if cost < cheapest or (cost == cheapest and index < winner):
            cheapest, winner = cost, index
    if winner < 0:
        return 0
    i, rest = winner // (counts[1] * counts[2]), winner % (counts[1] * counts[2])
    j, k = rest // counts[2], rest % counts[2]
    n = simulate(state, samples[0, i], samples[1, j], samples[2, k], s, points, moving)
    answer[:3] = moving
    answer[3], answer[4] = cheapest, winner
    return n
