"""What the restricted wave leaves out, how that is noticed, and the remainder it is guided by."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn.planner import PotentialField
from daemon.stacks.ros1.navfn.propagation import (
    DOUBTFUL,
    GAINS,
    UNREACHED,
    seed_wave,
    translate_costs,
    translation_table,
)
from daemon.stacks.ros1.navfn.restricted import CostToGo, clear_doubts, spread_towards
from tests.daemon.stacks.ros1.navfn import plain
from tests.daemon.stacks.ros1.navfn.test_identity import disturb, random_cells

COLUMNS = 14
F = np.float32
FAR = float(UNREACHED)


def depends(log, n):
    """Tell whether a cell left out took part in what a cell has gone through, backward.

    A cell that is needed when it was looked at needs its neighbours from then on back, because
    nothing else can have told it a potential or made it be looked at.
    """
    needed = {n}
    for entry in reversed(log):
        if entry < 0:
            if ~entry in needed:
                return True
        elif entry in needed:
            needed |= {entry - 1, entry + 1, entry - COLUMNS, entry + COLUMNS}
    return False


@given(st.integers(0, 2**32 - 1))
def test_doubtful_is_what_a_cell_left_out_took_part_in(seed):
    random = np.random.default_rng(seed)
    rows = int(random.integers(6, 20))
    choice = [0, 0, 0, 0, 40, 120, 252, 254]
    costs = plain.costs_of(random.choice(choice, size=(rows, COLUMNS)).astype(np.uint8))
    free = np.flatnonzero(costs < 254)
    if free.size < 2:
        return
    start, goal = (int(n) for n in random.choice(free, 2, replace=False))
    ahead = (random.random(costs.size) * 600.0).astype(np.float32)
    bound, log = F(random.uniform(500.0, 1500.0)), list[int]()
    expected = plain.wave(costs, COLUMNS, start, goal, ahead=ahead, bound=bound, log=log)

    flags, potentials = costs.astype(np.uint16), np.full(costs.size, UNREACHED, dtype=np.float32)
    buffers, reached = np.empty((3, 10_000), np.int32), np.empty(costs.size + 1, np.int32)
    doubtful = np.empty(costs.size, np.int32)
    cycles = max(costs.size // 20, rows + COLUMNS)
    waiting = seed_wave(flags, potentials, COLUMNS, start, buffers[0], reached)
    count, doubts, _, _, _ = spread_towards(
        flags, potentials, None, GAINS, ahead, bound, F(254), COLUMNS, goal, cycles, buffers,
        waiting, reached, 1, doubtful,
    )  # fmt: skip
    assert np.array_equal(potentials, expected)
    assert set(reached[:count].tolist()) == set(np.flatnonzero(expected < UNREACHED).tolist())
    found = set(doubtful[:doubts].tolist())
    assert found == set(np.flatnonzero(flags & DOUBTFUL).tolist())
    assert len(found) == doubts
    left_out = {~n for n in log if n < 0}
    affected = {n for n in free.tolist() if depends(log, n)}
    assert found == left_out | affected
    clear_doubts(flags, doubtful, doubts)
    assert np.array_equal(flags, costs)


def test_the_restricted_wave_gives_up_where_a_buffer_could_run_over():
    size = 1600
    costs = np.full(size, 254, dtype=np.uint16)
    free = np.zeros((40, 40), dtype=np.uint8)
    translate_costs(free, costs, translation_table(allow_unknown=True), 0, 0, 40, 40)
    potentials = np.full(size, UNREACHED, dtype=np.float32)
    reached, doubtful = np.empty((2, size + 1), dtype=np.int32)
    for room, gives_up in ((40, True), (400, False)):
        potentials[:] = UNREACHED
        buffers = np.empty((3, room), dtype=np.int32)
        waiting = seed_wave(costs, potentials, 40, 820, buffers[0], reached)
        _, _, fill, _, _ = spread_towards(
            costs, potentials, None, GAINS, np.zeros(size, dtype=np.float32), UNREACHED, F(254),
            40, 1300, 10_000, buffers, waiting, reached, 1, doubtful,
        )  # fmt: skip
        assert (fill == room) is gives_up
        assert (costs < 256).all()


@given(st.integers(0, 2**32 - 1))
def test_up_to_its_limit_the_remainder_is_that_without_one(seed):
    random = np.random.default_rng(seed)
    grid = CostGrid(0.05, 0.0, 0.0, random_cells(random, 20, 80))
    rows, columns = grid.cells.shape
    costs, table = (
        np.full(rows * columns, 254, dtype=np.uint16),
        translation_table(allow_unknown=True),
    )
    translate_costs(grid.cells, costs, table, 0, 0, columns, rows)
    free = np.flatnonzero(costs < 254)
    if free.size == 0:
        return
    goal, limit = int(random.choice(free)), float(random.integers(200, 3000))
    limited, endless = CostToGo(costs.size, columns), CostToGo(costs.size, columns)
    assert limited.renew(costs, goal, limit)
    assert endless.renew(costs, goal, FAR)
    assert endless.whole
    within = endless.ahead <= limit
    assert np.array_equal(limited.ahead[within], endless.ahead[within])
    assert (limited.ahead[~within] > limit).all()
    assert limited.whole or (endless.ahead[~within] < UNREACHED).any()
    for _ in range(3):
        window = disturb(random, grid)
        if translate_costs(grid.cells, costs, table, *window):
            limited.follow(costs, window)
            endless.follow(costs, window)
    # Relaxed in another order, values differ by less than the wave would care for.
    within = endless.ahead <= limit - 100.0
    assert limited.ahead[within] == pytest.approx(endless.ahead[within], rel=0.02, abs=2.0)


def test_a_goal_walled_in_has_no_path_until_the_wall_is_gone():
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((150, 150), dtype=np.uint8))
    twin = CostGrid(0.05, 0.0, 0.0, grid.cells)
    field = PotentialField(grid, allow_unknown=True, worthwhile=1)
    whole = PotentialField(twin, allow_unknown=True, margins=())
    goal, wall = 75 * 150 + 120, (110, 65, 131, 86)
    for step, value in enumerate((0, 0, 0, 254, 254, 254, 0, 0, 0)):
        grid.cells[65:86, 110:131] = value
        grid.cells[66:85, 111:130] = 0
        grid.touch(wall)
        twin.touch(wall)
        start = 75 * 150 + 20 + step
        found = field.path(start, goal)
        assert np.array_equal(found, whole.path(start, goal))
        assert (len(found) == 0) is (value == 254)
    assert field.restricted > 3


def test_what_remains_is_the_least_beside_a_cell():
    # A corridor of one row: a step along it costs 50, and beside it there is no way.
    costs = np.full(100, 254, dtype=np.uint16)
    costs[51:59] = 50
    remainder = CostToGo(100, 10)
    assert remainder.renew(costs, 52, 1e6)
    assert remainder.whole
    assert [remainder.at(n) for n in (52, 53, 54, 57)] == [0.0, 0.0, 50.0, 200.0]
    # A cell that is blocked itself is left to the side; one that is off the corridor, nowhere.
    assert [remainder.at(n) for n in (45, 65)] == [150.0, 150.0]
    assert remainder.at(80) == FAR
    remainder.drop()
    assert remainder.goal == -1
