"""Footprints, readers and layers of costmaps, and costmaps that are refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.stacks.ros1.costmap import SensedScan
from daemon.stacks.ros1.costmap._observations import hears_height
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    inscribed_radius,
)
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2
from grammars.model.grid import OccupancyGrid

A2S = ((-0.08, -0.075), (-0.08, 0.075), (0.105, 0.075), (0.105, -0.075))
DIFF = ((-0.35, -0.233), (-0.35, 0.233), (0.35, 0.233), (0.35, -0.233))
OMNI = ((-0.35, -0.22), (-0.35, 0.22), (0.35, 0.22), (0.35, -0.22))
LASER = ObservationSource("scan", "/scan", clearing=True, obstacle_range=3.0, raytrace_range=3.5)
OBSTACLES = ObstacleLayer(sources=(LASER,))
INFLATION = InflationLayer(inflation_radius=0.5, cost_scaling_factor=3.0)
STILL = LayeredCostmap((StaticLayer(), OBSTACLES, INFLATION), footprint=A2S)
HERE = Pose2(1.0, 1.0)


def inflated(**values):
    """Return the costmap that stands still with another inflation."""
    return replace(STILL, layers=(*STILL.layers[:2], replace(INFLATION, **values)))


def made(parameters=STILL, cells=None, quirks=FAST):
    cells = np.zeros((60, 200), dtype=np.int8) if cells is None else cells.astype(np.int8)
    grid = OccupancyGrid(0.05, 0.0, 0.0, cells)
    return Costmap(parameters, parameters.padded_footprint(), quirks, grid, lambda topic: ("",))


def looking(away):
    """One ray along x from (1.025, 1.025)."""
    ranges = np.array([away], dtype=np.float32)
    return SensedScan(Pose2(1.025, 1.025), ranges, np.zeros(1), 0.05, 5.6)


def test_each_reader_learns_tightly_what_changed():
    costmap = made()
    costmap.update(HERE, (looking(1.5),))
    readers = costmap.grid.watch(), costmap.grid.watch()
    version = costmap.grid.version
    costmap.update(HERE, (looking(1.5),))
    assert costmap.grid.version == version
    costmap.update(HERE, (looking(1.55),))
    assert [each.take() for each in readers] == [(40, 10, 62, 31)] * 2


def test_costmaps_of_one_map_do_not_share_their_cells():
    one, other = made(), made()
    one.update(HERE, (looking(1.5),))
    assert not other.grid.cells.any()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (inflated(inflation_radius=20.0), "inflation_radius 20 m is 400 cells"),
        (LayeredCostmap(rolling_window=True, width=0.01), "has no cell"),
    ],
)
def test_impossible_costmaps_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        made(parameters)


def test_a_scan_has_as_many_ranges_as_angles():
    scan = replace(looking(1.0), ranges=np.ones(2, dtype=np.float32))
    with pytest.raises(ValueError, match="2 ranges at 1 angles"):
        made().update(HERE, (scan,))


def test_points_have_single_precision_so_a_limit_may_be_passed_by_its_own_height():
    low = ObservationSource("scan", "/scan", max_obstacle_height=0.3)
    assert not hears_height(low, 0.3)
    assert hears_height(replace(low, max_obstacle_height=0.5), 0.5)
    assert not hears_height(replace(low, min_obstacle_height=0.7, max_obstacle_height=1.0), 0.7)


def test_resets_say_which_of_the_layers_they_name_they_forgot():
    front, rear = replace(OBSTACLES, name="a/front"), replace(OBSTACLES, name="rear")
    costmap = made(replace(STILL, layers=(StaticLayer("map"), front, rear, INFLATION)))
    names = ("front", "map", "inflation_layer", "nobody")
    assert costmap.clear_layers(HERE, 3.0, names) == ("map", "front")
    assert costmap.clear_layers(HERE, 3.0, ("nobody",)) == ()
    assert costmap.clear_layers(HERE, 3.0, None) == ("front", "rear")


@pytest.mark.parametrize(("points", "inscribed"), [(A2S, 0.085), (DIFF, 0.243), (OMNI, 0.230)])
def test_radius_of_the_padded_footprint(points, inscribed):
    padded = LayeredCostmap(footprint=points).padded_footprint()
    assert padded.max(axis=0) == pytest.approx(np.array(points).max(axis=0) + 0.01)
    assert padded.min(axis=0) == pytest.approx(np.array(points).min(axis=0) - 0.01)
    assert inscribed_radius(padded) == pytest.approx(inscribed, abs=5e-4)


def test_a_coordinate_of_zero_is_not_padded():
    corners = ((0.0, 0.2), (-0.1, 0.0), (0.1, 0.0))
    padded = LayeredCostmap(footprint=corners).padded_footprint()
    assert padded.tolist() == [[0.0, 0.2 + 0.01], [-0.1 - 0.01, 0.0], [0.1 + 0.01, 0.0]]


def test_a_footprint_beside_the_origin_has_an_inscribed_radius_all_the_same():
    beside = np.array([(1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)])
    assert inscribed_radius(beside) == 1.0


def test_a_radius_stands_for_sixteen_corners():
    corners = LayeredCostmap(robot_radius=0.3, footprint_padding=0.0).padded_footprint()
    assert corners.shape == (16, 2)
    assert np.hypot(*corners.T) == pytest.approx(0.3)
    assert inscribed_radius(corners) == pytest.approx(0.3 * math.cos(math.pi / 16))


@pytest.mark.parametrize("in_order", [False, True])
def test_a_grid_that_stands_still_begins_as_its_first_cycle_leaves_it(in_order):
    cells = 100 * (np.random.default_rng(3).random((60, 200)) < 0.05)
    parameters = LayeredCostmap((StaticLayer(), INFLATION), footprint=A2S)
    costmap = made(parameters, cells, replace(FAST, inflation_queue_order=in_order))
    before = costmap.grid.cells.copy()
    assert len(np.unique(before)) > 5
    costmap.update(HERE)
    np.testing.assert_array_equal(costmap.grid.cells, before)
