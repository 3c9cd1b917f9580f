"""One sampling cycle from the plan to the winner, in one call of machine code."""

from __future__ import annotations

import math
from typing import NamedTuple

from daemon.navigation.kernels import Integers, kernel
from daemon.navigation.ros.dwa._distances import Bits, box, only, spread_out
from daemon.navigation.ros.dwa._plan import walk
from daemon.navigation.ros.dwa._samples import spread, window
from daemon.navigation.ros.dwa._score import Field, score, weigh
from daemon.navigation.ros.dwa._search import best, bounds
from daemon.navigation.ros.dwa._settings import Settings
from daemon.navigation.ros.dwa._trajectory import simulate
from grammars.values import Floats


class Room(NamedTuple):
    """Room to work in, allocated once: every cycle overwrites it.

    ``seeds``, ``passable``, ``wanted`` and ``fronts`` are sets of cells as :mod:`._distances` has
    them; ``speeds`` (3, 2) the dynamic window; ``samples`` (3, most), ``counts`` (3,), ``weights``
    (6,), ``pairs`` (most, 4), ``ends`` (all samples, 2), ``known`` (3, cells), ``digits`` (3,),
    ``lower`` (all samples), ``arcs`` and ``points`` (longest trajectory, 5), ``moving`` (3,) and
    ``answer`` (5,) as :mod:`._search` has them.
    """

    seeds: Bits
    passable: Bits
    wanted: Bits
    fronts: Bits
    speeds: Floats
    samples: Floats
    counts: Integers
    weights: Floats
    pairs: Floats
    ends: Integers
    known: Integers
    digits: Integers
    lower: Floats
    arcs: Floats
    points: Floats
    moving: Floats
    answer: Floats


@kernel
def _reach(state: Floats, r: Room, s: Settings) -> float:
    """Return how far [m] a trajectory of the samples may lead from the robot."""
    fastest = 0.0
    for axis in range(2):
        most = abs(state[3 + axis])
        for i in range(r.counts[axis]):
            most = max(most, abs(r.samples[axis, i]))
        fastest += most * most
    speed = math.sqrt(fastest)
    if s.use_dwa:
        speed = min(speed, s.max_trans + 2e-4)
    return speed * s.sim_time


@kernel
def _around(state: Floats, reach: float, f: Field, out: Bits) -> None:
    """Write the set of cells within ``reach`` [m] of the robot to ``out``, and a few more."""
    rows, columns = f.cells.shape
    cells = int(min(reach / f.frame[2], float(rows + columns))) + 2
    column = math.floor((state[0] - f.frame[0]) / f.frame[2])
    row = math.floor((state[1] - f.frame[1]) / f.frame[2])
    low, high = max(column - cells, 0), min(column + cells + 1, columns)
    box(low, high, max(row - cells, 0), min(row + cells + 1, rows), out)


@kernel
def targets(
    plan: Floats,
    n: int,
    front_end: Floats,
    near: float,
    s: Settings,
    f: Field,
    r: Room,
    state: Floats,
) -> None:
    """Fill the distances of ``f`` around the robot: as far as its centre and its nose can get.

    ``near`` [m] is how far the centre gets. Path and alignment share their distances, which have
    the same targets (dwa_local_planner ``updatePlanAndLocalCosts``).
    """
    nose = near + abs(s.forward)
    columns = f.cells.shape[1]
    last = walk(plan, n, plan[n - 1], f.cells, f.frame, r.seeds)
    if s.path_scale != 0.0:
        _around(state, nose, f, r.wanted)
        r.digits[0] = spread_out(r.seeds, r.passable, r.wanted, f.path, r.fronts)
    if s.goal_scale == 0.0:
        return
    if last >= 0:
        only(last // columns, last % columns, r.seeds)
    _around(state, near, f, r.wanted)
    r.digits[1] = spread_out(r.seeds, r.passable, r.wanted, f.goal, r.fronts)
    last = walk(plan, n, front_end, f.cells, f.frame, r.seeds)
    if last >= 0:
        only(last // columns, last % columns, r.seeds)
    _around(state, nose, f, r.wanted)
    r.digits[2] = spread_out(r.seeds, r.passable, r.wanted, f.front, r.fronts)


@kernel
def sample_speeds(state: Floats, distance: float, s: Settings, r: Room) -> None:
    """Write the speeds to try per axis, ``distance`` [m] from the goal."""
    window(state, distance, s, r.speeds)
    r.counts[0] = spread(r.speeds[0, 0], r.speeds[0, 1], s.x_samples, r.samples[0])
    r.counts[1] = spread(r.speeds[1, 0], r.speeds[1, 1], s.y_samples, r.samples[1])
    r.counts[2] = spread(r.speeds[2, 0], r.speeds[2, 1], s.theta_samples, r.samples[2])


@kernel
def decide(
    state: Floats,
    plan: Floats,
    n: int,
    front_end: Floats,
    aligned: bool,
    s: Settings,
    f: Field,
    r: Room,
) -> int:
    """Return the number of points of the winning trajectory in ``r.points``, 0 when there is none.

    ``state`` is x, y, yaw, vx, vy, wz in single precision, ``plan`` the ``n`` poses (x, y) near
    the robot in the costmap's frame, ``front_end`` the last of them pushed ahead, ``aligned``
    whether the nose counts. ``r.answer`` is filled when there is a winner.
    """
    dx, dy = plan[n - 1, 0] - state[0], plan[n - 1, 1] - state[1]
    sample_speeds(state, math.hypot(dx, dy), s, r)
    targets(plan, n, front_end, _reach(state, r, s), s, f, r, state)
    weigh(aligned, s, r.weights)
    bounds(
        state,
        r.samples,
        r.counts,
        r.weights,
        r.pairs,
        r.arcs,
        r.ends,
        r.known,
        r.digits,
        r.points,
        r.moving,
        s,
        f,
        r.lower,
    )
    return best(state, r.samples, r.counts, r.weights, r.points, r.moving, s, f, r.lower, r.answer)


@kernel
def cost_of(state: Floats, sample: Floats, aligned: bool, s: Settings, f: Field, r: Room) -> float:
    """Return the cost of one ``sample`` (3,), negative when its trajectory is illegal."""
    n = simulate(state, sample[0], sample[1], sample[2], s, r.points, r.moving)
    weigh(aligned, s, r.weights)
    return score(r.points, n, r.moving, r.weights, math.inf, s, f)
