"""Costs of published robots, quirks, what is told of changes, and costmaps that are refused."""

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


def test_a_ray_without_return_neither_marks_nor_clears():
    costmap = build()
    costmap.update(Pose2(1.0, 1.0), (looking(1.5),))
    for lost in (math.inf, math.nan, 5.6, 0.04):
        costmap.update(Pose2(1.0, 1.0), (looking(lost),))
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


def test_without_the_quirk_the_window_moves_to_the_nearest_cell():
    costmap = build(ROLLING, quirks=FIXED)
    costmap.update(Pose2(0.0, 0.0))
    centre = costmap.grid.x
    costmap.update(Pose2(0.049, 0.0))
    assert costmap.grid.x == pytest.approx(centre + 0.05)


def test_each_reader_learns_tightly_what_changed():
    costmap = build()
    scan = looking(1.5)
    costmap.update(Pose2(1.0, 1.0), (scan,))
    readers = costmap.grid.watch(), costmap.grid.watch()
    version = costmap.grid.version
    costmap.update(Pose2(1.0, 1.0), (scan,))
    assert costmap.grid.version == version
    costmap.update(Pose2(1.0, 1.0), (looking(1.55),))
    assert [each.take() for each in readers] == [(40, 10, 62, 31)] * 2


def test_costmaps_of_one_map_do_not_share_their_cells():
    one, other = build(), build()
    one.update(Pose2(1.0, 1.0), (looking(1.5),))
    assert not other.grid.cells.any()


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
