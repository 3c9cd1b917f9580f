"""The compiled planner against the plain one, and the restricted wave against the whole one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.navfn import GlobalPlannerParameters, NavfnParameters
from daemon.stacks.ros1.navfn.planner import GlobalPlanner, Navfn
from daemon.stacks.ros1.navfn.propagation import UNREACHED, propagate_wave, seed_cell
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from tests.stacks.ros1.navfn import building, plain
from tests.stacks.ros1.navfn.fields import a_field, a_grid, centre, path, wave_over

seeds = st.integers(0, 2**32 - 1)


def random_cells(random, low, high):
    """Inflated rooms with doors, smooth hills, salt and pepper, or a maze of single cells."""
    # Here, for every process of a round reads this file.
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    shape = tuple(random.integers(low, high, 2).tolist())
    kind = random.integers(4)
    if kind == 0:
        walls = np.zeros(shape, dtype=bool)
        for _ in range(random.integers(2, 7)):
            if random.random() < 0.5:
                walls[random.integers(shape[0])] = True
            else:
                walls[:, random.integers(shape[1])] = True
        for _ in range(random.integers(4, 30)):
            row, column, half = random.integers(shape[0]), random.integers(shape[1]), 3
            walls[max(0, row - half) : row + half, max(0, column - half) : column + half] = False
        away = distance_transform_edt(~walls) * 0.05
        cells = (252.0 * np.exp(-3.0 * (away - 0.085))).clip(0, 252)
        cells[away > 0.4] = 0
        cells[away <= 0.085] = 253
        return np.asarray(cells, dtype=np.uint8)
    if kind == 1:
        hills = gaussian_filter(random.normal(size=shape), 2.0)
        hills = (hills - hills.min()) / (hills.max() - hills.min())
        return np.asarray((hills * 300 - 40).clip(0, 254), dtype=np.uint8)
    if kind == 2:
        return random.choice([0, 0, 0, 0, 20, 100, 252, 253, 254, 255], size=shape).astype(np.uint8)
    return np.where(random.random(shape) < 0.33, 254, 0).astype(np.uint8)


def disturb(random, grid):
    """Change the costs of a small window, as a costmap does around the robot; return it."""
    rows, columns = grid.cells.shape
    row, column = int(random.integers(rows)), int(random.integers(columns))
    window = (column, row, min(columns, column + 9), min(rows, row + 9))
    cells = grid.cells[window[1] : window[3], window[0] : window[2]]
    cells[random.random(cells.shape) < 0.3] = random.choice([0, 0, 60, 254])
    grid.touch(window)
    return window


@given(seeds, st.booleans())
def test_plans_are_those_of_the_plain_planner(seed, allow_unknown):
    random = np.random.default_rng(seed)
    cells = random_cells(random, 5, 36)
    grid = CostGrid(0.05, -1.0, 2.0, cells)
    rows, columns = cells.shape
    planner = Navfn(NavfnParameters(allow_unknown=allow_unknown), FAST)
    x, y = random.random((2, 2)) * [[columns], [rows]] * 0.05 + [[-1.0], [2.0]]
    goal = Pose2(float(x[1]), float(y[1]), 1.0)
    for _ in range(3):
        start = Pose2(float(x[0]), float(y[0]))
        expected = plain.plan(grid, start, goal, allow_unknown=allow_unknown)
        found = planner.plan(grid, start, goal)
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert np.array_equal(found, expected)
        disturb(random, grid)


@pytest.mark.parametrize("size", [4, 8, 20])
def test_what_does_not_fit_into_a_buffer_is_lost(size):
    random = np.random.default_rng(size)
    cells = random.integers(0, 200, (40, 40)).astype(np.uint8)
    costs = plain.costs_of(cells)
    wave, begin = wave_over(costs, 40, size)
    start, goal = 20 * 40 + 20, 35 * 40 + 37
    waiting = seed_cell(wave, begin + start)
    propagate_wave(wave, begin + goal, np.float32(254), 80, UNREACHED, waiting, 1)
    expected = plain.wave(costs, 40, start, goal, size)
    assert np.array_equal(wave.potentials[begin:-begin], expected)


@given(seeds)
def test_the_restricted_wave_gives_the_same_path_while_costs_and_start_change(seed):
    random = np.random.default_rng(seed)
    cells = random_cells(random, 20, 130)
    grids = [CostGrid(0.05, 0.0, 0.0, cells) for _ in range(2)]
    margins = tuple(np.sort(random.integers(100, 2500, 3)).astype(float).tolist())
    restricted = a_field(grids[0], margins=margins, worthwhile=1)
    whole = a_field(grids[1], margins=())
    # On maps this small the limit of cycles would leave the restricted wave nothing to do.
    if seed % 4:
        restricted._cycles = whole._cycles = 100_000
    rows, columns = cells.shape
    goal = int(random.integers(cells.size))
    row, column = (int(random.integers(n)) for n in cells.shape)
    for _ in range(12):
        start = row * columns + column
        found, expected = path(restricted, start, goal), path(whole, start, goal)
        assert np.array_equal(found, expected)
        step = random.integers(-1, 2, 2)
        row = int(np.clip(row + step[0], 0, rows - 1))
        column = int(np.clip(column + step[1], 0, columns - 1))
        if random.random() < 0.5:
            grids[1].touch(disturb(random, grids[0]))


def test_the_restricted_wave_is_at_work_and_exact_in_the_corridor_of_building_c():
    random = np.random.default_rng(1)
    grid = building.costmap()
    twin = CostGrid(grid.resolution, grid.x, grid.y, grid.cells)
    restricted = a_field(grid)
    whole = a_field(twin, margins=())
    columns = grid.cells.shape[1]
    trips = building.drive(0.04)[1100:1127]
    for k, (start, goal) in enumerate(trips):
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        low, up = here[1] - 60, here[0] - 60
        window = (up, low, up + 120, low + 120)
        cells = grid.cells[low : low + 120, up : up + 120]
        inflated = (cells > 20) & (cells < 230) & (random.random(cells.shape) < 0.05)
        cells[inflated] += random.integers(-20, 20, int(inflated.sum())).astype(np.uint8)
        grid.touch(window)
        twin.touch(window)
        trip = here[1] * columns + here[0], there[1] * columns + there[0]
        found = path(restricted, *trip)
        if k % 13 == 0:
            assert np.array_equal(found, path(whole, *trip))
            assert found.shape[0] > 1000
    assert restricted.restricted > 20


def plan(grid, start, goal, tolerance=0.0):
    return Navfn(NavfnParameters(default_tolerance=tolerance), FAST).plan(grid, start, goal)


def test_without_the_quirk_paths_run_through_cell_centres():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    corner = Navfn(NavfnParameters(), FAST).plan(grid, start, goal)
    middle = Navfn(NavfnParameters(), FIXED).plan(grid, start, goal)
    assert middle[:-1, :2] - corner[:-1, :2] == pytest.approx(0.025)


@pytest.mark.parametrize(
    ("planner", "parameters"),
    [(Navfn, NavfnParameters()), (GlobalPlanner, GlobalPlannerParameters())],
)
def test_the_start_cell_is_freed_in_the_costmap_for_good(planner, parameters):
    grid = a_grid()
    grid.cells[10, 5] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    assert planner(parameters, FIXED).plan(grid, start, goal) is not None
    assert grid.cells[10, 5] == 254
    version = grid.version
    assert planner(parameters, FAST).plan(grid, start, goal) is not None
    assert grid.cells[10, 5] == 0
    assert grid.version == version + 1


def test_with_tolerance_the_nearest_point_of_a_square_raster_will_do():
    grid = a_grid()
    grid.cells[10, 30] = 254
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10, 0.7)
    found = plan(grid, start, goal, tolerance=0.1)
    assert np.abs(found[-1, :2] - (goal.x, goal.y)).max() == pytest.approx(0.05)
    assert found[-1, 2] == 0.7
    grid.cells[7:14, 27:34] = 254
    assert plan(grid, start, goal, tolerance=0.1) is None


def test_two_planners_of_one_costmap_both_see_its_changes():
    grid = a_grid()
    start, goal = centre(grid, 5, 10), centre(grid, 30, 10)
    planners = [Navfn(NavfnParameters(), FAST) for _ in range(2)]
    free = [planner.plan(grid, start, goal) for planner in planners]
    grid.cells[:, 20] = 254
    grid.touch((20, 0, 21, 20))
    assert all(plan is not None for plan in free)
    assert [planner.plan(grid, start, goal) is None for planner in planners] == [True, True]
