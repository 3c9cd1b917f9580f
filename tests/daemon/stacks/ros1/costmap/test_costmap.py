"""What marks, what clears and what it costs."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from daemon.stacks.ros1.costmap import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    SensedScan,
    StaticLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from grammars.model.grid import OccupancyGrid
from tests.daemon.stacks.ros1.costmap.plain import by_queue

A2S = ((-0.08, -0.075), (-0.08, 0.075), (0.105, 0.075), (0.105, -0.075))
DIFF = ((-0.35, -0.233), (-0.35, 0.233), (0.35, 0.233), (0.35, -0.233))
OMNI = ((-0.35, -0.22), (-0.35, 0.22), (0.35, 0.22), (0.35, -0.22))
LASER = ObservationSource("scan", "/scan", clearing=True, obstacle_range=3.0, raytrace_range=3.5)
OBSTACLES = ObstacleLayer(sources=(LASER,))
INFLATION = InflationLayer(inflation_radius=0.5, cost_scaling_factor=3.0)
STILL = LayeredCostmap((StaticLayer(), OBSTACLES, INFLATION), footprint=A2S)
ROLLING = LayeredCostmap(
    (OBSTACLES, INFLATION), "odom", footprint=A2S, rolling_window=True, width=3.0, height=3.0
)
FAR_AWAY = Pose2(9.0, 1.0)


def world(rows=60, columns=200):
    return OccupancyGrid(0.05, 0.0, 0.0, np.zeros((rows, columns), dtype=np.int8))


def layered(parameters=STILL, *, static=None, obstacles=None, source=None, inflation=None):
    """Return the costmap with values of its layers changed."""

    def changed(layer):
        if isinstance(layer, StaticLayer):
            return replace(layer, **(static or {}))
        if isinstance(layer, InflationLayer):
            return replace(layer, **(inflation or {}))
        sources = tuple(replace(each, **(source or {})) for each in layer.sources)
        return replace(layer, **{"sources": sources, **(obstacles or {})})

    return replace(parameters, layers=tuple(changed(layer) for layer in parameters.layers))


def build(parameters=STILL, grid=None, quirks=FAST):
    return Costmap(parameters, parameters.padded_footprint(), quirks, grid or world())


def with_voxels(layer, **column):
    """Return an obstacle layer as a voxel layer."""
    return VoxelLayer(**{f.name: getattr(layer, f.name) for f in fields(layer)}, **column)


def looking(away, x=1.025, y=1.025):
    """One ray along x from (x, y)."""
    ranges = np.array([away], dtype=np.float32)
    return SensedScan(Pose2(x, y), ranges, np.zeros(1), 0.05, 5.6)


def value(costmap, x, y):
    found = costmap.grid.cell(x, y)
    assert found is not None
    return int(costmap.grid.cells[found[1], found[0]])


@pytest.mark.parametrize(
    ("footprint", "radius", "scaling", "costs"),
    [
        (A2S, 0.5, 3.0, {0.0: 254, 0.05: 253, 0.5: 72, 0.55: 0}),
        (DIFF, 0.5, 3.0, {0.2: 253, 0.25: 246, 0.5: 116, 0.55: 0}),
        (DIFF, 0.55, 5.0, {0.55: 54, 0.6: 0}),
        (OMNI, 0.55, 3.0, {0.55: 96}),
        (OMNI, 0.5, 1.0, {0.5: 192}),
    ],
)
def test_costs_fall_with_the_distance_from_a_wall(footprint, radius, scaling, costs):
    grid = world()
    grid.cells[:, 100] = 100
    inflation = {"inflation_radius": radius, "cost_scaling_factor": scaling}
    parameters = replace(layered(inflation=inflation), footprint=footprint)
    costmap = build(parameters, grid)
    for away, cost in costs.items():
        assert value(costmap, 5.025 + away, 1.5) == cost
        assert value(costmap, 5.025 - away, 1.5) == cost


def test_unknown_cells_become_free():
    grid = world()
    grid.cells[:, 150:] = -1
    assert value(build(STILL, grid), 9.0, 1.0) == 0


@pytest.mark.parametrize(
    ("parameters", "quirks"),
    [(STILL, FIXED), (layered(obstacles={"track_unknown_space": True}), FAST)],
)
def test_unknown_cells_stay_unknown_until_a_ray_crosses_them(parameters, quirks):
    grid = world()
    grid.cells[:, 30:] = -1
    costmap = build(parameters, grid, quirks)
    for _ in range(4):
        costmap.update(Pose2(1.0, 1.0), (looking(3.2),))
    assert value(costmap, 2.0, 1.025) == 0
    assert value(costmap, 2.0, 1.6) == 255


def test_a_return_marks_and_a_longer_ray_clears():
    costmap = build()
    costmap.update(Pose2(1.0, 1.0), (looking(1.5),))
    assert value(costmap, 2.525, 1.025) == 254
    assert value(costmap, 2.525, 1.475) > 0
    costmap.update(Pose2(1.0, 1.0), (looking(2.5),))
    assert value(costmap, 2.525, 1.475) == 0
    assert value(costmap, 3.525, 1.025) == 254


def test_a_ray_without_return_neither_marks_nor_clears():
    costmap = build()
    costmap.update(Pose2(1.0, 1.0), (looking(1.5),))
    for lost in (math.inf, math.nan, 5.6, 0.04):
        costmap.update(Pose2(1.0, 1.0), (looking(lost),))
        assert value(costmap, 2.525, 1.025) == 254


def test_with_inf_is_valid_a_ray_without_return_clears():
    costmap = build(layered(source={"inf_is_valid": True}))
    costmap.update(Pose2(1.0, 1.0), (looking(1.5),))
    costmap.update(Pose2(1.0, 1.0), (looking(math.inf),))
    assert not costmap.grid.cells.any()


def test_rays_clear_farther_than_they_mark():
    costmap = build(layered(source={"obstacle_range": 6.0}))
    costmap.update(Pose2(1.0, 1.0), (looking(3.2),))
    assert value(costmap, 4.225, 1.025) == 254
    costmap = build()
    costmap.update(Pose2(1.0, 1.0), (looking(3.2),))
    assert not costmap.grid.cells.any()
    costmap.update(Pose2(1.0, 1.0), (looking(2.9),))
    assert value(costmap, 3.925, 1.025) == 254
    costmap.update(Pose2(1.0, 1.0), (looking(5.0),))
    assert not costmap.grid.cells.any()


def test_beyond_the_raytrace_range_nothing_is_cleared():
    costmap = build(layered(source={"obstacle_range": 5.0}))
    costmap.update(Pose2(1.0, 1.0), (looking(4.5),))
    costmap.update(Pose2(1.0, 1.0), (looking(4.9),))
    assert value(costmap, 5.525, 1.025) == 254


def test_an_old_scan_is_applied_again():
    costmap = build()
    scan = looking(1.5)
    costmap.update(Pose2(1.0, 1.0), (scan,))
    costmap.update(Pose2(2.525, 1.025))
    assert value(costmap, 2.525, 1.025) == 0
    costmap.update(FAR_AWAY, (scan,))
    assert value(costmap, 2.525, 1.025) == 254


def test_the_footprint_is_free_of_obstacles_but_not_of_walls():
    grid = world()
    grid.cells[20, 20] = 100
    costmap = build(layered(inflation={"inflation_radius": 0.0}), grid)
    costmap.update(FAR_AWAY, (looking(1.5),))
    assert value(costmap, 2.525, 1.025) == 254
    costmap.update(Pose2(2.5, 1.0))
    assert value(costmap, 2.525, 1.025) == 0
    costmap.update(Pose2(1.0, 1.0))
    assert value(costmap, 1.025, 1.025) == 254


def test_without_a_source_the_map_is_all_there_is():
    grid = world()
    grid.cells[:, 100] = 100
    deaf = build(layered(obstacles={"sources": ()}), grid)
    before = deaf.grid.cells.copy()
    blind = Costmap(ROLLING, ROLLING.padded_footprint(), FAST)
    for costmap in (deaf, blind):
        costmap.update(Pose2(1.0, 1.0), (looking(1.0),) if costmap is deaf else ())
    np.testing.assert_array_equal(deaf.grid.cells, before)
    assert not blind.grid.cells.any()


def test_a_source_of_another_height_or_without_marking_marks_nothing():
    for source in ({"min_obstacle_height": 0.5}, {"max_obstacle_height": -0.1}, {"marking": False}):
        costmap = build(layered(source=source))
        costmap.update(Pose2(1.0, 1.0), (looking(1.5),))
        assert not costmap.grid.cells.any()


def test_the_window_moves_by_whole_cells_toward_zero_and_keeps_what_it_knows():
    costmap = build(layered(ROLLING, obstacles={"footprint_clearing_enabled": False}))
    costmap.update(Pose2(0.0, 0.0), (looking(1.0, 0.0, 0.0),))
    x = costmap.grid.x
    assert value(costmap, 1.0, 0.0) == 254
    costmap.update(Pose2(0.049, -0.049))
    assert costmap.grid.x == x
    costmap.update(Pose2(0.151, 0.0))
    assert costmap.grid.x == pytest.approx(x + 0.1)
    assert value(costmap, 1.0, 0.0) == 254
    costmap.update(Pose2(4.0, 0.0))
    assert not costmap.grid.cells.any()


def test_without_the_quirk_the_window_moves_to_the_nearest_cell():
    costmap = build(ROLLING, quirks=FIXED)
    costmap.update(Pose2(0.0, 0.0))
    centre = costmap.grid.x
    costmap.update(Pose2(0.049, 0.0))
    assert costmap.grid.x == pytest.approx(centre + 0.05)


def test_a_cleared_square_comes_back_with_the_next_update():
    grid = world()
    grid.cells[:, 22] = 100
    costmap = build(STILL, grid)
    for _ in range(3):
        costmap.update(Pose2(1.0, 1.0))
    before = costmap.grid.cells.copy()
    costmap.clear_square(Pose2(1.0, 1.0), 0.46)
    assert value(costmap, 1.125, 1.025) == 0
    costmap.update(Pose2(1.0, 1.0))
    np.testing.assert_array_equal(costmap.grid.cells, before)


def test_a_cleared_square_out_of_sight_stays_clear():
    grid = world()
    grid.cells[:, 22] = 100
    costmap = build(STILL, grid)
    for _ in range(3):
        costmap.update(FAR_AWAY)
    costmap.clear_square(Pose2(1.0, 1.0), 0.46)
    costmap.update(FAR_AWAY)
    assert value(costmap, 1.125, 1.025) == 0


def test_a_working_reset_forgets_obstacles_far_from_the_robot():
    costmap = build()
    for away in (0.5, 2.5):
        costmap.update(FAR_AWAY, (replace(looking(away), pose=Pose2(1.025, 0.525 + away / 3)),))
    assert (costmap.grid.cells == 254).sum() == 2
    assert costmap.clear_layers(Pose2(1.0, 1.0), 3.0, ("obstacle_layer",)) == ("obstacle_layer",)
    costmap.update(FAR_AWAY)
    assert (costmap.grid.cells == 254).sum() == 1
    assert value(costmap, 1.525, 0.7) == 254


def test_what_changed_is_told_tightly():
    costmap = build()
    scan = looking(1.5)
    costmap.update(Pose2(1.0, 1.0), (scan,))
    changed = costmap.grid.watch()
    version = costmap.grid.version
    costmap.update(Pose2(1.0, 1.0), (scan,))
    assert costmap.grid.version == version
    costmap.update(Pose2(1.0, 1.0), (looking(1.55),))
    assert changed.take() == (40, 10, 62, 31)


def test_costmaps_of_one_map_do_not_share_their_cells():
    one, other = build(), build()
    one.update(Pose2(1.0, 1.0), (looking(1.5),))
    assert not other.grid.cells.any()


def test_the_nearest_obstacle_counts_and_the_original_hardly_ever_misses_it():
    rng = np.random.default_rng(3)
    grid = world(60, 60)
    grid.cells[:] = np.where(rng.random((60, 60)) < 0.02, 100, 0)
    costmap = build(layered(inflation={"cost_scaling_factor": 0.0}), grid)
    lethal = [(int(x), int(y)) for y, x in np.argwhere(grid.cells == 100)]
    away = by_queue(lethal, grid.cells.shape, 10)
    reached = costmap.grid.cells > 0
    assert reached[away < np.inf].all()
    assert (reached & (away == np.inf)).sum() <= 2


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (layered(inflation={"inflation_radius": 20.0}), "inflation_radius 20 m is 400 cells"),
        (replace(ROLLING, width=0.01), "has no cell"),
    ],
)
def test_impossible_costmaps_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        build(parameters)


def test_a_static_costmap_needs_a_map():
    with pytest.raises(ValueError, match="was given no map"):
        Costmap(STILL, STILL.padded_footprint(), FAST)


def test_a_scan_has_as_many_ranges_as_angles():
    scan = replace(looking(1.0), ranges=np.ones(2, dtype=np.float32))
    with pytest.raises(ValueError, match="2 ranges at 1 angles"):
        build().update(Pose2(1.0, 1.0), (scan,))
