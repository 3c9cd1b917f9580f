import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.amcl.resampling import (
    FreeCells,
    Particles,
    clear_bins,
    new_bins,
    new_cloud,
    particle_limits,
    resample,
)
from tests.stacks.ros1.amcl import plain
from tests.stacks.ros1.amcl.world import PUBLISHED

NO_CELLS = np.empty(0, dtype=np.int32)


def drawn(
    p, poses, weights, draws, injection=0.0,
    free=NO_CELLS):  # fmt: skip
    """New poses (n, 3); checks what must hold of any draw."""
    most = p.max_particles
    columns = np.zeros((3, most))
    columns[:, : len(poses)] = poses.T
    directions = np.array([np.cos(columns[2]), np.sin(columns[2])])
    everyone = np.zeros(most)
    everyone[: len(weights)] = weights
    new, bins = new_cloud(most), new_bins(most)
    count = resample(
        Particles(columns, directions, everyone), len(poses), injection, draws,
        FreeCells(free, 40, -1.0, -2.0, 0.05), particle_limits(p), new, bins, np.empty(most + 1),
        np.empty(most, dtype=np.int32),
    )  # fmt: skip
    result = new.poses[:, :count].T
    assert len({plain.bin_of(pose) for pose in result}) == bins.used[0]
    keys = [tuple(bins.keys[k].tolist()) for k in bins.of[:count]]
    assert keys == [plain.bin_of(pose) for pose in result]
    np.testing.assert_array_equal(new.directions[0, :count], np.cos(result[:, 2]))
    clear_bins(bins)
    assert (bins.slots == -1).all()
    return result


def test_the_table_of_limits_is_that_of_the_published_configuration():
    table = particle_limits(PUBLISHED)
    assert (table[2:8] == 500).all()
    assert [table[k] for k in (1, 8, 10, 15, 20, 30)] == [2000, 525, 651, 955, 1249, 1822]
    assert (table[34:] == 2000).all()


@given(err=st.floats(0.001, 0.2), z=st.floats(0.0, 3.5), most=st.integers(1, 300))
def test_limits_are_those_of_the_formula(err, z, most):
    p = replace(PUBLISHED, kld_err=err, kld_z=z, min_particles=min(20, most), max_particles=most)
    np.testing.assert_array_equal(
        particle_limits(p)[1:], [plain.limit(p, k) for k in range(1, most + 1)]
    )


@given(
    count=st.integers(1, 300),
    spread=st.floats(0.05, 3.0),
    uneven=st.floats(0.0, 40.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_particles_are_drawn_as_one_at_a_time(count, spread, uneven, seed):
    random = np.random.default_rng(seed)
    p = replace(PUBLISHED, min_particles=20, max_particles=300, kld_err=0.05)
    poses = random.normal(0.0, spread, (count, 3))
    weights = np.exp(uneven * random.random(count))
    weights[random.random(count) < 0.2] = 0.0
    weights[random.integers(count)] = 1.0
    weights /= weights.sum()
    draws = random.random(300)
    np.testing.assert_array_equal(
        drawn(p, poses, weights, draws), plain.resampled(p, poses, weights, draws)
    )


def test_a_draw_beyond_the_rounded_sum_takes_the_last_particle():
    p = replace(PUBLISHED, min_particles=2, max_particles=10)
    poses = np.arange(30.0).reshape(10, 3)
    weights = np.full(10, 0.1 - 1e-12)
    got = drawn(p, poses, weights, np.full(10, np.nextafter(1.0, 0.0)))
    assert (got == poses[-1]).all()


def test_one_bin_asks_for_all_particles_and_two_for_few():
    weights = np.full(2000, 1.0 / 2000)
    draws = np.random.default_rng(0).random(2000)
    together = np.full((2000, 3), 0.1)
    assert len(drawn(PUBLISHED, together, weights, draws)) == 2000
    apart = together.copy()
    apart[1000:, 0] += 0.5
    assert len(drawn(PUBLISHED, apart, weights, draws)) == 501


def test_injected_particles_stand_on_free_cells_with_any_heading():
    p = replace(PUBLISHED, min_particles=2000)
    free = np.array([3, 45, 80], dtype=np.int32)  # of a map 40 cells wide from (-1, -2)
    poses, weights = np.full((2000, 3), 9.0), np.full(2000, 1.0 / 2000)
    draws = np.random.default_rng(0).random(6000)
    got = drawn(p, poses, weights, draws, 0.25, free)
    injected = got[got[:, 0] != 9.0]
    assert len(injected) / len(got) == pytest.approx(0.25, abs=0.03)
    places, counts = np.unique(injected[:, :2].round(9), axis=0, return_counts=True)
    np.testing.assert_allclose(places, [[-1.0, -1.9], [-0.85, -2.0], [-0.75, -1.95]], atol=1e-9)
    assert counts.min() > 0.25 * len(injected)
    assert injected[:, 2].std() == pytest.approx(math.tau / math.sqrt(12.0), rel=0.05)
    assert np.abs(injected[:, 2]).max() <= math.pi
