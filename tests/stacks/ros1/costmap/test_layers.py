"""Layers beside and over each other, heights, several lasers, resets."""

import math
from dataclasses import replace

import pytest

from daemon.stacks.ros1.costmap import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    hears_height,
)
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2
from tests.stacks.ros1.costmap.test_costmap import (
    A2S,
    FAR_AWAY,
    INFLATION,
    LASER,
    OBSTACLES,
    looking,
    value,
    with_voxels,
    world,
)

HERE = Pose2(1.0, 1.0)
TOPICS = {"/scan": ("front",), "/rear": ("rear",), "/both": ("front", "rear")}
REAR = replace(LASER, name="rear", topic="/rear")
FLAT = InflationLayer(inflation_radius=0.0)
"""Inflation that writes nothing: the cells are those of the layers."""


def build(*layers, grid=None, **values):
    parameters = replace(LayeredCostmap(layers, footprint=A2S), **values)
    footprint = parameters.padded_footprint()
    return Costmap(parameters, footprint, FAST, grid or world(), TOPICS.__getitem__)


def seen(laser, away, *, height=0.3, time=0.0, y=1.025):
    return replace(looking(away, y=y), laser=laser, height=height, time=time)


def wall(x):
    grid = world()
    grid.cells[:, int(x / 0.05)] = 100
    return grid


def test_several_obstacle_layers_are_all_kept():
    """As in TIAGo's files, where the laser is in the first layer of four."""
    front = replace(OBSTACLES, name="obstacle_laser_layer")
    rear = replace(OBSTACLES, name="obstacle_rear_layer", sources=(REAR,))
    deaf = ObstacleLayer("obstacle_vo_layer")
    costmap = build(StaticLayer(), front, rear, deaf, INFLATION)
    costmap.update(HERE, (seen("front", 1.5), seen("rear", 1.0, y=1.525)))
    assert value(costmap, 2.525, 1.025) == 254
    assert value(costmap, 2.025, 1.525) == 254
    costmap.update(HERE, (seen("front", 2.5), seen("rear", 1.0, y=1.525)))
    assert value(costmap, 2.525, 1.025) < 254
    assert value(costmap, 2.025, 1.525) == 254


@pytest.mark.parametrize(("method", "cost"), [(0, 0), (1, 254), (2, 254)])
def test_only_a_layer_that_overwrites_clears_walls_of_the_map(method, cost):
    layer = replace(OBSTACLES, combination_method=method, track_unknown_space=True)
    costmap = build(StaticLayer(), layer, FLAT, grid=wall(2.025))
    costmap.update(HERE, (seen("front", 2.5),))
    assert value(costmap, 2.025, 1.025) == cost
    assert value(costmap, 2.025, 2.0) == 254
    assert value(costmap, 3.525, 1.025) == (0 if method == 2 else 254)


def test_a_map_over_the_obstacles_hides_them_unless_it_takes_the_maximum():
    for maximum, cost in ((False, 0), (True, 254)):
        costmap = build(OBSTACLES, StaticLayer(use_maximum=maximum), FLAT)
        costmap.update(HERE, (seen("front", 1.5),))
        assert value(costmap, 2.525, 1.025) == cost


def test_only_what_lies_below_is_inflated():
    costmap = build(StaticLayer(), INFLATION, OBSTACLES, grid=wall(5.025))
    costmap.update(HERE, (seen("front", 1.5),))
    assert value(costmap, 5.225, 1.0) > 0
    assert value(costmap, 2.525, 1.025) == 254
    assert value(costmap, 2.525, 1.075) == 0
    twice = build(StaticLayer(), INFLATION, replace(INFLATION, inflation_radius=0.3))
    twice.update(HERE)
    assert not twice.grid.cells.any()


def test_a_source_hears_the_lasers_on_its_topic():
    both = replace(LASER, topic="/both")
    for source, marked in ((LASER, True), (REAR, False), (both, True)):
        costmap = build(replace(OBSTACLES, sources=(source,)), FLAT)
        costmap.update(HERE, (seen("front", 1.5),))
        assert (value(costmap, 2.525, 1.025) == 254) == marked


def test_of_two_lasers_on_one_topic_only_the_latest_scan_counts():
    costmap = build(replace(OBSTACLES, sources=(replace(LASER, topic="/both"),)), FLAT)
    costmap.update(HERE, (seen("front", 1.5), seen("rear", 1.0, y=1.525, time=0.05)))
    assert value(costmap, 2.525, 1.025) == 0
    assert value(costmap, 2.025, 1.525) == 254


