"""The global and the local costmap on the corridor of building C, with the parameters of a2s.

The robot drives between the two far corners at 0.22 m/s and looks ten times a second; its estimate
is off by up to 0.1 m along the way and jumps every 0.2 m, as AMCL's does. Microseconds of CPU per
update; beside it what it takes to do the same bounds over as costmap_2d does, compiled as well.
"""

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from daemon.campaign import expand, load_campaign
from daemon.simulator import World
from daemon.stacks.ros1.costmap import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    SensedScan,
    StaticLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.costmap._inflation import inflate
from daemon.stacks.ros1.costmap._inflation_queue import inflate_in_order
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.costmap.master_grid import merge_window
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2
from templates.occupancy import occupancy_grid
from tests.benchmarks.measurement import Measurement, Reference
from tests.kernels import load_all

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
BEGIN, END, SPEED = (-12.86, 12.46), (20.76, 60.46), 0.22
FOOTPRINT = ((-0.08, -0.075), (-0.08, 0.075), (0.105, 0.075), (0.105, -0.075))
LASER = ObservationSource("scan", "/scan", clearing=True, obstacle_range=3.0, raytrace_range=3.5)
SEEN = ObstacleLayer(sources=(LASER,))
INFLATION = InflationLayer(inflation_radius=0.5, cost_scaling_factor=3.0)
GLOBAL = LayeredCostmap((StaticLayer(), SEEN, INFLATION), footprint=FOOTPRINT)
LOCAL = LayeredCostmap(
    (SEEN, replace(INFLATION, inflation_radius=0.55, cost_scaling_factor=5.0)), "odom",
    footprint=FOOTPRINT, rolling_window=True, width=3.0, height=3.0,
)  # fmt: skip
BOTH = replace(SEEN, sources=(LASER, replace(LASER, topic="/rear")))
VOXELS = VoxelLayer(sources=(LASER,))
TOPICS = {"/scan": ("",), "/rear": ("rear",)}


def drive(world, robot):
    """Return estimates of the base with the scan as seen from there and from the true pose."""
    laser = robot.laser
    angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    dx, dy = END[0] - BEGIN[0], END[1] - BEGIN[1]
    length, yaw = math.hypot(dx, dy), math.atan2(dy, dx)
    steps, bodies = [], world._bodies.at(0)
    for k in range(int(length / SPEED * 10.0)):
        done = k * SPEED / 10.0
        aside = 0.4 * math.sin(done / 5.0) - 0.7
        true = Pose2(BEGIN[0], BEGIN[1], yaw) @ Pose2(done, aside, 0.1 * math.cos(done / 5.0))
        jump = int(done / 0.2)
        error = Pose2(0.1 * math.sin(jump), 0.02 * math.cos(3 * jump), 0.01 * math.sin(7 * jump))
        ranges = world._scanner(None).scan(true, bodies, world._bodies.version)
        near, far = laser.range_min, laser.range_max
        base = true @ error
        steps.append(
            (
                base,
                SensedScan(base @ laser.mount, ranges, angles, near, far, laser.z),
                SensedScan(true @ laser.mount, ranges, angles, near, far, laser.z),
            )
        )
    return steps


def load():
    paper = expand(load_campaign(CAMPAIGNS / "ortega2024" / "first.yaml"))
    run = next(r for r in paper.specs if r.scenario == "S2")
    scene = {s.digest: s for s in paper.scenes}[run.scene]
    robot = replace(run.robot, laser=replace(run.robot.laser, rays=150, range_max=5.6))
    return scene, robot, occupancy_grid(scene, laser_height=robot.laser.z)


def over_again(costmap, window, *, in_order=False):
    """Return the seconds the plain cycle takes in the window, and whether it ends the same.

    ``in_order`` by the first obstacle to reach a cell (``inflation_queue_order``).
    """
    grid, table, changed = costmap._master, costmap._inflated.table, costmap._changed.copy()
    copy = grid._replace(cells=grid.cells.copy())
    begin = time.process_time()
    merge_window(copy, costmap._merged, True, window)
    (inflate_in_order if in_order else inflate)(copy, table, window, changed)
    taken = time.process_time() - begin
    return taken, bool(np.array_equal(copy.cells, grid.cells))


