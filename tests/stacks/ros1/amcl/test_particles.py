import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.amcl.laser_model import beam_indices, make_sensor, weigh_particles
from daemon.stacks.ros1.amcl.particle_filter import motion_between, move_particles, summarise
from daemon.stacks.ros1.amcl.resampling import (
    FreeCells,
    Particles,
    clear_bins,
    fill_bins,
    label_clusters,
    new_bins,
    new_cloud,
    particle_limits,
    resample,
)
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid
from grammars.model.robot import Laser, Mount
from tests.stacks.ros1.amcl import plain
from tests.stacks.ros1.amcl.plain import moved
from tests.stacks.ros1.amcl.world import LASER, PUBLISHED, a_room, map_of, see

MODELS = ("diff", "omni", "diff-corrected", "omni-corrected")


def compiled(
    p, poses, before, after, normals,
    *, full_turns=True):  # fmt: skip
    columns = np.ascontiguousarray(poses.T)
    directions = np.array([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    move_particles(
        p, motion_between(before, after), Particles(columns, directions, np.ones(len(poses))),
        len(poses), normals.ravel(), full_turns=full_turns,
    )  # fmt: skip
    np.testing.assert_array_equal(directions, [np.cos(columns[2]), np.sin(columns[2])])
    return columns.T


def spread(model, **alphas):
    """Standard deviation of x, y, yaw after 0.1 m straight ahead, from one point."""
    p = replace(PUBLISHED, odom_model_type=model, **alphas)
    poses = np.zeros((20_000, 3))
    normals = np.random.default_rng(3).standard_normal((3, len(poses)))
    after = compiled(p, poses, Pose2(2.0, 1.0, 0.7), Pose2(2.0, 1.0, 0.7) @ Pose2(0.1), normals)
    np.testing.assert_allclose(after.mean(axis=0), [0.1, 0.0, 0.0], atol=2e-3)
    return after.std(axis=0)


def test_spreads_of_a_straight_step_are_those_the_original_shows():
    np.testing.assert_allclose(spread("omni-corrected"), [0.032, 0.045, 0.032], rtol=0.03)
    np.testing.assert_allclose(spread("diff-corrected"), [0.032, 0.003, 0.045], rtol=0.1)
    # Models that are not corrected take variances for standard deviations.
    np.testing.assert_allclose(spread("omni"), [0.001, 0.002, 0.001], rtol=0.03)
    np.testing.assert_allclose(spread("diff")[[0, 2]], [0.001, 0.001 * math.sqrt(2.0)], rtol=0.03)


@given(
    model=st.sampled_from(MODELS),
    x=st.floats(-0.4, 0.4),
    y=st.floats(-0.4, 0.4),
    before=st.floats(-3.1, 3.1),
    after=st.floats(-3.1, 3.1),
    seed=st.integers(0, 1000),
)
def test_particles_move_as_in_the_plain_version(model, x, y, before, after, seed):
    random = np.random.default_rng(seed)
    p = replace(PUBLISHED, odom_model_type=model, odom_alpha1=0.11, odom_alpha3=0.3)
    poses = random.uniform(-5.0, 5.0, (50, 3))
    normals = random.standard_normal((3, 50))
    start, end = Pose2(1.0, 2.0, before), Pose2(1.0 + x, 2.0 + y, after)
    got, wanted = compiled(p, poses, start, end, normals), moved(p, poses, start, end, normals)
    np.testing.assert_allclose(got[:, :2], wanted[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * got[:, 2]), np.exp(1j * wanted[:, 2]), atol=1e-9)


def test_driving_backwards_leaves_headings_a_full_turn_apart():
    """Two half turns add up to nothing or to a full turn, and nobody wraps them: an oddity."""
    p = replace(PUBLISHED, odom_model_type="diff-corrected")
    normals = np.random.default_rng(0).standard_normal((3, 400))
    back = compiled(p, np.zeros((400, 3)), Pose2(), Pose2(-0.3), normals)
    assert set(np.round(back[:, 2] / math.tau)) == {-1.0, 0.0, 1.0}
    fixed = compiled(p, np.zeros((400, 3)), Pose2(), Pose2(-0.3), normals, full_turns=False)
    np.testing.assert_array_equal(fixed[:, :2], back[:, :2])
    assert set(np.round(fixed[:, 2] / math.tau)) == {0.0}


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
        FreeCells(free, 40, -1.0, -2.0, 0.05), particle_limits(p), new, bins,
    )  # fmt: skip
    result = new.poses[:, :count].T
    assert len({plain.bin_of(pose) for pose in result}) == bins.used[0]
    keys = [tuple(bins.keys[k].tolist()) for k in bins.of[:count]]
    assert keys == [plain.bin_of(pose) for pose in result]
    np.testing.assert_array_equal(new.directions[0, :count], np.cos(result[:, 2]))
    clear_bins(bins)
    assert (bins.slots == -1).all()
    return result


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


def summarised(poses, weights):
    count, columns = len(poses), np.ascontiguousarray(poses.T)
    bins = new_bins(count)
    fill_bins(bins, columns, count)
    labels, _ = label_clusters(bins)
    assert labels[bins.of].tolist() == plain.clusters(poses)
    directions = np.array([np.cos(columns[2]), np.sin(columns[2])])
    return summarise(Particles(columns, directions, weights), count, bins)


def a_cloud(count, spread, seed):
    random = np.random.default_rng(seed)
    centres = random.uniform(-4.0, 4.0, (3, 3))
    return centres[random.integers(3, size=count)] + spread * random.standard_normal((count, 3))


@given(count=st.integers(1, 200), spread=st.floats(0.01, 2.0), seed=st.integers(0, 2**32 - 1))
def test_clusters_estimate_and_spread_are_those_of_the_plain_version(count, spread, seed):
    poses = a_cloud(count, spread, seed)
    weights = np.random.default_rng(seed).random(count) + 0.01
    weights /= weights.sum()
    result = summarised(poses, weights)
    pose, mean, covariance = plain.summary(poses, weights)
    np.testing.assert_allclose(result[:3], pose, atol=1e-9)
    np.testing.assert_allclose(result[3:6], mean, atol=1e-9)
    xx, xy, yy, yaw = result[6:]
    np.testing.assert_allclose([[xx, xy], [xy, yy]], covariance[:2, :2], atol=1e-10)
    np.testing.assert_allclose(yaw, covariance[2, 2], atol=1e-10)


def test_equal_headings_have_no_variance_and_opposite_ones_a_mean_across_the_seam():
    same = summarised(np.full((7, 3), 0.7), np.full(7, 1.0 / 7.0))
    assert 0.0 <= same[9] < 1e-12
    seam = np.array([[0.0, 0.0, 3.1], [0.0, 0.0, 3.1 - 2.0 * np.pi + 0.1]])
    across = summarised(seam, np.array([0.5, 0.5]))
    assert abs(across[5]) > 3.0


WALLS = a_room(4.0, 3.0, 0.2)
GRID = map_of(WALLS)
TRUTH = Pose2(1.5, 1.7, 0.4)
NOTHING = np.full(LASER.rays, np.inf, dtype=np.float32)


def weigh(
    p, ranges, poses, *, grid=GRID,
    laser=LASER, original=True):  # fmt: skip
    """Weights of poses (n, 3) that all weighed 1 before."""
    p = replace(p, max_particles=max(len(poses), p.min_particles))
    sensor = make_sensor(p, FAST if original else FIXED, grid, laser)
    weights = np.ones(len(poses))
    directions = np.array([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    columns = np.ascontiguousarray(poses.T)
    cloud = Particles(columns, directions, weights)
    ranges = np.asarray(ranges, dtype=np.float32)
    total = weigh_particles(sensor, ranges, cloud, len(poses))
    assert total == pytest.approx(weights.sum())
    return weights


def around(pose, count, sigma=0.3, seed=0):
    noise = np.random.default_rng(seed).standard_normal((count, 3)) * sigma
    return np.array([pose.x, pose.y, pose.yaw]) + noise


@pytest.mark.parametrize(
    ("rays", "beams", "step"), [(150, 30, 5), (10, 30, 1), (1, 30, 1), (181, 60, 3)]
)
def test_beams_are_so_many_rays_apart(rays, beams, step):
    p = replace(PUBLISHED, laser_max_beams=beams)
    np.testing.assert_array_equal(beam_indices(p, rays), np.arange(0, rays, step))


def test_weights_are_one_plus_the_sum_of_cubes():
    ranges = see(WALLS, TRUTH, np.random.default_rng(0))
    ranges[35:60] = np.inf
    ranges[70:105:5] = np.nan, 5.6, 7.0, 0.05, 0.0, -np.inf, np.inf
    off_the_map = [(1e3, 0.0, 0.0), (0.0, -1e3, 1.0), (-50.0, 80.0, 2.0), (1e12, 1e12, 0.0)]
    poses = np.concatenate((around(TRUTH, 400), off_the_map))
    field, _ = plain.brushfire(GRID, PUBLISHED.laser_likelihood_max_dist)
    expected = plain.likelihood(PUBLISHED, GRID, field, LASER, poses, ranges)
    np.testing.assert_allclose(weigh(PUBLISHED, ranges, poses), expected, rtol=1e-12)


def test_parameters_narrow_what_the_scanner_says():
    near, far = NOTHING.copy(), NOTHING.copy()
    near[0], far[0] = 0.4, 4.0
    poses = around(TRUTH, 3)
    for name, value, ranges in (("laser_min_range", 0.5, near), ("laser_max_range", 3.0, far)):
        assert (weigh(PUBLISHED, ranges, poses) > 1.0).all()
        assert (weigh(replace(PUBLISHED, **{name: value}), ranges, poses) == 1.0).all()


def one_wall():
    """Column 40 is a wall: from x = 1.0 to x = 1.05."""
    cells = np.full((80, 81), FREE, dtype=np.int8)
    cells[:, 40] = OCCUPIED
    return OccupancyGrid(0.05, -1.0, -2.0, cells)


@pytest.mark.parametrize(("original", "first", "last"), [(True, 0.975, 1.025), (False, 1.0, 1.05)])
def test_cells_are_looked_up_half_a_cell_low(original, first, last):
    """A return right ahead hits the wall's cell from 2.5 cm before its painted edge on."""
    laser = Laser(Mount(0.0), 0.3, 0.0, 0.0, 1, 0.05, 5.6, 10.0, 0.0, 0.0)
    x = np.array([first - 1e-4, first + 1e-4, last - 1e-4, last + 1e-4]) - 0.5
    poses = np.column_stack((x, np.zeros(4), np.zeros(4)))
    ranges = np.array([0.5], dtype=np.float32)
    best = 1.0 + (0.95 + 0.05 / 5.6) ** 3
    hit = weigh(PUBLISHED, ranges, poses, grid=one_wall(), laser=laser, original=original)
    np.testing.assert_allclose(hit[1:3], best, rtol=1e-7)
    assert (hit[[0, 3]] < best - 0.01).all()
