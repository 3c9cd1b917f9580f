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
from daemon.stacks.ros1.quirks import FAST, FIXED
from tests.daemon.stacks.ros1.dwa import plain
from tests.daemon.stacks.ros1.dwa.helpers import A2S, OMNI, random_problem

FEW_DIFF = replace(A2S, vx_samples=6, vth_samples=7)
FEW_OMNI = replace(OMNI, vx_samples=3, vy_samples=4, vth_samples=5)
VARIANTS = (
    FEW_DIFF,
    FEW_OMNI,
    replace(FEW_DIFF, sum_scores=True, twirling_scale=0.3),
    replace(FEW_DIFF, use_dwa=False, twirling_scale=0.3),
    replace(FEW_OMNI, use_dwa=False),
    replace(FEW_DIFF, goal_distance_bias=0.0),
    replace(FEW_DIFF, path_distance_bias=0.0),
    replace(FEW_DIFF, occdist_scale=0.0),
    replace(FEW_DIFF, occdist_scale=0.5, forward_point_distance=-0.1),
    replace(FEW_OMNI, scaling_speed=0.1, max_scaling_factor=0.8),
    replace(FEW_DIFF, angular_sim_granularity=2.0),
    replace(FEW_DIFF, min_vel_trans=0.0, min_vel_theta=0.0),
    replace(FEW_DIFF, occdist_scale=0.0, path_distance_bias=0.0),
    replace(FEW_DIFF, occdist_scale=0.0, path_distance_bias=0.0, goal_distance_bias=0.0),
)


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


@given(seed=st.integers(0, 2**32 - 1), variant=st.sampled_from(range(len(VARIANTS))))
def test_fast_and_plain_choose_the_same_sample(seed, variant):
    rng = np.random.default_rng(seed)
    quirks = FAST if rng.random() < 0.7 else FIXED
    assert_same(random_problem(rng, VARIANTS[variant], quirks))


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
    compute_distances(seeds, passable, wanted, out, np.array([seeds, seeds]))
    expected = plain.distances(np.array(found, dtype=np.int32), cells)
    got = as_integers(out, (rows, columns))
    np.testing.assert_array_equal(got[first:, low:], expected[first:, low:])