def test_lasers_at_two_heights_do_not_clear_what_the_other_one_sees():
    """A table top, seen by the upper laser; the lower one looks through below it."""
    both = replace(OBSTACLES, sources=(LASER, REAR))
    costmap = build(with_voxels(both), FLAT)
    high, low = seen("front", 1.5, height=0.7), seen("rear", 2.5, height=0.3)
    costmap.update(HERE, (high, low))
    assert value(costmap, 2.525, 1.025) == 254
    costmap.update(HERE, (low,))
    assert value(costmap, 2.525, 1.025) == 254
    costmap.update(HERE, (seen("front", 2.5, height=0.7),))
    assert value(costmap, 2.525, 1.025) == 0
    plain = build(both, FLAT)
    plain.update(HERE, (high,))
    plain.update(HERE, (low,))
    assert value(plain, 2.525, 1.025) == 0


def test_rays_of_a_voxel_layer_end_two_cells_before_their_return():
    for layer, cost in ((OBSTACLES, 0), (with_voxels(OBSTACLES), 254)):
        costmap = build(layer, FLAT)
        costmap.update(HERE, (seen("front", 1.5),))
        costmap.update(HERE, (seen("front", 1.54),))
        assert value(costmap, 2.525, 1.025) == cost
        costmap.update(HERE, (seen("front", 1.65),))
        assert value(costmap, 2.525, 1.025) == 0


def test_a_column_is_unknown_while_too_many_of_its_voxels_are():
    plain = replace(OBSTACLES, sources=(LASER, REAR), track_unknown_space=True)
    layer = with_voxels(plain, z_resolution=1.0, z_voxels=2, unknown_threshold=0)
    costmap = build(layer, FLAT, track_unknown_space=True)
    costmap.update(HERE, (seen("front", 2.0, height=0.3),))
    assert value(costmap, 2.025, 1.025) == 255
    costmap.update(HERE, (seen("rear", 2.0, height=1.3),))
    assert value(costmap, 2.025, 1.025) == 0


@pytest.mark.parametrize(
    ("height", "column", "marks"),
    [(1.9, {}, True), (2.3, {}, False), (0.3, {"origin_z": 0.5}, True),
     (1.9, {"z_voxels": 5}, False)],
)  # fmt: skip
def test_heights_beyond_a_column_are_not_marked(height, column, marks):
    everything = replace(LASER, max_obstacle_height=5.0)
    layer = with_voxels(replace(OBSTACLES, sources=(everything,)), **column)
    costmap = build(layer, FLAT)
    costmap.update(HERE, (seen("front", 1.5, height=height),))
    assert (value(costmap, 2.525, 1.025) == 254) == marks


def test_points_have_single_precision_so_a_limit_may_be_passed_by_its_own_height():
    low = ObservationSource("scan", "/scan", max_obstacle_height=0.3)
    assert not hears_height(low, 0.3)
    assert hears_height(replace(low, max_obstacle_height=0.5), 0.5)
    assert not hears_height(replace(low, min_obstacle_height=0.7, max_obstacle_height=1.0), 0.7)


def test_a_window_that_rolls_shows_the_map_where_it_lies():
    rolling = {"rolling_window": True, "width": 3.0, "height": 3.0, "frame": "odom"}
    costmap = build(StaticLayer(), OBSTACLES, FLAT, grid=wall(2.025), **rolling)
    # The robot is at (1, 1) in odom; odom lies 0.5 m ahead in the map, so the wall is nearer.
    costmap.update(HERE, (), Pose2(0.5, 0.0))
    assert value(costmap, 1.525, 1.0) == 254
    assert value(costmap, 2.025, 1.0) == 0
    costmap.update(HERE, (), Pose2(0.5, 0.0, math.pi / 2))
    assert value(costmap, 1.525, 1.0) == 0


def test_resets_forget_the_layers_they_name_the_map_too():
    front, rear = replace(OBSTACLES, name="a/front"), replace(OBSTACLES, name="rear")
    layers = (StaticLayer("map"), front, replace(rear, sources=(REAR,)), INFLATION)
    costmap = build(*layers, grid=wall(6.025))
    costmap.update(FAR_AWAY, (seen("front", 2.5), seen("rear", 2.5, y=2.025)))
    names = ("front", "map", "inflation_layer", "nobody")
    assert costmap.clear_layers(HERE, 3.0, names) == ("map", "front")
    costmap.update(FAR_AWAY)
    assert value(costmap, 3.525, 1.025) == 0
    assert value(costmap, 3.525, 2.025) == 254
    assert value(costmap, 6.025, 1.0) != 254
    assert costmap.clear_layers(HERE, 3.0, ("nobody",)) == ()
    assert costmap.clear_layers(HERE, 3.0, None) == ("front", "rear")
