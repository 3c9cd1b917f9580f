"""The costmap leaves the same cells as the plain update cycle, whatever happens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.stacks.ros1.costmap import Costmap, CostmapParameters, ObservationSource, SensedScan
from daemon.stacks.ros1.quirks import FIXED, ORIGINAL
from grammars.model.geometry import Pose2
from grammars.model.grid import OccupancyGrid
from tests.daemon.stacks.ros1.costmap.plain import PlainCostmap

ROWS, COLUMNS = 22, 30
ANGLES = np.linspace(-2.0, 2.0, 23)
RING = np.array([[-0.08, -0.06], [0.1, -0.06], [0.1, 0.06], [-0.08, 0.06]])
BOTH = ObservationSource(data_type="LaserScan", clearing=True)


def random_map(rng: np.random.Generator) -> OccupancyGrid:
    share = [0.9, 0.05, 0.05] if rng.random() < 0.7 else [1.0, 0.0, 0.0]
    cells = rng.choice(np.array([0, 100, -1], dtype=np.int8), size=(ROWS, COLUMNS), p=share)
    return OccupancyGrid(0.05, -0.3, -0.2, cells)


def random_scan(rng: np.random.Generator, base: Pose2) -> SensedScan:
    ranges = rng.uniform(0.02, 1.1, ANGLES.size).astype(np.float32)
    ranges[rng.random(ANGLES.size) < 0.2] = np.inf
    return SensedScan(base @ Pose2(0.05, 0.0), ranges, ANGLES, 0.05, 1.0)


def random_pose(rng: np.random.Generator) -> Pose2:
    return Pose2(*rng.uniform((-0.35, -0.25, -3.0), (1.3, 1.0, 3.0)).tolist())


def random_parameters(rng: np.random.Generator) -> CostmapParameters:
    return CostmapParameters(
        sources=(BOTH,),
        inflation_radius=float(rng.choice([0.0, 0.1, 0.13, 0.15, 0.22, 0.3])),
        cost_scaling_factor=float(rng.choice([1.0, 8.0])),
        obstacle_range=float(rng.uniform(0.2, 1.0)),
        raytrace_range=float(rng.uniform(0.2, 1.0)),
        track_unknown_space=(None, True, False)[int(rng.integers(3))],
        inflate_unknown=bool(rng.random() < 0.3),
    )


def compare(costmap: Costmap, plain: PlainCostmap, rng: np.random.Generator, steps: int) -> None:
    scan = None
    for _ in range(steps):
        base = random_pose(rng)
        if rng.random() < 0.8:
            scan = random_scan(rng, base)
        what = rng.random()
        if what < 0.2:
            half = float(rng.uniform(0.05, 0.5))
            where = random_pose(rng)
            costmap.clear_square(where, half)
            plain.clear_square(where, half)
        elif what < 0.4:
            x, y = int(rng.integers(plain.cells.shape[1])), int(rng.integers(plain.cells.shape[0]))
            costmap.grid.cells[y, x] = plain.cells[y, x] = 0
            costmap.grid.touch((x, y, x + 1, y + 1))
        elif what < 0.45:
            costmap.clear_obstacles_outside(base, 0.5)
            plain.clear_obstacles_outside(base, 0.5)
        before = costmap.grid.cells.copy()
        where = (costmap.grid.x, costmap.grid.y)
        costmap.grid.take_changed()
        costmap.update(base, scan)
        plain.update(base, scan)
        assert (costmap.grid.x, costmap.grid.y) == pytest.approx((plain.x, plain.y))
        np.testing.assert_array_equal(costmap.grid.cells, plain.cells)
        x0, y0, x1, y1 = costmap.grid.take_changed()
        same = before == costmap.grid.cells
        same[y0:y1, x0:x1] = True
        assert same.all() or where != (costmap.grid.x, costmap.grid.y)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), fixed=st.booleans())
def test_a_grid_that_follows_changes_shows_what_the_plain_cycle_shows(
    seed: int, fixed: bool
) -> None:
    rng = np.random.default_rng(seed)
    parameters = replace(random_parameters(rng), static_map=True)
    world, quirks = random_map(rng), FIXED if fixed else ORIGINAL
    costmap = Costmap(parameters, RING, quirks, world)
    compare(costmap, PlainCostmap(parameters, RING, quirks, world), rng, 8)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), fixed=st.booleans(), rolling=st.booleans())
def test_a_grid_without_a_map_shows_what_the_plain_cycle_shows(
    seed: int, fixed: bool, rolling: bool
) -> None:
    rng = np.random.default_rng(seed)
    size = {"width": 1.2, "height": 0.9, "rolling_window": rolling}
    parameters = replace(random_parameters(rng), **size)
    quirks = FIXED if fixed else ORIGINAL
    costmap = Costmap(parameters, RING, quirks)
    compare(costmap, PlainCostmap(parameters, RING, quirks), rng, 6)
