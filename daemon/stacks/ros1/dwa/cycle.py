"""One sampling cycle from the plan to the winner, in one call of machine code.

With it the arrays the kernels work in, allocated once, and the distances of the last cycle, for
commands that are only checked.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.map_grid import (
    Bits,
    all_reached,
    compute_distances,
    empty_set,
    mark_plan_cells,
    passable_cells,
    unrestricted_distances,
    write_box,
    write_reach,
    write_single_cell,
)
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa._parameters import DwaSettings
from daemon.stacks.ros1.dwa._scoring import ScoringGrid, score_trajectory, set_critic_weights
from daemon.stacks.ros1.dwa._search import bound_costs, find_best_sample
from daemon.stacks.ros1.dwa.samples import dynamic_window, sample_axis, simulate_trajectory
from grammars.model.geometry import Floats


class SearchBuffers(NamedTuple):
    """Room to work in, allocated once: every cycle overwrites it.

    ``seeds``, ``passable``, ``wanted`` and ``fronts`` are sets of cells as in
    :mod:`daemon.stacks.ros1.base_local_planner.map_grid`; ``speeds`` (3, 2) the dynamic window;
    ``samples`` (3, most), ``counts`` (3,), ``weights`` (6,), ``pairs`` (most, 5), ``ends`` (all
    samples, 2), ``known`` (3, cells), ``digits`` (3,), ``lower`` (all samples), ``least`` (most,),
    ``arcs`` and ``points`` (longest trajectory, 5), ``moving`` (3,) and ``answer`` (5,) as
    :mod:`._search` has them. ``sources`` (2, 2) says which cell the distances of goal and front
    lead to, -1 for none, and whether they were spread as far as they go (1); whoever changes
    ``passable`` forgets them (:data:`UNKNOWN`).
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
    least: Floats
    arcs: Floats
    points: Floats
    moving: Floats
    answer: Floats
    sources: Integers


UNKNOWN: Final = -2
"""Instead of a cell that distances lead to: they are those of another costmap."""


@kernel
def _reach(state: Floats, r: SearchBuffers, s: DwaSettings) -> float:
    """Return how far [m] a trajectory of the samples may lead from the robot."""
    fastest = 0.0
    for axis in range(2):
        most = abs(state[3 + axis])
        for i in range(r.counts[axis]):
            most = max(most, abs(r.samples[axis, i]))
        fastest += most * most
    speed = math.sqrt(fastest)
    if s.use_dwa:
        # Samples up to 1e-4 m/s faster than max_vel_trans are legal; as much again to spare.
        speed = min(speed, s.max_trans + 2e-4)
    return speed * s.sim_time


@kernel
def fill_distances(
    plan: Floats,
    n: int,
    front_end: Floats,
    near: float,
    s: DwaSettings,
    f: ScoringGrid,
    r: SearchBuffers,
    state: Floats,
) -> None:
    """Fill the distances of ``f`` around the robot: as far as its centre and its nose can get.

    ``near`` [m] is how far the centre gets. Path and alignment share their distances, which have
    the same targets (dwa_local_planner ``updatePlanAndLocalCosts``).
    """
    nose = near + abs(s.forward)
    columns = f.cells.shape[1]
    last = mark_plan_cells(plan, n, plan[n - 1], f.cells, f.frame, r.seeds)
    if s.path_scale != 0.0:
        write_reach(state[0], state[1], nose, f.frame, f.cells.shape, r.wanted)
        r.digits[0] = compute_distances(r.seeds, r.passable, r.wanted, f.path, r.fronts)
    if s.goal_scale == 0.0:
        return
    write_reach(state[0], state[1], near, f.frame, f.cells.shape, r.wanted)
    _spread_from(last, 0, columns, f.goal, r)
    last = mark_plan_cells(plan, n, front_end, f.cells, f.frame, r.seeds)
    write_reach(state[0], state[1], nose, f.frame, f.cells.shape, r.wanted)
    _spread_from(last, 1, columns, f.front, r)


