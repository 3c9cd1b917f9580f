"""Distances of one sampling cycle from the path, the goal and the goal pushed ahead.

With them the arrays the kernels work in, allocated once, and the distances of the last cycle, for
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
"""Instead of a cell that distances lead to: they are those of another costmap."""


class DistanceBuffers(NamedTuple):
    """Room for spreading distances.

    Sets of cells are as in :mod:`daemon.stacks.ros1.base_local_planner.map_grid`; distances spread
    through ``passable``. ``sources`` (3, 2) says which cell the distances of goal and front lead
    to, -1 for none, and whether they were spread as far as they go (1). Whoever changes
    ``passable`` forgets them (:data:`UNKNOWN`).
    """

    seeds: Bits
    passable: Bits
    wanted: Bits
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
    """Fill the distances of ``f`` around the robot, as far as its centre and its nose can get.

    ``plan`` has the poses (x, y) near the robot in the costmap's frame, ``front_end`` is the
    last of them pushed ahead; ``reach`` [m] says how far the centre and the nose get. Path and
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
        write_reach(state[0], state[1], near, f.frame, f.cells.shape, d.wanted)
        out = f.distances[which]
        if which != PATH:
            # The end of the plan stays in its cell for many a cycle, the costmap as it is for most.
            if d.sources[which, 0] == source and (
                d.sources[which, 1] == 1 or all_reached(out, d.wanted)
            ):
                continue
            if source >= 0:
                write_single_cell(source // columns, source % columns, d.seeds)
        f.digits[which] = compute_distances(d.seeds, d.passable, d.wanted, out, d.fronts)
        d.sources[which, 0] = source
        # Spreading ends when all that is wanted is reached or nothing is left to reach.
        d.sources[which, 1] = 0 if all_reached(out, d.wanted) else 1


def allocate_scoring_grid(
    local: CostGrid, settings: DwaSettings, outline: Floats, banned: Integers
) -> ScoringGrid:
    """Return the field of a costmap; cells and ``banned`` are shared with their owners."""
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
    """Return room for spreading distances on a costmap of ``shape``."""
    return DistanceBuffers(
        seeds=empty_set(shape),
        passable=empty_set(shape),
        wanted=empty_set(shape),
        fronts=np.array([empty_set(shape)] * 2),
        sources=np.full((3, 2), UNKNOWN, dtype=np.int32),
    )


def allocate_buffers(shape: tuple[int, ...], settings: DwaSettings, longest: int) -> SearchBuffers:
    """Return room for a costmap of ``shape`` and trajectories of up to ``longest`` points."""
    s = settings
    numbers = [max(2, n) + 1 for n in (s.vx_samples, s.vy_samples, s.vth_samples)]
    pairs, most = numbers[0] * numbers[1], math.prod(numbers)
    return SearchBuffers(
        samples=np.zeros((3, max(numbers))),
        counts=np.zeros(3, dtype=np.int32),
        pairs=np.zeros((pairs, 5)),
        arcs=np.zeros((longest, 5)),
        ends=np.zeros((most, 2), dtype=np.int32),
        known=np.zeros((3, shape[0] * shape[1]), dtype=np.int32),
        lower=np.zeros(most),
        least=np.zeros(pairs),
        points=np.zeros((longest, 5)),
        moving=np.zeros(3),
        answer=np.zeros(5),
    )


class LastCycleDistances:
    """Plan and costmap of the last sampling cycle; nobody else changes the ``cells``.

    That cycle needed its distances only near the robot; a check may need them elsewhere, for the
    costmap may have moved since, while the distances have not (``MapGridCostFunction``).
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
            # From the corner of the costmap everything is within this reach.
            corner, everywhere = self._frame, (math.inf, math.inf)
            fill_distances(corner, plan, plan[-1], everywhere, weights, self._complete, sets)
        old = self._complete
        return field._replace(distances=old.distances, digits=old.digits)
