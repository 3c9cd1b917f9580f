"""Cost of a trajectory: the critics in the original's order, and the distances they need."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.base_local_planner.map_grid import (
    FIT,
    Bits,
    Cells,
    compute_distances,
    contains_cell,
    distance_at,
    empty_set,
    mark_plan_cells,
    passable_cells,
    place_of,
    unrestricted_distances,
    write_reach,
    write_single_cell,
)
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa.samples import DwaSettings, footprint_scale, translation_speed
from grammars.model.geometry import Floats

PATH, GOAL, FRONT = range(3)


class ScoringGrid(NamedTuple):
    """The grid on which trajectories are scored.

    ``frame`` is x, y and resolution of the ``cells``; ``outline`` the footprint, (corners, 2) in
    metres. Distances spread through ``passable``, a set of cells as in
    :mod:`daemon.stacks.ros1.base_local_planner.map_grid`. ``distances`` stacks those from the path,
    the goal and the goal pushed ahead (``PATH``, ``GOAL``, ``FRONT``); ``digits`` (3,) are in use.

    ``banned`` (6,) are the signs of vx, vy, wz that oscillation forbids: negative vx, positive vx,
    and so on. ``spans`` is scratch for the inside of a footprint, without rows if only the outline
    counts.
    """

    cells: Cells
    frame: Floats
    outline: Floats
    passable: Bits
    distances: Bits
    digits: Integers
    banned: Integers
    spans: Integers


def critic_weights(s: DwaSettings, aligned: bool) -> Floats:
    """Return the weights of obstacle, front, alignment, path, goal and twirling, shape (6,).

    Critics of weight 0 are skipped, so they reject nothing either.
    """
    alignment = s.path_scale if aligned else 0.0
    scales = (s.occdist_scale, s.goal_scale, alignment, s.path_scale, s.goal_scale)
    return np.array((*scales, s.twirling_scale))


@kernel
def oscillates(banned: Integers, vx: float, vy: float, wz: float) -> bool:
    """Tell whether oscillation forbids a velocity; ``banned`` (6,) as in :class:`ScoringGrid`."""
    return bool(
        (banned[0] and vx < 0.0)
        or (banned[1] and vx > 0.0)
        or (banned[2] and vy < 0.0)
        or (banned[3] and vy > 0.0)
        or (banned[4] and wz < 0.0)
        or (banned[5] and wz > 0.0)
    )


@kernel
def total_cost(
    obstacle: float, front: int, along: int, path: int, goal: int, wz: float, weights: Floats
) -> float:
    """Sum the critics in the original's order, with :func:`critic_weights`' ``weights``.

    ``front`` and ``along`` are the distances of the nose from the goal pushed ahead and from the
    path, ``path`` and ``goal`` those of the centre.
    """
    cost = 0.0
    if weights[0] != 0.0:
        cost += obstacle * weights[0]
    if weights[1] != 0.0:
        cost += front * weights[1]
    if weights[2] != 0.0:
        cost += along * weights[2]
    if weights[3] != 0.0:
        cost += path * weights[3]
    if weights[4] != 0.0:
        cost += goal * weights[4]
    if weights[5] != 0.0:
        cost += abs(wz) * weights[5]
    return cost


@kernel
def _end_cells(points: Floats, n: int, weights: Floats, forward: float, f: ScoringGrid) -> int:
    """Return the cells of the last pose and its nose as one number, -1 if a pose is illegal.

    The number is centre * size + nose; 0 without critics of distances.
    """
    rows, columns = f.cells.shape
    path, goal = weights[3] != 0.0, weights[4] != 0.0
    if not (path or goal):
        return 0
    path_cells, goal_cells = f.distances[PATH, FIT], f.distances[GOAL, FIT]
    noses = weights[1] != 0.0 or weights[2] != 0.0
    at, nose = 0, 0
    for i in range(n):
        row, column = place_of(points[i, 0], points[i, 1], f.frame, rows, columns)
        if row < 0:
            return -1
        if path and not contains_cell(path_cells, row, column):
            return -1
        if goal and not contains_cell(goal_cells, row, column):
            return -1
        at = row * columns + column
        if noses:
            x, y = points[i, 0] + forward * points[i, 3], points[i, 1] + forward * points[i, 4]
            row, column = place_of(x, y, f.frame, rows, columns)
            if row < 0:
                return -1
            nose = row * columns + column
    return at * f.cells.size + nose


@kernel
def _cost_of_end_cells(
    obstacle: float, at: int, nose: int, wz: float, weights: Floats, f: ScoringGrid
) -> float:
    """Return the cost of a trajectory that ends in these cells."""
    columns, size, digits = f.cells.shape[1], f.cells.size, f.digits
    path, goal, front = f.distances[PATH], f.distances[GOAL], f.distances[FRONT]
    return total_cost(
        obstacle,
        distance_at(front, nose // columns, nose % columns, size, digits[FRONT]),
        distance_at(path, nose // columns, nose % columns, size, digits[PATH]),
        distance_at(path, at // columns, at % columns, size, digits[PATH]),
        distance_at(goal, at // columns, at % columns, size, digits[GOAL]),
        wz,
        weights,
    )


@kernel
def score_trajectory(
    points: Floats,
    n: int,
    moving: Floats,
    weights: Floats,
    limit: float,
    s: DwaSettings,
    f: ScoringGrid,
) -> float:
    """Return the cost of a trajectory, negative if it is illegal.

    Returns -1 as soon as the cost exceeds ``limit``. A trajectory without points costs 0, as in
    the original (``SimpleScoredSamplingPlanner::scoreTrajectory``).
    """
    if n == 0:
        return 0.0
    if oscillates(f.banned, moving[0], moving[1], moving[2]):
        return -1.0
    ends = _end_cells(points, n, weights, s.forward_point_distance, f)
    if ends < 0:
        return -1.0
    rest = _cost_of_end_cells(0.0, ends // f.cells.size, ends % f.cells.size, moving[2], weights, f)
    if weights[0] == 0.0:
        return rest
    # The obstacle critic comes first in the original. Here it comes last, because it takes longest;
    # the final sum has the original's order again.
    scale = footprint_scale(translation_speed(moving[0], moving[1]), s)
    obstacle = 0.0
    for i in range(n):
        cost = footprint_cost(f.cells, f.frame, f.outline, scale, points[i], f.spans)
        if cost < 0:
            return -1.0
        if s.sum_scores:
            obstacle += cost
        elif cost > obstacle:
            obstacle = float(cost)
        else:
            continue
        # Slightly lower, because the terms are not summed in their order here.
        if (rest + obstacle * weights[0]) * (1.0 - 1e-12) > limit:
            return -1.0
    return _cost_of_end_cells(
        obstacle, ends // f.cells.size, ends % f.cells.size, moving[2], weights, f
    )


def allocate_scoring_grid(
    local: CostGrid, settings: DwaSettings, outline: Floats, banned: Integers
) -> ScoringGrid:
    """Return the scoring grid of a costmap; it shares cells and ``banned`` with their owners."""
    shape = local.cells.shape
    rows = 0 if settings.perimeter_only else shape[0]
    return ScoringGrid(
        cells=local.cells,
        frame=np.array((local.x, local.y, local.resolution)),
        outline=outline,
        passable=empty_set(shape),
        distances=np.array([unrestricted_distances(shape)] * 3),
        digits=np.zeros(3, dtype=np.int32),
        banned=banned,
        spans=np.zeros((rows, 2), dtype=np.int32),
    )


@kernel
def fill_distances(
    state: Floats,
    plan: Floats,
    front_end: Floats,
    reach: tuple[float, float],
    weights: Floats,
    f: ScoringGrid,
) -> None:
    """Fill the distances of ``f`` around the robot within the reach of its centre and its nose.

    ``plan`` has the poses (x, y) near the robot in the costmap's frame, ``front_end`` is the
    last of them pushed ahead. ``reach`` [m] is that of the centre and of the nose. Path and
    alignment share their distances, which have the same targets (dwa_local_planner
    ``updatePlanAndLocalCosts``). Critics without weight get none.
    """
    columns = f.cells.shape[1]
    centre, nose = reach
    seeds, targets = np.empty_like(f.passable), np.empty_like(f.passable)
    source = -1
    for which in range(3):
        if which != GOAL:
            end = front_end if which == FRONT else plan[-1]
            source = mark_plan_cells(plan, end, f.cells, f.frame, seeds)
        # The weights of path and goal.
        if weights[3 if which == PATH else 4] == 0.0:
            continue
        near = centre if which == GOAL else nose
        write_reach(state[0], state[1], near, f.frame, f.cells.shape, targets)
        if which != PATH and source >= 0:
            write_single_cell(source // columns, source % columns, seeds)
        f.digits[which] = compute_distances(seeds, f.passable, targets, f.distances[which])


def complete_distances(
    plan: Floats, cells: Cells, frame: Floats, field: ScoringGrid, weights: Floats
) -> ScoringGrid:
    """Return ``field`` with the distances of an earlier sampling cycle in every cell.

    That cycle had this ``plan`` on a costmap of ``cells`` and ``frame``, and needed its distances
    only near the robot. A check may need them elsewhere: the costmap may have moved since, but the
    distances have not (``MapGridCostFunction``).
    """
    passable = np.zeros_like(field.passable)
    passable_cells(cells, passable)
    distances, digits = np.empty_like(field.distances), field.digits.copy()
    earlier = field._replace(
        cells=cells, frame=frame, passable=passable, distances=distances, digits=digits
    )
    # An infinite reach from the corner covers the whole costmap.
    fill_distances(frame, plan, plan[-1], (math.inf, math.inf), weights, earlier)
    return field._replace(distances=distances, digits=digits)
