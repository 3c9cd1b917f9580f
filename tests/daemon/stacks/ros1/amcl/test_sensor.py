import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.stacks.ros1.amcl.laser_model import LaserModel, beam_indices, map_range
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid
from grammars.model.robot import Laser
from tests.daemon.stacks.ros1.amcl import plain
from tests.daemon.stacks.ros1.amcl.world import LASER, PUBLISHED, a_room, map_of, see

WALLS = a_room(4.0, 3.0, 0.2)
GRID = map_of(WALLS)
FIELD, _ = plain.brushfire(GRID, PUBLISHED.laser_likelihood_max_dist)
TRUTH = Pose2(1.5, 1.7, 0.4)
NOTHING = np.full(LASER.rays, np.inf, dtype=np.float32)


def weigh(
    p, ranges, poses, *, grid=GRID,
    converged=False, laser=LASER, original=True):  # fmt: skip
    """Weights of poses (n, 3) that all weighed 1 before."""
    p = replace(p, max_particles=max(len(poses), p.min_particles))
    sensor = LaserModel(p, FAST if original else FIXED, grid, laser)
    weights = np.ones(len(poses))
    directions = np.array([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    columns = np.ascontiguousarray(poses.T)
    total = sensor.weigh(
        np.asarray(ranges, dtype=np.float32), columns, directions, len(poses), weights,
        converged=converged,
    )  # fmt: skip
    assert total == pytest.approx(weights.sum())
    return weights


def around(pose, count, sigma=0.3, seed=0):
    noise = np.random.default_rng(seed).standard_normal((count, 3)) * sigma
    return np.array([pose.x, pose.y, pose.yaw]) + noise


def test_every_fifth_of_150_rays_is_used():
    np.testing.assert_array_equal(beam_indices(PUBLISHED, 150), np.arange(0, 146, 5))


@pytest.mark.parametrize(
    ("model", "rays", "beams", "step"),
    [
        ("likelihood_field", 10, 30, 1),
        ("likelihood_field", 1, 30, 1),
        ("likelihood_field", 181, 60, 3),
        ("likelihood_field_prob", 151, 30, 6),
    ],
)
def test_beams_are_so_many_rays_apart(model, rays, beams, step):
    p = replace(PUBLISHED, laser_model_type=model, laser_max_beams=beams)
    np.testing.assert_array_equal(beam_indices(p, rays), np.arange(0, rays, step))


def test_weights_are_one_plus_the_sum_of_cubes():
    ranges = see(WALLS, TRUTH, np.random.default_rng(0))
    ranges[35:60] = np.inf
    ranges[70], ranges[80], ranges[90] = np.nan, 5.6, 0.05
    poses = around(TRUTH, 400)
    expected = plain.likelihood(PUBLISHED, GRID, FIELD, LASER, poses, ranges)
    np.testing.assert_allclose(weigh(PUBLISHED, ranges, poses), expected, rtol=1e-12)


@pytest.mark.parametrize("value", [np.inf, np.nan, 5.6, 7.0, 0.05, 0.0, -np.inf])
@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob"])
def test_rays_without_a_usable_return_tell_nothing(model, value):
    p = replace(PUBLISHED, laser_model_type=model)
    ranges = np.full(LASER.rays, value, dtype=np.float32)
    np.testing.assert_array_equal(weigh(p, ranges, around(TRUTH, 5)), 1.0)


def test_parameters_narrow_what_the_scanner_says():
    near, far = NOTHING.copy(), NOTHING.copy()
    near[0], far[0] = 0.4, 4.0
    poses = around(TRUTH, 3)
    for name, value, ranges in (("laser_min_range", 0.5, near), ("laser_max_range", 3.0, far)):
        assert (weigh(PUBLISHED, ranges, poses) > 1.0).all()
        assert (weigh(replace(PUBLISHED, **{name: value}), ranges, poses) == 1.0).all()


def test_ends_off_the_map_are_as_far_from_everything_as_can_be():
    ranges = see(WALLS, TRUTH)
    used = np.count_nonzero(np.isfinite(ranges[beam_indices(PUBLISHED, LASER.rays)]))
    lowest = 1.0 + used * (0.05 / plain.single(5.6)) ** 3
    lost = np.array([[1e3, 0.0, 0.0], [0.0, -1e3, 1.0], [-50.0, 80.0, 2.0], [1e12, 1e12, 0.0]])
    np.testing.assert_allclose(weigh(PUBLISHED, ranges, lost), lowest, rtol=1e-12)


def one_wall():
    """Column 40 is a wall: from x = 1.0 to x = 1.05."""
    cells = np.full((80, 81), FREE, dtype=np.int8)
    cells[:, 40] = OCCUPIED
    return OccupancyGrid(0.05, -1.0, -2.0, cells)


@pytest.mark.parametrize(("original", "first", "last"), [(True, 0.975, 1.025), (False, 1.0, 1.05)])
def test_cells_are_looked_up_half_a_cell_low(original, first, last):
    """A return right ahead hits the wall's cell from 2.5 cm before its painted edge on."""
    laser = Laser(Pose2(), 0.3, 0.0, 0.0, 1, 0.05, 5.6, 10.0, 0.0, 0.0)
    x = np.array([first - 1e-4, first + 1e-4, last - 1e-4, last + 1e-4]) - 0.5
    poses = np.column_stack((x, np.zeros(4), np.zeros(4)))
    ranges = np.array([0.5], dtype=np.float32)
    best = 1.0 + (0.95 + 0.05 / 5.6) ** 3
    hit = weigh(PUBLISHED, ranges, poses, grid=one_wall(), laser=laser, original=original)
    np.testing.assert_allclose(hit[1:3], best, rtol=1e-7)
    assert (hit[[0, 3]] < best - 0.01).all()


@pytest.mark.parametrize(("thickness", "slides"), [(0.25, True), (0.05, False)])
def test_thick_walls_let_the_estimate_slide_along_the_view(thickness, slides):
    """Anywhere inside the painted band is as good as its edge: no return tells how deep."""
    walls = a_room(4.0, 3.0, thickness)
    truth = Pose2(1.3, 1.8, 0.0)
    steps = np.arange(0.0, 0.151, 0.05)
    poses = np.column_stack((truth.x + steps, np.full((len(steps), 2), (truth.y, truth.yaw))))
    ranges = see(walls, truth)
    ahead = np.arange(LASER.rays)
    ranges[np.abs(ahead - 75) > 20] = np.inf  # nothing but the wall ahead
    weights = weigh(PUBLISHED, ranges, poses, grid=map_of(walls))
    assert (weights[-1] > 0.99 * weights[0]) is np.bool_(slides)


def test_the_probabilistic_field_multiplies_beams():
    p = replace(PUBLISHED, laser_model_type="likelihood_field_prob")
    ranges, poses = see(WALLS, TRUTH), around(TRUTH, 200, 0.1)
    away = plain.distances_at_ends(p, GRID, FIELD, LASER, poses, ranges, range(0, 150, 5))
    expected = plain.pz(p, LASER, away).prod(axis=1)
    np.testing.assert_allclose(weigh(p, ranges, poses), expected, rtol=1e-9)


def test_beams_most_particles_disagree_with_are_skipped_once_converged():
    p = replace(
        PUBLISHED, laser_model_type="likelihood_field_prob", do_beamskip=True,
        beam_skip_distance=0.3,
    )  # fmt: skip
    ranges, poses = see(WALLS, TRUTH), around(TRUTH, 200, 0.02)
    ranges[60:90] = 0.5  # somebody stands before the robot
    away = plain.distances_at_ends(p, GRID, FIELD, LASER, poses, ranges, range(0, 150, 5))
    agree = (away < 0.3).mean(axis=0) > p.beam_skip_threshold
    assert 0 < np.count_nonzero(~agree) < 10
    kept = plain.pz(p, LASER, away[:, agree]).prod(axis=1)
    everything = plain.pz(p, LASER, away).prod(axis=1)
    np.testing.assert_allclose(weigh(p, ranges, poses, converged=True), kept, rtol=1e-9)
    np.testing.assert_allclose(weigh(p, ranges, poses, converged=False), everything, rtol=1e-9)
    sure = replace(p, beam_skip_error_threshold=0.1)
    np.testing.assert_allclose(weigh(sure, ranges, poses, converged=True), everything, rtol=1e-9)


def test_ranges_on_the_map_are_those_of_the_plain_walk():
    blocked = (GRID.cells != FREE).view(np.uint8)
    random = np.random.default_rng(1)
    for _ in range(300):
        x, y = random.uniform(-0.3, 4.8), random.uniform(-0.3, 3.8)
        angle, reach = random.uniform(-4.0, 4.0), random.uniform(0.2, 6.0)
        got = map_range(blocked, GRID.x, GRID.y, 0.05, 0.5, x, y, angle, reach)
        assert got == pytest.approx(plain.map_range(GRID, x, y, angle, reach), abs=1e-12)


def test_the_beam_model_mixes_four_ways_to_measure():
    p = replace(PUBLISHED, laser_model_type="beam")
    ranges = see(WALLS, TRUTH, np.random.default_rng(0))
    ranges[10], ranges[20], ranges[30], ranges[40] = np.inf, np.nan, 0.01, 5.6
    ranges[50:60] = 0.4
    poses = around(TRUTH, 30)
    expected = [plain.beam_likelihood(p, GRID, LASER, pose, ranges) for pose in poses]
    np.testing.assert_allclose(weigh(p, ranges, poses), expected, rtol=1e-9)


@pytest.mark.parametrize("model", ["beam", "likelihood_field", "likelihood_field_prob"])
def test_every_model_prefers_the_true_pose(model):
    p = replace(PUBLISHED, laser_model_type=model)
    off = TRUTH @ Pose2(0.1, -0.4, 0.3)
    poses = np.array([[q.x, q.y, q.yaw] for q in (TRUTH, off)])
    right, wrong = weigh(p, see(WALLS, TRUTH), poses)
    assert right > 1.2 * wrong
    assert math.isfinite(right)
