"""The fast decision is the plain one, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.base_local_planner.map_grid import (
    DIGITS,
    add_cell,
    compute_distances,
    distance_at,
    empty_set,
    passable_cells,
    unrestricted_distances,
    write_box,
)
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.quirks import FAST, FIXED
from tests.stacks.ros1.dwa import plain
from tests.stacks.ros1.dwa.helpers import A2S, OMNI, random_problem

FEW_DIFF = replace(A2S, vx_samples=6, vth_samples=7, twirling_scale=0.3)
FEW_OMNI = replace(OMNI, vx_samples=3, vy_samples=4, vth_samples=5)
VARIANTS = (
    FEW_DIFF,
    FEW_OMNI,
    replace(FEW_DIFF, sum_scores=True),
    replace(FEW_DIFF, use_dwa=False),
    replace(FEW_OMNI, use_dwa=False),
    replace(FEW_DIFF, goal_distance_bias=0.0, twirling_scale=0.0),
    replace(FEW_DIFF, path_distance_bias=0.0),
    replace(FEW_DIFF, occdist_scale=0.0),
    replace(FEW_DIFF, occdist_scale=0.5, forward_point_distance=-0.1),
    replace(FEW_OMNI, scaling_speed=0.1, max_scaling_factor=0.8),
    replace(FEW_DIFF, angular_sim_granularity=2.0),
    replace(FEW_DIFF, min_vel_trans=0.0, min_vel_theta=0.0),
    replace(FEW_DIFF, occdist_scale=0.0, path_distance_bias=0.0),
    replace(FEW_DIFF, occdist_scale=0.0, path_distance_bias=0.0, goal_distance_bias=0.0),
    # Nothing but the footprint counts: many samples cost the same, and the first wins.
    replace(FEW_DIFF, path_distance_bias=0.0, goal_distance_bias=0.0, twirling_scale=0.0),
    replace(FEW_OMNI, occdist_scale=0.0),
    # Nearly all points of these trajectories come from turning, and from driving: each is rounded.
    replace(FEW_DIFF, sim_granularity=1.0, sim_time=16.0, vth_samples=20),
    replace(FEW_DIFF, sim_granularity=0.003, sim_time=5.0, acc_lim_theta=0.5),
)


def as_drawn(problem, rng):
    """Return ``problem`` itself."""
    return problem


def far_away(problem, rng):
    """Return ``problem`` 1024 m further, where single precision has steps of 1.2e-4 m."""
    local, state = problem.local, problem.state.copy()
    state[:2] = np.float32(state[:2] + 1024.0)
    return replace(
        problem,
        state=state,
        plan=problem.plan + 1024.0,
        front_end=problem.front_end + 1024.0,
        local=replace(local, x=local.x + 1024.0, y=local.y + 1024.0),
    )


def among_thin_walls(problem, rng):
    """Return ``problem`` on a map of 1.1 m with rows of inscribed cells, which feet may touch."""
    cells = np.zeros((22, 22), dtype=np.uint8)
    for row, column in rng.integers(0, 22, (8, 2)).tolist():
        if rng.random() < 0.5:
            cells[row, column : column + 5] = 253
        else:
            cells[row : row + 5, column] = 253
    x, y = problem.state[:2].tolist()
    beside = rng.uniform(0.2, 0.9, 2)
    return replace(problem, local=CostGrid(0.05, x - beside[0], y - beside[1], cells))


def assert_bounds_hold(problem):
    """Compare what the search knows of samples before it follows them with their costs."""
    _, room = problem.search()
    costs = problem.costs()
    bounds = room.lower[: len(costs)]
    left = np.isfinite(bounds)
    assert (bounds[left] <= costs[left]).all()
    # Samples that were dropped, or followed, are not better than the winner.
    assert (costs[~left] >= costs.min(initial=np.inf)).all()


def assert_same(problem):
    """Compare place, cost, velocity and trajectory; return the place."""
    place, cost, velocity, points = problem.fast()
    expected, least, command = problem.plain()
    assert place == expected
    if place >= 0:
        assert cost == least
        np.testing.assert_array_equal(velocity, command)
        sample = problem.samples()[place]
        drawn, _ = plain.trajectory(problem.state, sample, problem.settings)
        np.testing.assert_array_equal(points, drawn)
    return place


def as_integers(distances, shape):
    """Return the distances of all cells of a grid of ``shape``."""
    cells = [(row, column) for row in range(shape[0]) for column in range(shape[1])]
    size, digits = shape[0] * shape[1], distances.shape[0] - DIGITS
    values = [distance_at(distances, row, column, size, digits) for row, column in cells]
    return np.array(values, dtype=np.int32).reshape(shape)


@pytest.mark.parametrize("place", [as_drawn, far_away, among_thin_walls])
@given(seed=st.integers(0, 2**32 - 1), variant=st.sampled_from(range(len(VARIANTS))))
def test_fast_and_plain_choose_the_same_sample(place, seed, variant):
    rng = np.random.default_rng(seed)
    quirks = FAST if rng.random() < 0.7 else FIXED
    problem = place(random_problem(rng, VARIANTS[variant], quirks), rng)
    assert_same(problem)
    assert_bounds_hold(problem)


@pytest.mark.parametrize("parameters", [A2S, OMNI])
def test_the_same_with_all_samples_of_the_paper(parameters):
    rng = np.random.default_rng(7)
    places = [assert_same(random_problem(rng, parameters)) for _ in range(12)]
    assert len({p for p in places if p >= 0}) > 3


@given(seed=st.integers(0, 2**32 - 1))
def test_distances_are_those_of_a_queue(seed):
    rng = np.random.default_rng(seed)
    rows, columns = int(rng.integers(2, 70)), int(rng.integers(2, 150))
    cells = np.where(rng.random((rows, columns)) < rng.uniform(0, 0.5), 254, 0).astype(np.uint8)
    found = [
        (int(rng.integers(rows)), int(rng.integers(columns))) for _ in range(rng.integers(1, 5))
    ]
    seeds, passable, wanted = (empty_set(cells.shape) for _ in range(3))
    for row, column in found:
        add_cell(seeds, row, column)
    passable_cells(cells, passable)
    low, first = int(rng.integers(columns)), int(rng.integers(rows))
    write_box(low, columns, first, rows, wanted)
    out = unrestricted_distances(cells.shape)
    compute_distances(seeds, passable, wanted, out)
    expected = plain.distances(np.array(found, dtype=np.int32), cells)
    got = as_integers(out, (rows, columns))
    np.testing.assert_array_equal(got[first:, low:], expected[first:, low:])