def report(name, grid, times, beside):
    """The mean time of an update."""
    rows, columns = grid.cells.shape
    worst = f"{np.percentile(times, 99) * 1e6:.1f} us 99 %, {columns} x {rows} cells"
    return Measurement(name, np.mean(times).item() * 1e6, "us", beside, (), worst)


def compare_layers(steps, world):
    """Yield what two lasers and a voxel layer cost beside one laser and an obstacle layer."""
    kinds = {"one laser": SEEN, "two lasers": BOTH, "voxel layer": VOXELS}
    for name, parameters in (("global", GLOBAL), ("local", LOCAL)):
        costmaps, times = {}, dict.fromkeys(kinds, 0.0)
        for kind, seen in kinds.items():
            layers = tuple(seen if layer is SEEN else layer for layer in parameters.layers)
            own = replace(parameters, layers=layers)
            costmaps[kind] = Costmap(own, own.padded_footprint(), FAST, world, TOPICS.__getitem__)
        # Side by side: each step by each of them, so that all see the same machine.
        for base, *seen_from in steps[::10]:
            scan = seen_from[0] if parameters is GLOBAL else seen_from[1]
            # The second laser sees the same from the other end of the robot.
            rear = replace(scan, pose=scan.pose @ Pose2(-0.2, 0.0, math.pi), laser="rear")
            for kind, costmap in costmaps.items():
                scans = (scan, rear) if kind == "two lasers" else (scan,)
                begin = time.process_time()
                costmap.update(base, scans)
                times[kind] += time.process_time() - begin
        updates = len(steps[::10])
        one = Reference("one laser", 1e6 * times["one laser"] / updates)
        for kind, taken in times.items():
            if kind != one.name:
                yield Measurement(f"{name}, {kind}", 1e6 * taken / updates, "us", one)


def measure():
    """Yield building, updates of both costmaps, and what more layers cost."""
    load_all()
    scene, robot, world_map = load()
    start = Pose2(BEGIN[0], BEGIN[1], 0.0)
    steps = drive(World(scene, robot, start, (), np.random.SeedSequence(1)), robot)
    built = []
    for _ in range(2):
        begin = time.process_time()
        costmap = Costmap(GLOBAL, GLOBAL.padded_footprint(), FAST, world_map)
        built.append(1e3 * (time.process_time() - begin))
    yield Measurement("global, built", built[0], "ms", Reference("built again", built[1]))
    local = Costmap(LOCAL, LOCAL.padded_footprint(), FAST)
    times = []
    plain = []
    ordered = []
    locally = []
    changed, differ = 0, 0
    window = costmap.grid.watch()
    for k, (base, scan, exact) in enumerate(steps):
        window.take()
        begin = time.process_time()
        costmap.update(base, (scan,))
        times.append(time.process_time() - begin)
        x0, y0, x1, y1 = window.take()
        changed += (x1 - x0) * (y1 - y0)
        if k % 20 == 5:
            bounds = costmap._work.window(costmap._master.frame)
            taken, same = over_again(costmap, bounds)
            plain.append(taken)
            differ += not same
            ordered.append(over_again(costmap, bounds, in_order=True)[0])
        if k % 10 == 0:
            begin = time.process_time()
            local.update(base, (exact,))
            locally.append(time.process_time() - begin)
    plainly = Reference("the plain cycle alone", np.mean(plain).item() * 1e6)
    yield report("global, an update", costmap.grid, times[2:], plainly)
    yield report("  the plain cycle in the queue's order", costmap.grid, ordered, plainly)
    beside = Reference("global", np.mean(times[2:]).item() * 1e6)
    yield report("local, an update", local.grid, locally, beside)
    yield Measurement(
        "cells in touched windows, an update", changed / len(steps), "cells",
        Reference("all of the global", costmap.grid.cells.size), (),
        f"{differ} of {len(plain)} plain cycles end otherwise",
    )  # fmt: skip
    yield from compare_layers(steps, world_map)
