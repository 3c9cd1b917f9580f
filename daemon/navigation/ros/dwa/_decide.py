"""One sampling cycle from the plan to the winner, in one call of machine code."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.navigation.kernels import Integers, kernel
from daemon.navigation.ros.dwa._distances import spread_out
from daemon.navigation.ros.dwa._plan import Bits, walk
from daemon.navigation.ros.dwa._samples import spread, window
from daemon.navigation.ros.dwa._search import Field, best, bounds
from daemon.navigation.ros.dwa._settings import Settings
from daemon.navigation.ros.dwa._trajectory import simulate
from grammars.values import Floats


class Room(NamedTuple):
    """Room to work in, allocated once: every cycle overwrites it.

    ``seeds``, ``passable`` (rows, words) and ``buffers`` (3, rows, words) are bits of cells;
    ``box`` (4,) and ``speeds`` (3, 2) windows; ``samples`` (3, most), ``counts`` (3,), ``lower``
    (all samples), ``arcs`` and ``points`` (longest trajectory, 5), ``moving`` (3,), ``answer``
    (5,) as :mod:`._search` has them.
    """

    seeds: Bits
    passable: Bits
    buffers: Bits
    box: Integers
    speeds: Floats
    samples: Floats
    counts: Integers
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
def _box(state: Floats, reach: float, s: Settings, f: Field, out: Integers) -> None:
    """Write the half-open window of cells within ``reach`` [m] of the robot to ``out``."""
    rows, columns = f.cells.shape
    cells = int(reach / f.frame[2]) + 2
    column = math.floor((state[0] - f.frame[0]) / f.frame[2])
    row = math.floor((state[1] - f.frame[1]) / f.frame[2])
    out[0], out[1] = min(max(column - cells, 0), columns), min(max(row - cells, 0), rows)
    out[2], out[3] = max(min(column + cells + 1, columns), 0), max(min(row + cells + 1, rows), 0)
    out[2], out[3] = max(out[0], out[2]), max(out[1], out[3])


@kernel
def _only(seeds: Bits, at: int, columns: int) -> None:
    """Leave a single seed, or none when ``at`` is -1."""
    seeds[:] = np.uint64(0)
    if at >= 0:
        column = at % columns
        seeds[at // columns, column >> 6] = np.uint64(1) << np.uint64(column & 63)


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
        _box(state, nose, s, f, r.box)
        spread_out(r.seeds, r.passable, r.box, f.path, r.buffers)
    if s.goal_scale == 0.0:
        return
    _only(r.seeds, last, columns)
    _box(state, near, s, f, r.box)
    spread_out(r.seeds, r.passable, r.box, f.goal, r.buffers)
    last = walk(plan, n, front_end, f.cells, f.frame, r.seeds)
    _only(r.seeds, last, columns)
    _box(state, nose, s, f, r.box)
    spread_out(r.seeds, r.passable, r.box, f.front, r.buffers)


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
    bounds(state, r.samples, r.counts, aligned, r.arcs, r.points, r.moving, s, f, r.lower)
    return best(state, r.samples, r.counts, aligned, r.points, r.moving, s, f, r.lower, r.answer)


@kernel
def follow(state: Floats, sample: Floats, s: Settings, r: Room) -> int:
    """Write the trajectory of one ``sample`` (3,) to ``r.points``; return its points."""
    return simulate(state, sample[0], sample[1], sample[2], s, r.points, r.moving)
