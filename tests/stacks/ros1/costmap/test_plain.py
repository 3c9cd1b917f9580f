"""The costmap leaves the same cells as the plain update cycle, whatever happens."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.costmap import SensedScan
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from grammars.model.grid import OccupancyGrid
from tests.stacks.ros1.costmap.plain import PlainCostmap

ROWS, COLUMNS = 22, 30
ANGLES = {"front": np.linspace(-2.0, 2.0, 23), "rear": np.linspace(-1.0, 1.5, 11)}
MOUNTS = {"front": Pose2(0.05, 0.0), "rear": Pose2(-0.05, 0.01, 3.0)}
HEARS = {"/scan": ("front",), "/rear": ("rear",), "/both": ("front", "rear"), "/none": ()}
RING = np.array([[-0.08, -0.06], [0.1, -0.06], [0.1, 0.06], [-0.08, 0.06]])

QUIRKS = st.sampled_from([FAST, FIXED, replace(FAST, inflation_queue_order=True)])


def random_map(rng):
    share = [0.9, 0.05, 0.04, 0.01] if rng.random() < 0.7 else [1.0, 0.0, 0.0, 0.0]
    cells = rng.choice(np.array([0, 100, -1, 70], dtype=np.int8), size=(ROWS, COLUMNS), p=share)
    return OccupancyGrid(0.05, -0.3, -0.2, cells)


class RandomLasers:
    """Two lasers that see anything, ten times a second, each at a height of its own."""

    def __init__(self, rng):
        self.rng, self.now, self.scans = rng, 0.0, list[SensedScan]()
        heights = rng.choice([0.0, 0.1, 0.3, 0.6, 0.7, 1.9, 2.0, 2.3], 2).tolist()
        self.heights = dict(zip(ANGLES, heights, strict=True))

    def look(self, base):
        """Maybe scan from ``base``; return the last seven scans."""
        for name, angles in ANGLES.items():
            if self.rng.random() < 0.7:
                ranges = self.rng.uniform(0.02, 1.1, angles.size).astype(np.float32)
                ranges[self.rng.random(angles.size) < 0.2] = np.inf
                ranges[self.rng.random(angles.size) < 0.05] = np.nan
                pose, height = base @ MOUNTS[name], self.heights[name]
                stamps = (self.now, self.now + 0.051)
                scan = SensedScan(pose, ranges, angles, 0.05, 1.0, height, name, *stamps)
                self.scans.append(scan)
        self.now += 0.1
        return tuple(self.scans[-7:])


def random_pose(rng):
    return Pose2(*rng.uniform((-0.35, -0.25, -3.0), (1.3, 1.0, 3.0)).tolist())


def random_source(rng):
    return ObservationSource(
        "source",
        str(rng.choice(["/scan", "/scan", "/rear", "/both", "/none"])),
        marking=bool(rng.random() < 0.9),
        clearing=bool(rng.random() < 0.9),
        obstacle_range=float(rng.uniform(0.2, 1.0)),
        raytrace_range=float(rng.uniform(0.2, 1.0)),
        min_obstacle_height=float(rng.choice([0.0, 0.0, 0.3])),
        inf_is_valid=bool(rng.random() < 0.3),
        observation_persistence=float(rng.choice([0.0, 0.0, 0.0, 0.04, 0.151, 0.3])),
    )


def random_obstacles(rng, name, methods):
    column = {
        "origin_z": float(rng.choice([0.0, 0.1])),
        "z_resolution": float(rng.choice([0.1, 0.2])),
        "z_voxels": int(rng.choice([3, 10, 16])),
        "unknown_threshold": int(rng.choice([15, 2, 9])),
        "mark_threshold": int(rng.choice([0, 0, 1])),
    }
    layer = ObstacleLayer(
        name,
        tuple(random_source(rng) for _ in range(int(rng.integers(1, 3)))),
        footprint_clearing_enabled=bool(rng.random() < 0.8),
        combination_method=int(rng.choice(methods)),
        track_unknown_space=bool(rng.random() < 0.4),
    )
    if rng.random() < 0.4:
        layer = VoxelLayer(**{f.name: getattr(layer, f.name) for f in fields(layer)}, **column)
    return layer


def random_inflation(rng, name="inflation"):
    return InflationLayer(
        name,
        inflation_radius=float(rng.choice([0.0, 0.1, 0.13, 0.15, 0.22, 0.3])),
        cost_scaling_factor=float(rng.choice([1.0, 8.0])),
        inflate_unknown=bool(rng.random() < 0.3),
    )


def random_static(rng, name="map"):
    return StaticLayer(
        name,
        track_unknown_space=bool(rng.random() < 0.6),
        use_maximum=bool(rng.random() < 0.3),
        lethal_cost_threshold=int(rng.choice([100, 100, 65, 1])),
        unknown_cost_value=int(rng.choice([-1, -1, 0, 1, 100, 255])),
        trinary_costmap=bool(rng.random() < 0.7),
    )


def common_layers(rng, *, static):
    """What people have: perhaps the map, layers of obstacles, inflation at last."""
    methods = (1,) if rng.random() < 0.6 else (0, 1, 2)
    count = int(rng.integers(1, 4))
    seen = [random_obstacles(rng, f"seen{k}", methods) for k in range(count)]
    below = [random_static(rng)] if static else []
    above = [random_inflation(rng)] if rng.random() < 0.9 else []
    return (*below, *seen, *above)


def any_layers(rng):
    """Layers of every sort in any order."""
    layers = [
        random_static(rng),
        random_obstacles(rng, "seen0", (0, 1, 2)),
        random_obstacles(rng, "seen1", (0, 1, 2)),
        random_inflation(rng),
        random_inflation(rng, "more"),
        random_static(rng, "again"),
    ]
    rng.shuffle(layers)
    return tuple(layers[: int(rng.integers(0, len(layers) + 1))])


def random_costmap(rng, layers):
    return LayeredCostmap(
        layers, width=1.2, height=0.9, track_unknown_space=bool(rng.random() < 0.5)
    )


def compare(parameters, rng, steps, quirks=FAST):
    world = random_map(rng)
    costmap = Costmap(parameters, RING, quirks, world, HEARS.__getitem__)
    plain = PlainCostmap(parameters, RING, quirks, world, HEARS)
    lasers = RandomLasers(rng)
    frame = Pose2()
    for _ in range(steps):
        base = random_pose(rng)
        scans = lasers.look(base)
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
        elif what < 0.5:
            names = rng.choice(["seen0", "seen1", "map", "inflation"], 2).tolist()
            inside = bool(rng.random() < 0.5)
            costmap.clear_layers(base, 0.5, names, inside=inside)
            plain.clear_layers(base, 0.5, names, inside=inside)
        if parameters.frame == "odom":
            frame = Pose2(*rng.uniform(-0.1, 0.1, 2).tolist(), float(rng.uniform(-0.2, 0.2)))
        before = costmap.grid.cells.copy()
        where_before = (costmap.grid.x, costmap.grid.y)
        changed = costmap.grid.watch()
        costmap.update(base, scans, frame)
        plain.update(base, scans, frame)
        place = (plain.master.x, plain.master.y)
        assert (costmap.grid.x, costmap.grid.y) == pytest.approx(place)
        np.testing.assert_array_equal(costmap.grid.cells, plain.cells)
        x0, y0, x1, y1 = changed.take()
        same = before == costmap.grid.cells
        same[y0:y1, x0:x1] = True
        assert same.all() or where_before != (costmap.grid.x, costmap.grid.y)


@given(seed=st.integers(0, 2**32 - 1), quirks=QUIRKS)
def test_a_grid_that_follows_changes_shows_what_the_plain_cycle_shows(seed, quirks):
    rng = np.random.default_rng(seed)
    compare(random_costmap(rng, common_layers(rng, static=True)), rng, 8, quirks)


@given(seed=st.integers(0, 2**32 - 1), quirks=QUIRKS, rolling=st.booleans())
def test_a_grid_without_a_map_shows_what_the_plain_cycle_shows(seed, quirks, rolling):
    rng = np.random.default_rng(seed)
    parameters = random_costmap(rng, common_layers(rng, static=False))
    compare(replace(parameters, rolling_window=rolling), rng, 6, quirks)


@given(seed=st.integers(0, 2**32 - 1), rolling=st.booleans(), odom=st.booleans())
def test_layers_in_any_order_show_what_the_plain_cycle_shows(seed, rolling, odom):
    rng = np.random.default_rng(seed)
    parameters = random_costmap(rng, any_layers(rng))
    frame = "odom" if odom and rolling else "map"
    compare(replace(parameters, rolling_window=rolling, frame=frame), rng, 6)


@given(seed=st.integers(0, 2**32 - 1))
def test_a_window_that_rolls_over_the_map_shows_what_the_plain_cycle_shows(seed):
    rng = np.random.default_rng(seed)
    parameters = random_costmap(rng, common_layers(rng, static=True))
    frame = "odom" if rng.random() < 0.7 else "map"
    compare(replace(parameters, rolling_window=True, frame=frame), rng, 6)
