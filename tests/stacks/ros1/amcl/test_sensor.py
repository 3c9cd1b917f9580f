from dataclasses import replace

import numpy as np
import pytest

from daemon.stacks.ros1.amcl.laser_model import LaserModel, beam_indices
from daemon.stacks.ros1.amcl.resampling import Particles
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid
from grammars.model.robot import Laser, Mount
from tests.stacks.ros1.amcl import plain
from tests.stacks.ros1.amcl.world import LASER, PUBLISHED, a_room, map_of, see

WALLS = a_room(4.0, 3.0, 0.2)
GRID = map_of(WALLS)
FIELD, _ = plain.brushfire(GRID, PUBLISHED.laser_likelihood_max_dist)
TRUTH = Pose2(1.5, 1.7, 0.4)
NOTHING = np.full(LASER.rays, np.inf, dtype=np.float32)


def weigh(
    p, ranges, poses, *, grid=GRID,
    laser=LASER, original=True):  # fmt: skip
    """Weights of poses (n, 3) that all weighed 1 before."""
    p = replace(p, max_particles=max(len(poses), p.min_particles))
    sensor = LaserModel(p, FAST if original else FIXED, grid, laser)
    weights = np.ones(len(poses))
    directions = np.array([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    columns = np.ascontiguousarray(poses.T)
    cloud = Particles(columns, directions, weights)
    total = sensor.weigh(np.asarray(ranges, dtype=np.float32), cloud, len(poses))
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
    ranges[70], ranges[80], ranges[90] = np.nan, 5.6, 0.05
    poses = around(TRUTH, 400)
    expected = plain.likelihood(PUBLISHED, GRID, FIELD, LASER, poses, ranges)
    np.testing.assert_allclose(weigh(PUBLISHED, ranges, poses), expected, rtol=1e-12)


@pytest.mark.parametrize("value", [np.inf, np.nan, 5.6, 7.0, 0.05, 0.0, -np.inf])
def test_rays_without_a_usable_return_tell_nothing(value):
    ranges = np.full(LASER.rays, value, dtype=np.float32)
    np.testing.assert_array_equal(weigh(PUBLISHED, ranges, around(TRUTH, 5)), 1.0)


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
    laser = Laser(Mount(0.0), 0.3, 0.0, 0.0, 1, 0.05, 5.6, 10.0, 0.0, 0.0)
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
