"""Distances of one sampling cycle from the path, the goal and the goal pushed ahead.

Also the arrays of the kernels, allocated once, and the distances of the last cycle for the check
of a command.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.map_grid import (
    Bits,
    Cells,
    all_reached,
    compute_distances,
    empty_set,
    mark_plan_cells,
    passable_cells,
    unrestricted_distances,
    write_reach,
    write_single_cell,
)
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa._scoring import FRONT, GOAL, PATH, ScoringGrid
from daemon.stacks.ros1.dwa._search import SearchBuffers
from daemon.stacks.ros1.dwa._settings import DwaSettings
from grammars.model.geometry import Floats

UNKNOWN: Final = -2
"""Source of distances that belong to another costmap."""


class DistanceBuffers(NamedTuple):
    """Scratch for spreading distances.

    Sets of cells are as in :mod:`daemon.stacks.ros1.base_local_planner.map_grid`; distances spread
    through ``passable``. ``sources`` (3, 2) holds the target cell of the distances of goal and
    front, -1 for none, and 1 if they were spread completely. A change of ``passable`` makes them
    :data:`UNKNOWN`.
    """

    seeds: Bits
    passable: Bits
    targets: Bits
    fronts: Bits
    sources: Integers


@kernel
def fill_distances(
    state: Floats,
    plan: Floats,
    front_end: Floats,
    reach: tuple[float, float],
    weights: Floats,
    f: ScoringGrid,
    d: DistanceBuffers,
) -> None:
    """Fill the distances of ``f`` around the robot within the reach of its centre and its nose.

    ``plan`` has the poses (x, y) near the robot in the costmap's frame, ``front_end`` is the
    last of them pushed ahead. ``reach`` [m] is that of the centre and of the nose. Path and
    alignment share their distances, which have the same targets (dwa_local_planner
    ``updatePlanAndLocalCosts``). Critics without weight get none.
    """
    columns = f.cells.shape[1]
    centre, nose = reach
    source = -1
    for which in range(3):
        if which != GOAL:
            end = front_end if which == FRONT else plan[-1]
            source = mark_plan_cells(plan, end, f.cells, f.frame, d.seeds)
        # The weights of path and goal.
        if weights[3 if which == PATH else 4] == 0.0:
            continue
        near = centre if which == GOAL else nose
        write_reach(state[0], state[1], near, f.frame, f.cells.shape, d.targets)
        out = f.distances[which]
        if which != PATH:
            # The end of the plan often stays in its cell, and the costmap rarely changes.
            if d.sources[which, 0] == source and (
                d.sources[which, 1] == 1 or all_reached(out, d.targets)
            ):
                continue
            if source >= 0:
                write_single_cell(source // columns, source % columns, d.seeds)
        f.digits[which] = compute_distances(d.seeds, d.passable, d.targets, out, d.fronts)
        d.sources[which, 0] = source
        # Spreading ends when all targets are reached or no cell remains.
        d.sources[which, 1] = 0 if all_reached(out, d.targets) else 1


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
        distances=np.array([unrestricted_distances(shape)] * 3),
        digits=np.zeros(3, dtype=np.int32),
        banned=banned,
        spans=np.zeros((rows, 2), dtype=np.int32),
    )


def allocate_sets(shape: tuple[int, ...]) -> DistanceBuffers:
    """Return scratch for spreading distances on a costmap of ``shape``."""
    return DistanceBuffers(
        seeds=empty_set(shape),
        passable=empty_set(shape),
        targets=empty_set(shape),
        fronts=np.array([empty_set(shape)] * 2),
        sources=np.full((3, 2), UNKNOWN, dtype=np.int32),
    )


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


class LastCycleDistances:
    """Plan and costmap of the last sampling cycle; ``cells`` must not change.

    That cycle needed its distances only near the robot. A check may need them elsewhere: the
    costmap may have moved since, but the distances have not (``MapGridCostFunction``).
    """

    def __init__(self, plan: Floats, cells: Cells, frame: Floats) -> None:
        self._plan, self._cells, self._frame = plan.copy(), cells, frame.copy()
        self._complete: ScoringGrid | None = None

    def complete(self, field: ScoringGrid, weights: Floats) -> ScoringGrid:
        """Return ``field`` with that cycle's distances in every cell."""
        if self._complete is None:
            distances, digits = np.empty_like(field.distances), field.digits.copy()
            self._complete = field._replace(
                cells=self._cells, frame=self._frame, distances=distances, digits=digits
            )
            sets, plan = allocate_sets(self._cells.shape), self._plan
            passable_cells(self._cells, sets.passable)
            # An infinite reach from the corner covers the whole costmap.
            corner, everywhere = self._frame, (math.inf, math.inf)
            fill_distances(corner, plan, plan[-1], everywhere, weights, self._complete, sets)
        old = self._complete
        return field._replace(distances=old.distances, digits=old.digits)