@kernel
def _spread_from(source: int, which: int, columns: int, out: Bits, r: SearchBuffers) -> None:
    """Write the distances from the cell ``source`` to ``out`` unless they are there already.

    The end of the plan stays in its cell for many a cycle, the costmap as it is for most.
    """
    known, complete = r.sources[which, 0] == source, r.sources[which, 1] == 1
    if known and (complete or all_reached(out, r.wanted)):
        return
    if source >= 0:
        write_single_cell(source // columns, source % columns, r.seeds)
    r.digits[1 + which] = compute_distances(r.seeds, r.passable, r.wanted, out, r.fronts)
    r.sources[which, 0] = source
    # Spreading ends when all that is wanted is reached or nothing is left to reach.
    r.sources[which, 1] = 0 if all_reached(out, r.wanted) else 1


@kernel
def sample_speeds(state: Floats, distance: float, s: DwaSettings, r: SearchBuffers) -> None:
    """Write the speeds to try per axis, ``distance`` [m] from the goal."""
    dynamic_window(state, distance, s, r.speeds)
    r.counts[0] = sample_axis(r.speeds[0, 0], r.speeds[0, 1], s.x_samples, r.samples[0])
    r.counts[1] = sample_axis(r.speeds[1, 0], r.speeds[1, 1], s.y_samples, r.samples[1])
    r.counts[2] = sample_axis(r.speeds[2, 0], r.speeds[2, 1], s.theta_samples, r.samples[2])


@kernel
def choose_trajectory(
    state: Floats,
    plan: Floats,
    n: int,
    front_end: Floats,
    aligned: bool,
    s: DwaSettings,
    f: ScoringGrid,
    r: SearchBuffers,
) -> int:
    """Return the number of points of the winning trajectory in ``r.points``, 0 when there is none.

    ``state`` is x, y, yaw, vx, vy, wz in single precision, ``plan`` the ``n`` poses (x, y) near
    the robot in the costmap's frame, ``front_end`` the last of them pushed ahead, ``aligned``
    whether the nose counts. ``r.answer`` is filled when there is a winner.
    """
    # Samples first: how fast they are says how far distances are needed, and filling those of the
    # whole costmap would cost more than following every trajectory.
    dx, dy = plan[n - 1, 0] - state[0], plan[n - 1, 1] - state[1]
    sample_speeds(state, math.hypot(dx, dy), s, r)
    fill_distances(plan, n, front_end, _reach(state, r, s), s, f, r, state)
    set_critic_weights(aligned, s, r.weights)
    bound_costs(
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
        r.least,
    )
    return find_best_sample(
        state,
        r.samples,
        r.counts,
        r.weights,
        r.points,
        r.moving,
        s,
        f,
        r.lower,
        r.least,
        r.answer,
    )


@kernel
def sample_cost(
    state: Floats, sample: Floats, aligned: bool, s: DwaSettings, f: ScoringGrid, r: SearchBuffers
) -> float:
    """Return the cost of one ``sample`` (3,), negative when its trajectory is illegal."""
    n = simulate_trajectory(state, sample[0], sample[1], sample[2], s, r.points, r.moving)
    set_critic_weights(aligned, s, r.weights)
    return score_trajectory(r.points, n, r.moving, r.weights, math.inf, s, f)


def allocate_scoring_grid(local: CostGrid, outline: Floats, banned: Integers) -> ScoringGrid:
    """Return the field of a costmap; cells and ``banned`` are shared with their owners."""
    rows = local.cells.shape[0]
    return ScoringGrid(
        cells=local.cells,
        frame=np.array((local.x, local.y, local.resolution)),
        outline=outline,
        path=unrestricted_distances(local.cells.shape),
        goal=unrestricted_distances(local.cells.shape),
        front=unrestricted_distances(local.cells.shape),
        banned=banned,
        spans=np.zeros((rows, 2), dtype=np.int32),
    )


def allocate_buffers(shape: tuple[int, ...], settings: DwaSettings, longest: int) -> SearchBuffers:
    """Return room for a costmap of ``shape`` and trajectories of up to ``longest`` points."""
    numbers = [max(2, n) + 1 for n in (settings.x_samples, settings.y_samples)]
    numbers.append(max(2, settings.theta_samples) + 1)
    return SearchBuffers(
        seeds=empty_set(shape),
        passable=empty_set(shape),
        wanted=empty_set(shape),
        fronts=np.array([empty_set(shape), empty_set(shape)]),
        speeds=np.zeros((3, 2)),
        samples=np.zeros((3, max(numbers))),
        counts=np.zeros(3, dtype=np.int32),
        pairs=np.zeros((numbers[0] * numbers[1], 5)),
        weights=np.zeros(6),
        ends=np.zeros((int(np.prod(numbers)), 2), dtype=np.int32),
        known=np.zeros((3, shape[0] * shape[1]), dtype=np.int32),
        digits=np.zeros(3, dtype=np.int32),
        lower=np.zeros(int(np.prod(numbers))),
        least=np.zeros(numbers[0] * numbers[1]),
        arcs=np.zeros((longest, 5)),
        points=np.zeros((longest, 5)),
        moving=np.zeros(3),
        answer=np.zeros(5),
        sources=np.full((2, 2), UNKNOWN, dtype=np.int32),
    )


@kernel
def _complete_distances(plan: Floats, old: ScoringGrid, r: SearchBuffers) -> None:
    rows, columns = old.cells.shape
    n = plan.shape[0]
    passable = np.zeros_like(r.passable)
    passable_cells(old.cells, passable)
    write_box(0, columns, 0, rows, r.wanted)
    last = mark_plan_cells(plan, n, plan[n - 1], old.cells, old.frame, r.seeds)
    compute_distances(r.seeds, passable, r.wanted, old.path, r.fronts)
    if last >= 0:
        write_single_cell(last // columns, last % columns, r.seeds)
    compute_distances(r.seeds, passable, r.wanted, old.goal, r.fronts)


class LastCycleDistances:
    """What the last sampling cycle saw.

    That cycle needed its distances only near the robot; a check may need them elsewhere, for the
    costmap may have moved since, while the distances have not (``MapGridCostFunction``).
    """

    def __init__(self, plan: Floats, field: ScoringGrid) -> None:
        self._plan, self._cells, self._frame = plan.copy(), field.cells.copy(), field.frame.copy()
        self._distances: ScoringGrid | None = None

    def complete(self, field: ScoringGrid, room: SearchBuffers) -> ScoringGrid:
        """Return ``field`` with that cycle's distances in every cell."""
        if self._distances is None:
            path, goal = np.empty_like(field.path), np.empty_like(field.goal)
            self._distances = field._replace(
                cells=self._cells, frame=self._frame, path=path, goal=goal
            )
            _complete_distances(self._plan, self._distances, room)
        return field._replace(path=self._distances.path, goal=self._distances.goal)
