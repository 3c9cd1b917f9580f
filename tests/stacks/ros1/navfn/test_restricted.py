"""What the restricted wave leaves out, how that is noticed, and the remainder it is guided by."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn.propagation import DOUBTFUL, UNREACHED, navfn_costs, seed_cell
from daemon.stacks.ros1.navfn.restricted import CostToGo, clear_doubts, spread_towards
from tests.stacks.ros1.navfn import plain
from tests.stacks.ros1.navfn.fields import a_field, path, wave_over
from tests.stacks.ros1.navfn.test_identity import disturb, random_cells

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

    wave, begin = wave_over(costs, COLUMNS)
    around = np.full(begin, UNREACHED, dtype=np.float32)
    doubtful = np.empty(wave.states.size, np.int32)
    cycles = max(costs.size // 20, rows + COLUMNS)
    count, doubts, _, _, _ = spread_towards(
        wave, np.concatenate((around, ahead, around)), bound, F(254), begin + goal, cycles,
        seed_cell(wave, begin + start), 1, doubtful,
    )  # fmt: skip
    assert np.array_equal(wave.potentials[begin:-begin], expected)
    reached = set((wave.reached[:count] - begin).tolist())
    assert reached == set(np.flatnonzero(expected < UNREACHED).tolist())
    found = set((doubtful[:doubts] - begin).tolist())
    assert found == set((np.flatnonzero(wave.states & DOUBTFUL) - begin).tolist())
    assert len(found) == doubts
    left_out = {~n for n in log if n < 0}
    affected = {n for n in free.tolist() if depends(log, n)}
    assert found == left_out | affected
    clear_doubts(wave.states, doubtful, doubts)
    assert np.array_equal(wave.states[begin:-begin], costs)


def test_the_restricted_wave_gives_up_where_a_buffer_could_run_over():
    costs = plain.costs_of(np.zeros((40, 40), dtype=np.uint8))
    for room, gives_up in ((40, True), (400, False)):
        wave, begin = wave_over(costs, 40, room)
        size = wave.states.size
        _, _, fill, _, _ = spread_towards(
            wave, np.zeros(size, dtype=np.float32), UNREACHED, F(254), begin + 1300, 10_000,
            seed_cell(wave, begin + 820), 1, np.empty(size, dtype=np.int32),
        )  # fmt: skip
        assert (fill == room) is gives_up
        assert (wave.states < 256).all()


@given(st.integers(0, 2**32 - 1))
def test_up_to_its_limit_the_remainder_is_that_without_one(seed):
    random = np.random.default_rng(seed)
    grid = CostGrid(0.05, 0.0, 0.0, random_cells(random, 20, 80))
    field, costs = a_field(grid), navfn_costs(allow_unknown=True)
    states = field._wave.states
    free = np.flatnonzero(states < 254)
    if free.size == 0:
        return
    goal, limit = int(random.choice(free)), float(random.integers(200, 3000))
    limited, endless = CostToGo(field._wave, costs), CostToGo(field._wave, costs)
    assert limited.renew(goal, limit)
    assert endless.renew(goal, FAR)
    assert endless.whole
    within = endless.ahead <= limit
    assert np.array_equal(limited.ahead[within], endless.ahead[within])
    assert (limited.ahead[~within] > limit).all()
    assert limited.whole or (endless.ahead[~within] < UNREACHED).any()
    assert not limited.whole or (endless.ahead[limited.ahead >= UNREACHED] >= UNREACHED).all()
    for _ in range(3):
        window = disturb(random, grid)
        if field._copy(window):
            limited.follow(window)
            endless.follow(window)
    # Relaxed in another order, values differ by less than the wave would care for.
    within = endless.ahead <= limit - 100.0
    assert limited.ahead[within] == pytest.approx(endless.ahead[within], rel=0.02, abs=2.0)


def test_a_goal_walled_in_has_no_path_until_the_wall_is_gone():
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((150, 150), dtype=np.uint8))
    twin = CostGrid(0.05, 0.0, 0.0, grid.cells)
    field = a_field(grid, worthwhile=1)
    whole = a_field(twin, margins=())
    goal, wall = 75 * 150 + 120, (110, 65, 131, 86)
    for step, value in enumerate((0, 0, 0, 254, 254, 254, 0, 0, 0)):
        grid.cells[65:86, 110:131] = value
        grid.cells[66:85, 111:130] = 0
        grid.touch(wall)
        twin.touch(wall)
        start = 75 * 150 + 20 + step
        found = path(field, start, goal)
        assert np.array_equal(found, path(whole, start, goal))
        assert (len(found) == 0) is (value == 254)
    assert field.restricted > 3


def test_what_remains_is_the_least_beside_a_cell():
    # A corridor of one row: a step along it costs 50, and beside it there is no way.
    costs = np.full(100, 254, dtype=np.uint16)
    costs[51:59] = 50
    wave, begin = wave_over(costs, 10)
    remainder = CostToGo(wave, navfn_costs(allow_unknown=True))
    assert remainder.renew(begin + 52, 1e6)
    assert remainder.whole
    assert [remainder.at(begin + n) for n in (52, 53, 54, 57)] == [0.0, 0.0, 50.0, 200.0]
    # A cell that is blocked itself is left to the side; one that is off the corridor, nowhere.
    assert [remainder.at(begin + n) for n in (45, 65)] == [150.0, 150.0]
    assert remainder.at(begin + 80) == FAR
    remainder.drop()
    assert remainder.goal == -1
